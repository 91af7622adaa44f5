// Positions of the points of a vessel that moves with heart and breath, at a given time.

import type { Motion } from "./frames.js";

type Numbers = ArrayLike<number>;

export class VesselMotion {
  constructor(private readonly motions: readonly Motion[]) {}

  get any(): boolean {
    return this.motions.length > 0;
  }

  /** Phase of each motion, 0 to 1. */
  pulses(timeS: number): number[] {
    return this.motions.map(({ period_s: periodS, phase, pulse }) => {
      const periods = timeS / periodS + phase;
      const place = (periods - Math.floor(periods)) * pulse.length;
      const before = Math.floor(place);
      const [from, to] = [pulse[before % pulse.length]!, pulse[(before + 1) % pulse.length]!];
      return from + (place - before) * (to - from);
    });
  }

  /** Moves points x, y, z from rest to their present positions. `shares`: as in host/viewer/vessel_motion.h. */
  move(atRestMm: Numbers, shares: readonly Numbers[], pulses: readonly number[], out: Float32Array): void {
    out.set(atRestMm);
    const parts = this.parts(pulses);
    for (const [k, { way_mm: way }] of this.motions.entries()) {
      const [pulse, share] = [pulses[k]!, shares[k]];
      if (pulse === 0 || share === undefined) continue;
      for (let i = 0, at = 0; i < out.length; i += 3) {
        let gone = 0;
        for (const part of parts) gone += part * share[at++]!;
        gone *= pulse;
        out[i]! += gone * way[0];
        out[i + 1]! += gone * way[1];
        out[i + 2]! += gone * way[2];
      }
    }
  }

  // Weight of each corner. A corner has each motion at its beginning or end; the first motion is the lowest bit.
  private parts(pulses: readonly number[]): number[] {
    return Array.from({ length: 2 ** pulses.length }, (_, corner) =>
      pulses.reduce((part, pulse, k) => part * ((corner >> k) & 1 ? pulse : 1 - pulse), 1));
  }
}
