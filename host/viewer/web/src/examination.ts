// Task and examination: the target, its result, and a mode with only X-ray and a clock.

import { element, seconds, setData, setText, short } from "./dom.js";
import type { Lines, Readings, Scene, WireState } from "./frames.js";

export class Examination {
  private readonly task = element<HTMLElement>("#task");
  private lines: Lines | null = null;
  private scene: Scene | null = null;
  private beganMs = 0;
  private tookS: number | null = null; // until the target was reached

  setLines(lines: Lines): void {
    this.lines = lines;
  }

  setScene(scene: Scene): void {
    this.scene = scene;
  }

  get on(): boolean {
    return document.body.classList.contains("exam");
  }

  /** Starts or ends the examination, and sets its clock to zero. */
  set(on: boolean, nowMs: number): void {
    document.body.classList.toggle("exam", on);
    element("#exam").setAttribute("aria-pressed", String(on));
    this.beganMs = nowMs;
    this.tookS = null;
    this.showClock(false, nowMs);
  }

  /** Four times a second. */
  refresh(readings: Readings | null, state: WireState | null, nowMs: number): void {
    const reached = readings?.values["target_reached"] === 1;
    this.showClock(reached, nowMs);
    const target = this.lines !== null && this.lines.hash === this.scene?.hash ? this.lines.target : null;
    this.task.hidden = target === null || state === null;
    if (target === null || state === null) return;
    const tip = state.instruments[target.instrument]?.tipMm ?? target.at_mm;
    const leftMm = Math.hypot(...target.at_mm.map((value, axis) => value - tip[axis]!));
    setText(this.task.firstElementChild!, "Target");
    setData(this.task, "level", "");
    // A real X-ray screen shows no distance.
    const unknown = readings?.values["target_reached"] === null;
    const left = this.on ? (unknown ? "not known" : "not reached") : `${short(leftMm)} mm from the tip`;
    if (!reached) return setText(this.task.lastElementChild!, left);
    const safe = readings.values["safe_success"] ?? null;
    const atS = readings.values["target_reached_s"] ?? null;
    const time = atS === null ? "at an unknown time" : `after ${seconds(atS)}`;
    const most = short(readings.values["wall_force_max_mN"] ?? NaN);
    setData(this.task, "level", safe === 1 ? "good" : "warn");
    const mark =
      safe === 1 ? ", safely"
      : safe === null ? "; its safety is not known"
      : `; wall force ${most} mN, above the limit of ${short(target.force_limit_mN)} mN`;
    setText(this.task.lastElementChild!, `reached ${time}${mark}`);
  }

  private showClock(reached: boolean, nowMs: number): void {
    const passedS = (nowMs - this.beganMs) / 1000;
    if (reached && this.tookS === null) this.tookS = passedS;
    setText(element("#clock"), seconds(this.tookS ?? passedS));
  }
}
