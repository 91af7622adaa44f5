// Subtraction by hand: any shown picture becomes the mask, which can be moved by parts of a pixel.

import { element, seconds, setText } from "./dom.js";
import type { Picture } from "./frames.js";
import type { Filter } from "./picture_canvas.js";
import { PLAIN, SUBTRACTED, type Facts, type FactTimes } from "./picture_scale.js";
import type { Gray } from "./vessel_course.js";

const STEP_PX = 0.25;
const MOST_SHIFT_PX = 20;
// As the simulator subtracts: this gray where nothing changed, and 1.5 times the gain of a plain picture.
const EVEN_GRAY = 0.78 * 255;
const PLAIN_GAIN = 1.5;
const BLACK = 4; // a shutter's gray, and the JPEG's error

/** Steps of the keys to the right and down. */
const STEPS: Record<string, [number, number]> = { 4: [-1, 0], 6: [1, 0], 8: [0, -1], 2: [0, 1] };

interface Mask {
  gray: Gray;
  picture: Picture;
  facts: Facts;
}

/** Weights of the four values about a place between the second and the third: Catmull and Rom's cubic. */
function weightsAt(part: number): [number, number, number, number] {
  const t = part;
  return [
    (-t + 2 * t ** 2 - t ** 3) / 2, (2 - 5 * t ** 2 + 3 * t ** 3) / 2, (t + 4 * t ** 2 - 3 * t ** 3) / 2, (t ** 3 - t ** 2) / 2,
  ];
}

// Moves rows of values along one direction: `step` from value to value, `next` from row to row.
function movedAlong(from: ArrayLike<number>, count: number, step: number, rows: number, next: number, shift: number): Float32Array {
  const whole = Math.floor(-shift);
  const weights = weightsAt(-shift - whole);
  const to = new Float32Array(from.length);
  for (let row = 0; row < rows; ++row) {
    for (let k = 0; k < count; ++k) {
      let sum = 0;
      for (let i = 0; i < 4; ++i) {
        const place = Math.min(Math.max(k + whole + i - 1, 0), count - 1);
        sum += weights[i]! * from[row * next + place * step]!;
      }
      to[row * next + k * step] = sum;
    }
  }
  return to;
}

/** Grays of a picture that is moved to the right and down, px. Edges continue outwards. */
export function moved({ width, height, value }: Gray, [right, down]: readonly [number, number]): ArrayLike<number> {
  const across = right === 0 ? value : movedAlong(value, width, 1, height, width, right);
  return down === 0 ? across : movedAlong(across, height, width, width, 1, down);
}

export class Subtraction {
  private mask: Mask | null = null;
  private shift: [number, number] = [0, 0];
  private problem = "";
  private shown: Picture | null = null;
  private fitted = false;
  private runMask: Picture | null = null; // first picture of the newest run

  /** changed: the filter is another one. shown: the picture on the screen, with its grays before subtraction. */
  constructor(private readonly facts: FactTimes, private readonly changed: () => void, shown: () => { picture: Picture | null; raw: Gray }) {
    element("#mask-take").addEventListener("click", () => this.take(shown()));
    element("#mask-off").addEventListener("click", () => this.clear());
    element("#mask-reset").addEventListener("click", () => this.move(0, 0));
    for (const [digit, [right, down]] of Object.entries(STEPS)) {
      element(`#mask-${digit}`).addEventListener("click", () => this.step(right, down));
    }
    this.keys = (code) => {
      const digit = /^(?:Digit|Numpad)(\d)$/.exec(code)?.[1];
      if (code === "KeyN") this.take(shown());
      else if (digit === "0") this.clear();
      else if (digit === "5") this.move(0, 0);
      else if (digit !== undefined && STEPS[digit] !== undefined) this.step(...STEPS[digit]);
    };
    this.say();
  }

  /** Does what a key stands for. */
  readonly keys: (code: string) => void;

  /** Shift of the mask to the right and down, and time of its picture; null without a mask. */
  get now(): { shift: [number, number]; timeS: number } | null {
    return this.mask === null ? null : { shift: [...this.shift], timeS: this.mask.picture.timeS };
  }

  /** Subtracts the present mask from pictures of its view. */
  get filter(): Filter {
    const { mask } = this;
    if (mask === null) return ({ value }) => value;
    const grays = moved(mask.gray, this.shift);
    const gain = mask.facts.mode === PLAIN ? PLAIN_GAIN : 1;
    return (raw, picture) => {
      if (!this.fits(mask, picture)) return raw.value;
      const out = new Uint8ClampedArray(raw.value.length);
      for (let i = 0; i < out.length; ++i) {
        const now = raw.value[i]!;
        out[i] = now <= BLACK ? 0 : EVEN_GRAY + gain * (now - grays[i]!);
      }
      return out;
    };
  }

  clear(): void {
    this.problem = "";
    if (this.mask === null) {
      this.say();
      return;
    }
    this.mask = null;
    this.shift = [0, 0];
    this.change();
  }

  /** A run begins: its first picture is the simulator's own mask. */
  begin(picture: Picture): void {
    this.runMask = picture;
  }

  /** Reports the shown picture, or new readings. Returns true if it has to be subtracted again. */
  look(picture: Picture | null): boolean {
    const same = picture === this.shown;
    this.shown = picture;
    const fits = this.mask !== null && picture !== null && this.fits(this.mask, picture);
    const changed = same && fits !== this.fitted;
    this.fitted = fits;
    this.say();
    return changed;
  }

  private fits(mask: Mask, picture: Picture): boolean {
    const { laoRad, craRad, width, height } = mask.picture;
    if (picture.laoRad !== laoRad || picture.craRad !== craRad || picture.width !== width || picture.height !== height) return false;
    const facts = this.facts.at(picture.timeS);
    return facts !== null && facts.mode === mask.facts.mode && facts.view === mask.facts.view;
  }

  private take({ picture, raw }: { picture: Picture | null; raw: Gray }): void {
    if (picture === null) return;
    const facts = this.facts.at(picture.timeS);
    this.problem = facts === null ? "No mask: its display is not known" : facts.mode > SUBTRACTED ? "No mask from a road map" : "";
    if (this.problem !== "") {
      this.say();
      return;
    }
    this.mask = { gray: { ...raw, value: raw.value.slice() }, picture, facts: facts! };
    this.shift = [0, 0];
    this.change();
  }

  private step(right: number, down: number): void {
    this.move(this.shift[0] + right * STEP_PX, this.shift[1] + down * STEP_PX);
  }

  private move(right: number, down: number): void {
    if (this.mask === null) return;
    this.problem = "";
    // A subtracted picture does not have its mask any more, so moving it would leave that mask's edges.
    if (this.mask.facts.mode !== PLAIN && (right !== 0 || down !== 0)) this.problem = "Only the mask of a plain run moves";
    else {
      const limited = (px: number) => Math.min(Math.max(px, -MOST_SHIFT_PX), MOST_SHIFT_PX);
      this.shift = [limited(right), limited(down)];
    }
    this.change();
  }

  private change(): void {
    this.fitted = this.mask !== null && this.shown !== null && this.fits(this.mask, this.shown);
    this.changed();
    this.say();
  }

  private say(): void {
    const { mask } = this;
    document.body.classList.toggle("masks", mask !== null);
    const [right, down] = this.shift;
    const part = (px: number, plus: string, minus: string) => `${px < 0 ? minus : plus} ${Math.abs(px).toFixed(2)}`;
    setText(element("#mask-shift"), mask === null ? "" : `${part(right, "→", "←")} ${part(down, "↓", "↑")} px`);
    setText(element("#mask-text"), this.words());
  }

  private words(): string {
    if (this.problem !== "") return this.problem;
    if (this.mask !== null) {
      const { picture, facts } = this.mask;
      if (!this.fitted) return "Mask of another view";
      return `Mask at ${seconds(picture.timeS)}${contentsOf(facts)}`;
    }
    const facts = this.runMask === null ? null : this.facts.at(this.runMask.timeS);
    return facts?.mode === SUBTRACTED && contentsOf(facts) !== "" ? `Mask${contentsOf(facts)}` : "";
  }
}

function contentsOf({ instrument, contrast }: Facts): string {
  const things = [...(instrument ? ["instrument"] : []), ...(contrast ? ["contrast"] : [])];
  return things.length === 0 ? "" : `, with ${things.join(" and ")}`;
}
