// Steering of instruments, C-arm and table: sums the rates of keys, pad and gamepad, and sends them. It sends at each change and ten
// times a second, because torquer-viewer ignores a silent page.

import type { Controls } from "./orders.js";

const PUSH_MM_S = 40;
const TURN_RAD_S = Math.PI;
const ARM_RAD_S = Math.PI / 6;
const TABLE_MM_S = 60;
const TABLE_UP_MM_S = 30;
const BEAT_MS = 100;

/** Current demand of one input source; rates are shares of the full speed, -1 to 1. */
export interface Held {
  xray: boolean;
  acquisition: boolean;
  contrast: boolean;
  push: number;
  turn: number;
  lao: number;
  cra: number;
  tableLeft: number; // to the patient's left
  tableHead: number;
  tableUp: number;
}

export interface Source {
  held(): Held;
  /** Releases all inputs, because the page has lost the keyboard or is hidden. */
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

  /** Selects the next instrument, or with -1 the previous one. */
  next(step: number): void {
    this.instrument = (this.instrument + this.instruments + step) % this.instruments;
    this.tell();
  }

  /** Sends the held rates; call after each change. */
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
      acquisition: all.some((held) => held.acquisition),
      contrast: all.some((held) => held.contrast),
      instrument: this.instrument,
      pushMmS: PUSH_MM_S * rate((held) => held.push),
      turnRadS: TURN_RAD_S * rate((held) => held.turn),
      laoRadS: ARM_RAD_S * rate((held) => held.lao),
      craRadS: ARM_RAD_S * rate((held) => held.cra),
      tableLeftMmS: TABLE_MM_S * rate((held) => held.tableLeft),
      tableHeadMmS: TABLE_MM_S * rate((held) => held.tableHead),
      tableUpMmS: TABLE_UP_MM_S * rate((held) => held.tableUp),
    };
  }

  private release(): void {
    for (const source of this.sources) source.release();
    this.tell();
  }
}
