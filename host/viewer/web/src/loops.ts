// Recorded fluoroscopy: keeps the pictures of each pedal press as a loop that can be played.

import type { Picture } from "./frames.js";

const MOST_LOOPS = 8;
const MOST_BYTES = 64e6;
const PAUSE_S = 0.7; // pause between the end and the next beginning
const GAP_S = 0.5; // a longer pause begins a new loop; at 7.5 pulses a second pictures are 0.13 s apart

export class Loops {
  private readonly loops: Picture[][] = [];
  private bytes = 0;
  private ended = true;
  private chosen = 0;
  private startedMs = 0;
  private shown = -1;
  playing = false;

  /** Takes a new picture; a held picture ends the loop. */
  add(picture: Picture): void {
    if (picture.held) {
      this.ended = true;
      return;
    }
    const last = this.loops.at(-1)?.at(-1);
    if (last === undefined || this.ended || picture.timeS - last.timeS > GAP_S || picture.timeS < last.timeS) {
      this.loops.push([]);
    }
    this.ended = false;
    this.loops.at(-1)!.push(picture);
    this.bytes += picture.jpeg.byteLength;
    this.playing = false;
    this.chosen = this.loops.length - 1;
    while (this.loops.length > 1 && (this.loops.length > MOST_LOOPS || this.bytes > MOST_BYTES)) this.drop();
    // A single loop that fills the memory loses its beginning.
    while (this.bytes > MOST_BYTES) this.bytes -= this.loops[0]!.shift()!.jpeg.byteLength;
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
    this.startedMs = nowMs;
    this.shown = -1;
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
    if (!this.playing || loop === undefined) return null;
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
