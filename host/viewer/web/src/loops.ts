// Recorded fluoroscopy: keeps the pictures of each pedal press as a loop that can be played.

import { short } from "./dom.js";
import type { Picture } from "./frames.js";

const MOST_LOOPS = 8;
const MOST_BYTES = 64e6;
const PAUSE_S = 0.7; // pause between the end and the next beginning
const GAP_S = 2; // a longer pause begins a new loop too: the held picture was lost. A busy simulator pauses for less.

export class Loops {
  private readonly loops: Picture[][] = [];
  private bytes = 0;
  private ended = true;
  private chosen = 0;
  private startedMs = 0;
  private shown = -1;
  private paused = false; // at the shown picture
  playing = false;

  /** Takes a new picture; a held picture ends the loop. Returns true if it begins a loop. */
  add(picture: Picture): boolean {
    if (picture.held) {
      this.ended = true;
      return false;
    }
    const last = this.loops.at(-1)?.at(-1);
    const begins = last === undefined || this.ended || picture.timeS - last.timeS > GAP_S || picture.timeS < last.timeS;
    if (begins) this.loops.push([]);
    this.ended = false;
    this.loops.at(-1)!.push(picture);
    this.bytes += picture.jpeg.byteLength;
    this.playing = false;
    this.chosen = this.loops.length - 1;
    while (this.loops.length > 1 && (this.loops.length > MOST_LOOPS || this.bytes > MOST_BYTES)) this.drop();
    // A single loop that fills the memory loses its beginning.
    while (this.bytes > MOST_BYTES) this.bytes -= this.loops[0]!.shift()!.jpeg.byteLength;
    return begins;
  }

  clear(): void {
    this.loops.length = 0;
    this.bytes = this.chosen = 0;
    this.playing = false;
    this.ended = true;
  }

  get count(): number {
    return this.loops.length;
  }

  /** Number of the playing loop, from 1. */
  get number(): number {
    return this.chosen + 1;
  }

  get seconds(): number {
    const loop = this.loops[this.chosen];
    return loop === undefined ? 0 : loop.at(-1)!.timeS - loop[0]!.timeS;
  }

  play(nowMs: number): void {
    if (this.loops.length === 0) return;
    this.playing = true;
    this.paused = false;
    this.startedMs = nowMs;
    this.shown = -1;
  }

  /** Stops at the next picture, or with -1 at the previous one, and returns it. Without a playing loop it begins at the last picture. */
  step(by: number): Picture | null {
    const loop = this.loops[this.chosen];
    if (loop === undefined) return null;
    const from = this.playing ? this.shown : loop.length - 1;
    this.playing = this.paused = true;
    this.shown = Math.min(Math.max(from + by, 0), loop.length - 1);
    return loop[this.shown]!;
  }

  /** "4.2 s", or the place in a loop that is stopped. */
  get words(): string {
    return this.playing && this.paused ? `picture ${this.shown + 1} of ${this.loops[this.chosen]!.length}` : `${short(this.seconds)} s`;
  }

  stop(): void {
    this.playing = false;
  }

  choose(step: number, nowMs: number): void {
    if (this.loops.length === 0) return;
    this.chosen = (this.chosen + this.loops.length + step) % this.loops.length;
    this.play(nowMs);
  }

  /** The picture for the present time; null if it has not changed since the last call. */
  due(nowMs: number): Picture | null {
    const loop = this.loops[this.chosen];
    if (!this.playing || this.paused || loop === undefined) return null;
    const placeS = ((nowMs - this.startedMs) / 1000) % (this.seconds + PAUSE_S);
    let index = 0;
    while (index + 1 < loop.length && loop[index + 1]!.timeS - loop[0]!.timeS <= placeS) ++index;
    if (index === this.shown) return null;
    this.shown = index;
    return loop[index]!;
  }

  private drop(): void {
    for (const picture of this.loops.shift()!) this.bytes -= picture.jpeg.byteLength;
    this.chosen = Math.max(this.chosen - 1, 0);
  }
}
