// Bar of a recorded session: play, step, position, speed, and the result of the comparison.

import { element, seconds, setData, setText } from "./dom.js";
import type { Replay } from "./frames.js";
import type { ReplayControls } from "./orders.js";

const JUMP_S = 5;

/** "1:05.250" for 65.25 s. */
function milliseconds(value: number): string {
  const whole = Math.round(1000 * value);
  return `${Math.floor(whole / 60000)}:${((whole % 60000) / 1000).toFixed(3).padStart(6, "0")}`;
}

export class ReplayBar {
  private readonly bar = element<HTMLElement>("#replay");
  private readonly place = element<HTMLInputElement>("#replay-place");
  private readonly speed = element<HTMLSelectElement>("#replay-speed");
  private now: Replay | null = null;
  private dragging = false;

  constructor(private readonly send: (controls: ReplayControls) => void) {
    element("#replay-play").addEventListener("click", () => this.togglePlay());
    element("#replay-back").addEventListener("click", () => this.step(-1));
    element("#replay-on").addEventListener("click", () => this.step(1));
    this.place.addEventListener("input", () => {
      this.dragging = true;
      this.ask({ atS: Number(this.place.value) });
    });
    this.place.addEventListener("change", () => (this.dragging = false));
    this.speed.addEventListener("change", () => this.ask({}));
    addEventListener("keydown", (event) => this.press(event));
  }

  get shown(): boolean {
    return this.now !== null;
  }

  get playing(): boolean {
    return this.now?.playing === true;
  }

  take(replay: Replay): void {
    this.now = replay;
    this.bar.hidden = false;
    if (!this.dragging) {
      this.place.max = String(replay.length_s);
      this.place.value = String(replay.at_s);
    }
    if (document.activeElement !== this.speed) this.speed.value = String(Number(replay.speed.toFixed(2)));
    setText(element("#replay-play span"), replay.playing ? "Pause" : "Play");
    setText(element("#replay-time"), `${milliseconds(replay.at_s)} of ${seconds(replay.length_s)}`);
    const [level, text] = ReplayBar.verdict(replay);
    setText(element("#replay-check"), text);
    setData(element<HTMLElement>("#replay-check"), "level", level);
  }

  static verdict({ check, damage, states }: Replay): ["" | "warn", string] {
    if (damage !== "") return ["warn", `log: ${damage}`];
    if (check === null) return ["", "not compared: the scene file is missing"];
    if (check.error !== "") return ["warn", check.error];
    if (check.differing > 0) return ["warn", `${check.differing} states differ, the first at tick ${check.first_difference}`];
    if (check.done) return ["", `all ${check.states} states repeated bit for bit`];
    return ["", `${Math.floor((100 * (check.states + check.missing)) / states)} % repeated, 0 differ`];
  }

  private togglePlay(): void {
    this.ask({ play: !this.playing });
  }

  private step(steps: number): void {
    this.ask({ play: false, steps });
  }

  private ask(wanted: Partial<ReplayControls>): void {
    if (this.now === null) return;
    this.send({ play: this.now.playing, speed: Number(this.speed.value), atS: NaN, steps: 0, ...wanted });
  }

  private press(event: KeyboardEvent): void {
    if (!this.shown || event.ctrlKey || event.altKey || event.metaKey) return;
    if (document.querySelector("dialog[open]") !== null) return;
    const onControl = event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement;
    const jump = (seconds: number) => this.ask({ atS: Math.max(this.now!.at_s + seconds, 0) });
    if (event.code === "Space" && !(event.target instanceof HTMLButtonElement)) this.togglePlay();
    else if (event.code === "ArrowRight" && !onControl) event.shiftKey ? jump(JUMP_S) : this.step(1);
    else if (event.code === "ArrowLeft" && !onControl) event.shiftKey ? jump(-JUMP_S) : this.step(-1);
    else return;
    event.preventDefault();
  }
}
