// Task and examination: the target, its result, and a mode with only X-ray and a clock.

import { element, seconds, setData, setText, short } from "./dom.js";
import type { Lines, Readings, Scene, WireState } from "./frames.js";

export class Examination {
  private readonly task = element<HTMLElement>("#task");
  private lines: Lines | null = null;
  private scene: Scene | null = null;
  private beganS = 0; // simulated time
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

  /** Starts or ends the examination, whose clock counts from a simulated time. That of a case begins at 0, so a reload keeps it. */
  set(on: boolean, beganS: number): void {
    document.body.classList.toggle("exam", on);
    element("#exam").setAttribute("aria-pressed", String(on));
    this.beganS = beganS;
    this.tookS = null;
    setText(element("#clock"), seconds(0));
  }

  /** Four times a second. */
  refresh(readings: Readings | null, state: WireState | null): void {
    const reached = readings?.values["target_reached"] === 1;
    if (state !== null) this.showClock(reached ? (readings.values["target_reached_s"] ?? state.timeS) : null, state.timeS);
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

  private showClock(reachedS: number | null, nowS: number): void {
    if (reachedS !== null) this.tookS ??= Math.max(reachedS, this.beganS);
    setText(element("#clock"), seconds((this.tookS ?? nowS) - this.beganS));
  }
}
