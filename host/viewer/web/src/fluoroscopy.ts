// X-ray screen: the simulator's picture with window and level, and the figures of a screen in a catheter laboratory.

import { element, Rows, seconds, setData, setText, short, signed } from "./dom.js";
import type { Picture, Readings } from "./frames.js";
import { injectorWords } from "./injector.js";
import { Loops } from "./loops.js";
import { Measure } from "./measure.js";
import { PictureCanvas } from "./picture_canvas.js";
import { FactTimes, FieldTimes } from "./picture_scale.js";
import { Subtraction } from "./subtraction.js";

const DEG = 180 / Math.PI;
const MOST_ZOOM = 4;
const MASK_LOST_SHOWN_S = 5; // of simulated time
const DAMAGED_SHOWN_MS = 5000; // after the last damaged picture
const SCALE_STEPS_MM = [1, 2, 5, 10, 20, 50, 100];

/** "LAO 30°": the patient's side or end that the detector leans to. */
function angle(rad: number, positive: string, negative: string): string {
  const degrees = Math.round(rad * DEG);
  return `${degrees < 0 ? negative : positive} ${Math.abs(degrees)}°`;
}

/** "L 12": the patient's side or end that the table has moved to, and mm. */
function towards(mm: number, positive: string, negative: string): string {
  return `${mm < 0 ? negative : positive} ${Math.abs(mm).toFixed(0)}`;
}

/** Sum of a figure of the dose over the planes; null if it is not known, undefined if the scene has none. */
function sumOfPlanes(values: Readings["values"], name: string): number | null | undefined {
  const [first, second] = [values[name], values[`lateral_${name}`]];
  if (first === undefined || second === undefined) return first;
  return first === null || second === null ? null : first + second;
}

/** Sides of the patient at the left, right, top and bottom edge of a picture, as a viewer of the detector sees it. */
export function sidesOf(laoRad: number, craRad: number): [string, string, string, string] {
  // Directions to the patient's left, back and head, each with its opposite.
  const named = (left: number, back: number, head: number) => {
    const parts: [number, string][] = [
      [Math.abs(left), left > 0 ? "L" : "R"],
      [Math.abs(back), back > 0 ? "P" : "A"],
      [Math.abs(head), head > 0 ? "H" : "F"],
    ];
    // A second letter from 22.5 degrees on.
    return parts.sort((a, b) => b[0] - a[0]).filter(([part], k) => k === 0 || (k === 1 && part > 0.383)).map(([, letter]) => letter).join("");
  };
  const [cosLao, sinLao] = [Math.cos(laoRad), Math.sin(laoRad)];
  const right: [number, number, number] = [cosLao, sinLao, 0];
  const up: [number, number, number] = [-Math.sin(craRad) * sinLao, Math.sin(craRad) * cosLao, Math.cos(craRad)];
  const opposite = ([x, y, z]: [number, number, number]): [number, number, number] => [-x, -y, -z];
  return [named(...opposite(right)), named(...right), named(...up), named(...opposite(up))];
}

function showSides(at: HTMLElement, laoRad: number, craRad: number): void {
  for (const [k, side] of sidesOf(laoRad, craRad).entries()) setText(at.children[k]!, side);
}

export class Fluoroscopy {
  private readonly canvas = element<HTMLCanvasElement>("#xray-picture");
  private readonly unreadable = () => {
    this.damagedMs = performance.now();
    this.warn();
  };
  private readonly changed = () => this.measure.changed();
  private readonly picture = new PictureCanvas(this.canvas, () => this.drawScale(), this.unreadable, this.changed);
  private readonly lateral = new PictureCanvas(element("#lateral-picture"), () => {}, this.unreadable, this.changed);
  private readonly reference = new PictureCanvas(element("#reference-picture"), () => {}, this.unreadable, this.changed);
  private readonly fields = new FieldTimes();
  private readonly facts = new FactTimes();
  private readonly lateralFields = new FieldTimes();
  readonly measure = new Measure([
    { canvas: this.picture, fields: this.fields },
    { canvas: this.reference, fields: this.fields },
    { canvas: this.lateral, fields: this.lateralFields },
  ]);
  readonly subtraction = new Subtraction(this.facts, () => this.subtractAgain(), () => this.picture);
  private shown: Picture | null = null; // of the first plane
  private readonly dose = new Rows(element("#dose"));
  private newest: Picture | null = null; // from the simulator
  private fieldMm = 0;
  private kermaRate = ""; // of each plane, under X-rays
  private damagedMs = -Infinity; // time of the last picture that was damaged
  private maskLost = false;
  private level = 128; // gray that is shown as the middle
  private width = 256; // grays from black to white
  private zoom = 1;
  private centerX = 0.5; // point of the picture in the middle of the screen
  private centerY = 0.5;
  private readonly loops = new Loops();

  constructor() {
    this.listen();
    this.sayWindow();
    new ResizeObserver(() => this.drawScale()).observe(this.canvas);
  }

  /** Shows a picture from the simulator. A new picture ends the playing of a loop. */
  show(picture: Picture): void {
    this.newest = picture;
    if (this.loops.add(picture)) this.subtraction.begin(picture);
    if (!this.loops.playing) this.display(picture);
    this.sayLoop();
  }

  /** Shows a picture of the second plane: fixed arm; window and level of the first plane. */
  showLateral(picture: Picture): void {
    this.lateral.show(picture);
    const [lao, cra] = [angle(picture.laoRad, "LAO", "RAO"), angle(picture.craRad, "CRA", "CAU")];
    setText(element("#lateral-angles"), `${lao}  ${cra}`);
    showSides(element("#lateral-sides"), picture.laoRad, picture.craRad);
  }

  /** Called once per frame of the screen: shows the next picture of the playing loop. */
  advance(nowMs: number): void {
    const picture = this.loops.due(nowMs);
    if (picture === null) return;
    this.display(picture);
    this.setAngles(picture.laoRad, picture.craRad);
  }

  /** Numbers of the pictures on the page. held: true if the first plane shows the last image hold. */
  get drawn(): { picture: number | null; reference: number | null; lateral: number | null; held: boolean } {
    const [picture, reference, lateral] = [this.picture, this.reference, this.lateral].map((canvas) => canvas.picture?.number ?? null);
    return { picture: picture!, reference: reference!, lateral: lateral!, held: this.picture.picture?.held ?? false };
  }

  get playing(): boolean {
    return this.loops.playing;
  }

  /** Stops the loop at the next picture, or with -1 at the previous one. */
  stepLoop(by: number): void {
    const picture = this.loops.step(by);
    if (picture === null) return;
    this.display(picture);
    this.setAngles(picture.laoRad, picture.craRad);
    this.sayLoop();
  }

  togglePlay(): void {
    if (!this.loops.playing) {
      this.loops.play(performance.now());
    } else {
      this.loops.stop();
      if (this.newest !== null) this.display(this.newest);
    }
    this.sayLoop();
  }

  setAngles(laoRad: number, craRad: number): void {
    setText(element("#lao"), angle(laoRad, "LAO", "RAO"));
    setText(element("#cra"), angle(craRad, "CRA", "CAU"));
    // View from in front of the patient: the patient's left is on the right.
    const spot = element<SVGCircleElement>("#arm-spot");
    spot.setAttribute("cx", (18 * (laoRad / (Math.PI / 2))).toFixed(1));
    spot.setAttribute("cy", (-18 * (craRad / (Math.PI / 2))).toFixed(1));
  }

  setLamp(on: boolean): void {
    const lamp = element<HTMLElement>("#lamp");
    setData(lamp, "on", String(on));
    setText(lamp.lastElementChild!, on ? "X-RAY ON" : "X-RAY OFF");
  }

  /** The line below the lamp. Under X-rays it has the rate of the air kerma, where the scene publishes it. */
  setHold(xray: boolean, text: string): void {
    setText(element("#hold"), xray ? this.kermaRate : text);
    this.warn();
  }

  // A picture that is missing is the graver problem.
  private warn(): void {
    const damaged = performance.now() - this.damagedMs < DAMAGED_SHOWN_MS;
    setText(element("#picture-warning"), damaged ? "Picture lost: damaged" : this.maskLost ? "View moved: mask lost" : "");
  }

  setNotice(text: string): void {
    setText(element("#xray-notice"), text);
  }

  setReadings(readings: Readings, injecting: boolean): void {
    const values = readings.values;
    const fieldMm = values["xray_field_mm"] ?? 0;
    if (fieldMm > 0) this.fields.add(readings.time_s, fieldMm);
    const lateralMm = values["lateral_xray_field_mm"] ?? 0;
    if (lateralMm > 0) this.lateralFields.add(readings.time_s, lateralMm);
    this.facts.add(readings.time_s, values);
    if (this.subtraction.look(this.shown)) this.picture.filterAgain();
    this.setField(fieldMm, values["source_detector_mm"]);
    if (fieldMm !== this.fieldMm) {
      this.fieldMm = fieldMm;
      this.drawScale();
    }
    const rate = sumOfPlanes(values, "air_kerma_rate_mGy_min") ?? 0;
    this.kermaRate = rate > 0 ? `${short(rate)} mGy/min` : "";
    this.setTable(values);
    const lostS = values["mask_lost_s"] ?? null;
    this.maskLost = lostS !== null && readings.time_s - lostS < MASK_LOST_SHOWN_S;
    this.warn();
    const set = (term: string, value: number | null | undefined, shown: (value: number) => string) =>
      value === undefined ? null : this.dose.set(term, value === null ? "not known" : shown(value));
    const row = (term: string, name: string, shown: (value: number) => string) => set(term, values[name], shown);
    row("Procedure", "procedure_s", seconds);
    row("X-ray", "fluoroscopy_s", seconds);
    const tubeMa = values["tube_mA"];
    row("Tube", "tube_kV", (value) => `${value.toFixed(0)} kV ${typeof tubeMa === "number" ? short(tubeMa) : "–"} mA`);
    const planes = values["lateral_air_kerma_mGy"] === undefined ? "" : " A+B";
    set(`Air kerma${planes}`, sumOfPlanes(values, "air_kerma_mGy"), (value) => `${short(value)} mGy`);
    set(`Kerma × area${planes}`, sumOfPlanes(values, "kerma_area_Gy_cm2"), (value) => `${short(value)} Gy cm²`);
    const injector = injectorWords(values);
    if (injector !== null) {
      const shown = this.dose.set("Injector", injector);
      setData(shown, "on", String(values["injector_phase"] === 2));
    }
    const limitMl = values["contrast_limit_mL"];
    const over = (value: number) => typeof limitMl === "number" && value > limitMl;
    const contrast = row("Contrast", "contrast_injected_mL", (value) =>
      typeof limitMl === "number" ? `${short(value)} ${over(value) ? ">" : "of"} ${short(limitMl)} mL` : `${short(value)} mL`,
    );
    if (contrast === null) return;
    setData(contrast, "on", String(injecting));
    setData(contrast, "over", String(over(values["contrast_injected_mL"] ?? 0)));
  }

  private setField(fieldMm: number, detectorMm: number | null | undefined): void {
    const cm = (mm: number) => `${(mm / 10).toFixed(0)} cm`;
    setText(element("#field :first-child"), fieldMm > 0 ? `field ${cm(fieldMm)}` : "");
    setText(element("#source-distance"), fieldMm > 0 && typeof detectorMm === "number" ? `SID ${cm(detectorMm)}` : "");
  }

  private setTable(values: Readings["values"]): void {
    const [place, height] = element("#table-place").children;
    const [left, head, up] = [values["table_left_mm"], values["table_head_mm"], values["table_height_mm"]];
    const known = typeof left === "number" && typeof head === "number" && typeof up === "number";
    setText(place!, known ? `table ${towards(left, "L", "R")} ${towards(head, "H", "F")}` : "");
    setText(height!, known ? `height ${signed(up, 0)} mm` : "");
  }

  clear(): void {
    this.setTable({});
    this.maskLost = false;
    this.damagedMs = -Infinity;
    this.warn();
    this.dose.clear();
    this.loops.clear();
    this.newest = this.shown = null;
    this.showReference(false);
    this.reference.clear();
    this.fields.clear();
    this.lateralFields.clear();
    this.facts.clear();
    this.subtraction.clear();
    this.measure.clear();
    this.setField(0, null);
    this.fieldMm = 0;
    this.kermaRate = "";
    this.drawScale();
    this.sayLoop();
    this.picture.clear();
    this.lateral.clear();
    setText(element("#lateral-angles"), "");
    for (const side of document.querySelectorAll("#sides span, #lateral-sides span")) setText(side, "");
  }

  /** Stores the shown picture as the reference, beside the live one. */
  store(): void {
    if (this.shown === null) return;
    const { laoRad, craRad, timeS } = this.shown;
    this.reference.setFilter(this.subtraction.filter);
    this.reference.show(this.shown);
    showSides(element("#reference-sides"), laoRad, craRad);
    setText(element("#reference-text"), `${angle(laoRad, "LAO", "RAO")}  ${angle(craRad, "CRA", "CAU")}  at ${seconds(timeS)}`);
    this.showReference(true);
  }

  private subtractAgain(): void {
    this.picture.setFilter(this.subtraction.filter);
    this.measure.clear();
  }

  private showReference(shown: boolean): void {
    element<HTMLElement>("#reference").hidden = !shown;
    document.body.classList.toggle("refers", shown);
  }

  private display(picture: Picture): void {
    this.shown = picture;
    this.subtraction.look(picture);
    this.picture.show(picture);
    showSides(element("#sides"), picture.laoRad, picture.craRad);
  }

  private listen(): void {
    this.canvas.addEventListener("pointerdown", (event) => this.canvas.setPointerCapture(event.pointerId));
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 1) return;
      // As on a workstation: a drag to the right widens the window, a drag down raises the level.
      this.setWindow(this.level + event.movementY, this.width + 2 * event.movementX);
    });
    this.canvas.addEventListener("dblclick", () => {
      if (this.measure.on) return;
      this.setWindow(128, 256);
      this.magnify(1 / this.zoom, 0, 0);
    });
    this.canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const box = this.canvas.getBoundingClientRect();
        const share = (at: number, from: number, length: number) => (at - from) / length - 0.5;
        this.magnify(1.0015 ** -event.deltaY, share(event.clientX, box.left, box.width), share(event.clientY, box.top, box.height));
      },
      { passive: false },
    );
    element("#loop").addEventListener("click", () => this.togglePlay());
    element("#store").addEventListener("click", () => this.store());
    element("#reference-close").addEventListener("click", () => this.showReference(false));
    element("#loop-before").addEventListener("click", () => this.chooseLoop(-1));
    element("#loop-after").addEventListener("click", () => this.chooseLoop(1));
  }

  private chooseLoop(step: number): void {
    this.loops.choose(step, performance.now());
    this.sayLoop();
  }

  private sayLoop(): void {
    element<HTMLElement>("#loops").hidden = this.loops.count === 0;
    const button = element("#loop");
    button.setAttribute("aria-pressed", String(this.loops.playing));
    setText(button.firstElementChild!, this.loops.playing ? "Stop" : "Play");
    setText(element("#loop-number"), `loop ${this.loops.number} of ${this.loops.count}, ${this.loops.words}`);
    for (const other of ["#loop-before", "#loop-after"]) element<HTMLElement>(other).hidden = this.loops.count < 2;
  }

  /** Magnifies by a factor about a point; x and y: its distance from the middle, in picture widths. */
  private magnify(factor: number, x: number, y: number): void {
    const before = this.zoom;
    this.zoom = Math.min(Math.max(before * factor, 1), MOST_ZOOM);
    if (this.zoom < 1.02) this.zoom = 1;
    // The point keeps its position on the screen, and no edge of the picture becomes visible.
    const half = 0.5 / this.zoom;
    const kept = before / this.zoom;
    const moved = (center: number, place: number) =>
      Math.min(Math.max(0.5 + place * (1 - kept) + (center - 0.5) * kept, half), 1 - half);
    this.centerX = moved(this.centerX, x);
    this.centerY = moved(this.centerY, y);
    const shift = (center: number) => `${(100 * (0.5 - center)).toFixed(2)}%`;
    const style = this.zoom === 1 ? "" : `scale(${this.zoom}) translate(${shift(this.centerX)}, ${shift(this.centerY)})`;
    this.canvas.style.transform = style;
    this.measure.transform(this.canvas, style);
    this.sayWindow();
    this.drawScale();
  }

  private setWindow(level: number, width: number): void {
    this.level = Math.min(Math.max(level, 0), 255);
    this.width = Math.min(Math.max(width, 8), 1024);
    for (const canvas of [this.picture, this.lateral, this.reference]) canvas.setWindow(this.level, this.width);
    this.sayWindow();
  }

  private sayWindow(): void {
    const magnified = this.zoom === 1 ? "" : `×${this.zoom.toFixed(1)}  `;
    setText(element("#window"), `${magnified}window ${Math.round(this.width)}  level ${Math.round(this.level)}`);
  }

  private drawScale(): void {
    const scale = element<HTMLElement>("#scale");
    const shownPx = this.canvas.getBoundingClientRect().width;
    scale.hidden = this.fieldMm === 0 || shownPx === 0;
    if (scale.hidden) return;
    const pxPerMm = shownPx / this.fieldMm;
    const lengthMm = SCALE_STEPS_MM.filter((mm) => mm * pxPerMm < 160).pop() ?? 1;
    setText(scale.firstElementChild!, `${lengthMm} mm at the isocenter`);
    scale.querySelector("i")!.style.width = `${lengthMm * pxPerMm}px`;
  }
}
