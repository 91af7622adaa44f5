// Effects of the scene with their measured time per tick, and the effects that are not simulated.

import { element, Rows, setText, short } from "./dom.js";
import type { Health, Scene } from "./frames.js";

const PRICE = /^price_(.+)_ns$/;
// These effects act in the solver's look-ups of the vessel, or in its unknowns. So their time is part of the solver's.
const WITHIN = new Set(["heartbeat", "breathing", "compliance", "torsion", "clearance", "self_contact"]);

export class Prices {
  private readonly rows = new Rows(element("#prices dl"));
  private scene: Scene | null = null;

  setScene(scene: Scene): void {
    this.scene = scene;
    this.rows.clear();
    setText(element("#prices-off"), scene.off.length === 0 ? "" : `Not simulated: ${scene.off.map(Prices.words).join(", ")}`);
  }

  /** Shows the times that the simulator reports once a second. Without a tick the last ones stay. */
  take(health: Health): void {
    if (this.scene === null) return;
    const prices = new Map<string, number>();
    for (const [name, value] of Object.entries(health.counters)) {
      const found = PRICE.exec(name);
      if (found !== null) prices.set(found[1]!, 1e-3 * value);
    }
    if (prices.size === 0) return;
    const us = (value: number | undefined) => (value === undefined ? "" : `${short(value)} µs`);
    this.rows.set("wire and wall", us(prices.get("solver")));
    for (const name of this.scene.effects) {
      this.rows.set(Prices.words(name), WITHIN.has(name) ? "part of wire and wall" : us(prices.get(name) ?? 0));
    }
    const picture = health.counters["picture_us"];
    if (picture !== undefined) this.rows.set("X-ray picture, beside the ticks", `${short(1e-3 * picture)} ms`);
  }

  private static words(name: string): string {
    return name.replaceAll("_", " ");
  }
}
