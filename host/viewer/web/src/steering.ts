// Steering of the instruments: keys, the pad on the page and a gamepad, added up and sent as rates,
// ten times a second as well as at each change, because torquer-viewer takes a page that is silent
// for gone.

import type { Controls } from "./frames.js";

const PUSH_MM_S = 40;
const TURN_RAD_S = Math.PI;
const ARM_RAD_S = Math.PI / 6;
const BEAT_MS = 100;

/** Current demand of one input source; rates are shares of the full speed, -1 to 1. */
export interface Held {
  xray: boolean;
  contrast: boolean;
  push: number;
  turn: number;
  lao: number;
  cra: number;
}

export interface Source {
  held(): Held;
  /** Nothing is held any more: the page has lost the keyboard, or is hidden. */
  release(): void;
}

export class Steering {
  private readonly sources: Source[] = [];
  private instrument = 0;
  private instruments = 1;
  enabled = false;

  constructor(
    private readonly send: (controls: Controls) => void,
    private readonly changed: () => void,
  ) {
    addEventListener("blur", () => this.release());
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.release();
    });
    setInterval(() => {
      if (!document.hidden) this.tell();
    }, BEAT_MS);
  }

  add(source: Source): void {
    this.sources.push(source);
  }

  get chosen(): number {
    return this.instrument;
  }

  setInstruments(count: number): void {
    this.instruments = Math.max(count, 1);
    if (this.instrument >= this.instruments) this.instrument = 0;
  }

  /** The next instrument, or with -1 the one before. */
  next(step: number): void {
    this.instrument = (this.instrument + this.instruments + step) % this.instruments;
    this.tell();
  }

  /** Sends what is held; whoever has changed something calls it. */
  tell(): void {
    if (this.enabled) this.send(this.controls());
    this.changed();
  }

  controls(): Controls {
    const all = this.sources.map((source) => source.held());
    const rate = (part: (held: Held) => number) =>
      Math.min(Math.max(all.reduce((sum, held) => sum + part(held), 0), -1), 1);
    return {
      xray: all.some((held) => held.xray),
      contrast: all.some((held) => held.contrast),
      instrument: this.instrument,
      pushMmS: PUSH_MM_S * rate((held) => held.push),
      turnRadS: TURN_RAD_S * rate((held) => held.turn),
      laoRadS: ARM_RAD_S * rate((held) => held.lao),
      craRadS: ARM_RAD_S * rate((held) => held.cra),
    };
  }

  private release(): void {
    for (const source of this.sources) source.release();
    this.tell();
  }
}
