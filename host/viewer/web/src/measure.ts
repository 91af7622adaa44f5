// Measurements in an X-ray picture that rests: a distance, and the diameters of a vessel.

import { element, setText, short } from "./dom.js";
import type { Picture } from "./frames.js";
import type { PictureCanvas } from "./picture_canvas.js";
import type { FieldTimes, Known } from "./picture_scale.js";
import { measureVessel, type VesselSize } from "./qca.js";
import type { Point } from "./vessel_course.js";

const TOOLS = ["off", "distance", "vessel"] as const;
type Tool = (typeof TOOLS)[number];
const HINTS: Record<Tool, string> = {
  off: "",
  distance: "Pick two points in a picture that rests.",
  vessel: "Pick two points on a dark vessel.",
};
const SVG = "http://www.w3.org/2000/svg";
const CLICK_PX = 5; // a click that moves farther is a drag
const PICKED_ERROR_PX = 1.4; // of a distance: each pick is true to a pixel

/** A length in the picture. mm: at the isocenter; null if the scale is not known. error: for 95 %. */
export interface Measured {
  px: number;
  mm: number | null;
  errorMm: number | null;
}

export interface Measurement {
  tool: Tool;
  reason: string; // why mm are null, or why there is no result
  distance: Measured | null; // for a vessel: along its course
  least: Measured | null;
  reference: Measured | null;
  narrowing: { percent: number; error: number } | null;
}

/** A canvas of the page, and the fields of its pictures. */
export interface Place {
  canvas: PictureCanvas;
  fields: FieldTimes;
}

/** A picture on the page with the drawing above it. */
interface Sheet extends Place {
  drawing: SVGSVGElement;
  of: Picture | null; // picture that the points belong to
  points: Point[];
}

export class Measure {
  private readonly sheets: Sheet[];
  private tool: Tool = "off";
  private result: Measurement | null = null;

  constructor(places: readonly Place[]) {
    this.sheets = places.map(({ canvas, fields }) => {
      const drawing = document.createElementNS(SVG, "svg");
      drawing.classList.add("measured");
      drawing.setAttribute("aria-hidden", "true");
      canvas.canvas.after(drawing);
      const sheet = { canvas, fields, drawing, of: null, points: [] };
      let [x, y] = [0, 0];
      canvas.canvas.addEventListener("pointerdown", (event) => ([x, y] = [event.clientX, event.clientY]));
      canvas.canvas.addEventListener("click", (event) => {
        if (Math.hypot(event.clientX - x, event.clientY - y) < CLICK_PX) this.pick(sheet, [event.clientX, event.clientY]);
      });
      return sheet;
    });
    element("#measure").addEventListener("click", () => this.next());
    this.say();
  }

  get on(): boolean {
    return this.tool !== "off";
  }

  get measured(): Measurement | null {
    return this.result;
  }

  /** Chooses the next tool. */
  next(): void {
    this.tool = TOOLS[(TOOLS.indexOf(this.tool) + 1) % TOOLS.length]!;
    this.clear();
  }

  clear(): void {
    this.result = null;
    for (const sheet of this.sheets) this.wipe(sheet);
    this.say();
  }

  /** A picture was shown: a measurement in another one does not belong to it. */
  changed(): void {
    for (const sheet of this.sheets) {
      if (sheet.of === null || sheet.of === sheet.canvas.picture) continue;
      const [before, now] = [sheet.of, sheet.canvas.picture];
      if (now !== null && before.number === now.number && before.timeS === now.timeS) continue;
      const shown = sheet.points.length === 2;
      this.wipe(sheet);
      if (shown) this.result = null;
      this.say();
    }
  }

  /** Magnifies the drawing together with its picture. */
  transform(canvas: HTMLCanvasElement, style: string): void {
    for (const sheet of this.sheets) if (sheet.canvas.canvas === canvas) sheet.drawing.style.transform = style;
  }

  private wipe(sheet: Sheet): void {
    sheet.of = null;
    sheet.points = [];
    sheet.drawing.replaceChildren();
  }

  // A point of the screen is picked.
  private pick(sheet: Sheet, [x, y]: Point): void {
    const picture = sheet.canvas.picture;
    if (this.tool === "off" || picture === null) return;
    if (sheet.points.length === 2 || sheet.of !== picture) this.clear();
    const box = sheet.canvas.canvas.getBoundingClientRect();
    const { width, height } = sheet.canvas.gray;
    // The picture keeps its shape within its box.
    const scale = Math.min(box.width / width, box.height / height);
    const at = (place: number, from: number, length: number, count: number) => (place - from - length / 2) / scale + (count - 1) / 2;
    const point: Point = [at(x, box.left, box.width, width), at(y, box.top, box.height, height)];
    if (point[0] < -0.5 || point[1] < -0.5 || point[0] > width - 0.5 || point[1] > height - 0.5) return;
    sheet.of = picture;
    sheet.points.push(point);
    sheet.drawing.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
    this.cross(sheet, point);
    if (sheet.points.length === 2) this.measure(sheet, sheet.points[0]!, sheet.points[1]!);
    this.say();
  }

  private measure(sheet: Sheet, from: Point, to: Point): void {
    const { gray } = sheet.canvas;
    const field = sheet.fields.at(sheet.of!.timeS);
    const pixel: Known = "mm" in field ? { mm: field.mm / gray.width } : field;
    const length = (px: number, errorPx: number): Measured =>
      "mm" in pixel ? { px, mm: px * pixel.mm, errorMm: errorPx * pixel.mm } : { px, mm: null, errorMm: null };
    const reason = "reason" in pixel ? pixel.reason : "";
    const nothing = { tool: this.tool, reason, distance: null, least: null, reference: null, narrowing: null };
    if (this.tool === "distance") {
      this.line(sheet, [from, to]);
      const px = Math.hypot(to[0] - from[0], to[1] - from[1]);
      this.result = { ...nothing, distance: length(px, PICKED_ERROR_PX) };
      return;
    }
    const size = measureVessel(gray, from, to);
    if (typeof size === "string") {
      this.result = { ...nothing, reason: size };
      return;
    }
    const { least, reference, stations, narrowest } = size;
    for (const side of [0, 1] as const) this.line(sheet, stations.map(({ edges }) => edges[side]));
    this.line(sheet, stations[narrowest]!.edges);
    this.result = {
      ...nothing,
      distance: length(size.lengthPx, PICKED_ERROR_PX),
      least: length(least.px, least.error),
      reference: length(reference.px, reference.error),
      narrowing: narrowingOf(size),
    };
  }

  private line(sheet: Sheet, points: readonly Point[]): void {
    const line = document.createElementNS(SVG, "polyline");
    line.setAttribute("points", points.map(([x, y]) => `${x.toFixed(2)},${y.toFixed(2)}`).join(" "));
    sheet.drawing.append(line);
  }

  private cross(sheet: Sheet, [x, y]: Point): void {
    const REACH = 5;
    this.line(sheet, [[x - REACH, y], [x + REACH, y]]);
    this.line(sheet, [[x, y - REACH], [x, y + REACH]]);
  }

  private say(): void {
    setText(element("#measure span"), this.tool === "off" ? "Measure" : this.tool === "distance" ? "Distance" : "Vessel");
    element("#measure").setAttribute("aria-pressed", String(this.on));
    document.body.classList.toggle("measures", this.on);
    setText(element("#measured"), this.result === null ? HINTS[this.tool] : wordsOf(this.result));
  }
}

function narrowingOf({ least, reference }: VesselSize): { percent: number; error: number } {
  const ratio = least.px / reference.px;
  const error = 100 * ratio * (least.error / least.px + reference.error / reference.px);
  return { percent: 100 * (1 - ratio), error };
}

function wordsOf({ reason, distance, least, reference, narrowing }: Measurement): string {
  const length = ({ px, mm, errorMm }: Measured) =>
    mm === null ? `${short(px)} px` : `${mm.toFixed(1)} ± ${Math.max(errorMm!, 0.05).toFixed(1)} mm`;
  if (distance === null) return `Not measured: ${reason}`;
  const parts = least === null ? [length(distance)] : [
    `least ${length(least)}`, `reference ${length(reference!)}`,
    `narrowing ${narrowing!.percent.toFixed(0)} ± ${Math.max(narrowing!.error, 0.5).toFixed(0)} %`,
  ];
  return `${parts.join(", ")}${reason === "" ? "" : `; no mm: ${reason}`}`;
}
