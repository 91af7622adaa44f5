// The keys that steer: what is held down now, as rates. Sent ten times a second as well as at each
// change, because torquer-viewer takes a page that is silent for gone.

import type { Controls } from "./frames.js";

const PUSH_MM_S = 40;
const TURN_RAD_S = Math.PI;
const ARM_RAD_S = Math.PI / 6;
const FINE = 0.15;
const BEAT_MS = 100;

const HELD = new Set([
  "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "Space", "KeyC", "KeyW", "KeyA", "KeyS", "KeyD",
]);

export class Keyboard {
  private readonly down = new Set<string>();
  private fine = false;
  private instrument = 0;
  private instruments = 1;
  private captured = true; // whether Tab chooses instruments, or goes through the page
  enabled = false;

  constructor(
    private readonly send: (controls: Controls) => void,
    private readonly changed: () => void,
  ) {
    addEventListener("keydown", (event) => this.press(event));
    addEventListener("keyup", (event) => this.lift(event));
    addEventListener("blur", () => this.liftAll());
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.liftAll();
    });
    setInterval(() => this.tell(), BEAT_MS);
  }

  get chosen(): number {
    return this.instrument;
  }
  get steers(): boolean {
    return this.enabled && this.captured;
  }

  setInstruments(count: number): void {
    this.instruments = Math.max(count, 1);
    if (this.instrument >= this.instruments) this.instrument = 0;
  }

  controls(): Controls {
    const held = (code: string) => (this.down.has(code) ? 1 : 0);
    const speed = this.fine ? FINE : 1;
    return {
      xray: held("Space") === 1,
      contrast: held("KeyC") === 1,
      instrument: this.instrument,
      pushMmS: speed * PUSH_MM_S * (held("ArrowUp") - held("ArrowDown")),
      turnRadS: speed * TURN_RAD_S * (held("ArrowRight") - held("ArrowLeft")),
      laoRadS: ARM_RAD_S * (held("KeyD") - held("KeyA")),
      craRadS: ARM_RAD_S * (held("KeyW") - held("KeyS")),
    };
  }

  private tell(): void {
    if (this.enabled && !document.hidden) this.send(this.controls());
  }

  private press(event: KeyboardEvent): void {
    const dialogOpen = document.querySelector("dialog[open]") !== null;
    if (!this.enabled || dialogOpen || event.ctrlKey || event.altKey || event.metaKey) return;
    this.fine = event.shiftKey;
    if (event.code.startsWith("Arrow")) this.captured = true;
    if (event.code === "Escape") this.captured = false;
    // A button that has the focus is pressed by the space bar.
    const onButton = event.target instanceof HTMLButtonElement && !this.captured;
    if (event.code === "Tab" && this.captured) {
      event.preventDefault();
      this.instrument = (this.instrument + (event.shiftKey ? this.instruments - 1 : 1)) % this.instruments;
    } else if (HELD.has(event.code) && !onButton) {
      event.preventDefault();
      if (event.repeat) return;
      if (this.captured && document.activeElement instanceof HTMLElement) document.activeElement.blur();
      this.down.add(event.code);
    }
    this.tell();
    this.changed();
  }

  private lift(event: KeyboardEvent): void {
    this.fine = event.shiftKey;
    this.down.delete(event.code);
    this.tell();
  }

  private liftAll(): void {
    this.down.clear();
    this.fine = false;
    if (this.enabled) this.send(this.controls());
  }
}
