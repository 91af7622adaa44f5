// The keys that steer.

import type { Held, Source, Steering } from "./steering.js";

const FINE = 0.15;

// A USB foot switch is a keyboard. One pedal usually sends b as delivered; of three, the middle one b, the right one c.
const HELD = new Set([
  "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "Space", "KeyB", "Enter", "NumpadEnter", "KeyC", "KeyW", "KeyA", "KeyS", "KeyD",
  "KeyY", "KeyG", "KeyH", "KeyJ", "PageUp", "PageDown",
]);

export class Keyboard implements Source {
  private readonly down = new Set<string>();
  private fine = false;
  private captured = true; // true: Tab selects instruments; false: Tab moves through the page

  constructor(private readonly steering: Steering) {
    steering.add(this);
    addEventListener("keydown", (event) => this.press(event));
    addEventListener("keyup", (event) => this.lift(event));
  }

  get steers(): boolean {
    return this.steering.enabled && this.captured;
  }

  held(): Held {
    const held = (code: string) => (this.down.has(code) ? 1 : 0);
    const speed = this.fine ? FINE : 1;
    return {
      xray: held("Space") + held("KeyB") > 0,
      acquisition: held("Enter") + held("NumpadEnter") > 0,
      contrast: held("KeyC") === 1,
      push: speed * (held("ArrowUp") - held("ArrowDown")),
      turn: speed * (held("ArrowRight") - held("ArrowLeft")),
      lao: held("KeyD") - held("KeyA"),
      cra: held("KeyW") - held("KeyS"),
      tableLeft: held("KeyJ") - held("KeyG"),
      tableHead: held("KeyY") - held("KeyH"),
      tableUp: held("PageUp") - held("PageDown"),
    };
  }

  release(): void {
    this.down.clear();
    this.fine = false;
  }

  private press(event: KeyboardEvent): void {
    const dialogOpen = document.querySelector("dialog[open]") !== null;
    if (!this.steering.enabled || dialogOpen || event.ctrlKey || event.altKey || event.metaKey) return;
    this.fine = event.shiftKey;
    if (event.code.startsWith("Arrow")) this.captured = true;
    if (event.code === "Escape") this.captured = false;
    // The space bar and Enter press a focused button.
    const onButton = event.target instanceof HTMLButtonElement && !this.captured;
    if (event.code === "Tab" && this.captured) {
      event.preventDefault();
      this.steering.next(event.shiftKey ? -1 : 1);
    } else if (HELD.has(event.code) && !onButton) {
      event.preventDefault();
      if (event.repeat) return;
      if (this.captured && document.activeElement instanceof HTMLElement) document.activeElement.blur();
      this.down.add(event.code);
    }
    this.steering.tell();
  }

  private lift(event: KeyboardEvent): void {
    this.fine = event.shiftKey;
    this.down.delete(event.code);
    this.steering.tell();
  }
}
