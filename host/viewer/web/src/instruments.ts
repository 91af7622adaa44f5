// The instruments in the 3D view, each as a tube.

import * as THREE from "three";
import { type Scene, STATUS, type WireState } from "./frames.js";
import { DEPTH_UM, FORCE_MN } from "./legend.js";
import { Tube, colorAt } from "./tube.js";

const OUTER = ["#e8eef2", "#7fc7d9", "#c9a3ff", "#ffc98a"];
const SAME_ENTRY_MM = 1e-3;

/** True if a state has contact forces. A state that did not converge has none, and does not change what was `before`. */
export function measuresForces(state: WireState, before: boolean): boolean {
  if ((state.status & STATUS.converged) === 0) return before;
  return state.contactMN.length > 0 && !Number.isNaN(state.contactMN[0]!);
}

function outerMaterial(k: number): THREE.Material {
  return new THREE.MeshPhongMaterial({
    color: OUTER[k % OUTER.length]!, transparent: true, opacity: 0.45, depthWrite: false,
  });
}

// Instruments within instrument k. One beside it enters elsewhere.
function countInside(state: WireState, k: number): number {
  const entry = (j: number) => {
    const own = state.instruments[j]!.nodesMm;
    return new THREE.Vector3().fromArray(own.length > 0 ? own : state.nodesMm);
  };
  const at = entry(k);
  return state.instruments.slice(0, k).filter((_, j) => entry(j).distanceTo(at) < SAME_ENTRY_MM).length;
}

// An instrument ends at the node nearest to its tip.
function nodesOf(state: WireState, k: number): number {
  const tip = state.instruments[k]!.tipMm;
  let [best, nearest] = [Infinity, 0];
  for (let i = 0; i < state.nodesMm.length / 3; ++i) {
    const d = Math.hypot(
      state.nodesMm[3 * i]! - tip[0], state.nodesMm[3 * i + 1]! - tip[1], state.nodesMm[3 * i + 2]! - tip[2]);
    if (d < best) [best, nearest] = [d, i];
  }
  return nearest + 1;
}

export class Instruments {
  readonly group = new THREE.Group();
  private readonly wireMaterial = new THREE.MeshPhongMaterial({ vertexColors: true, emissive: "#181818" });
  private readonly tubes: Tube[] = [];

  get count(): number {
    return this.tubes.length;
  }

  /** Begins again with this many instruments; the first is the innermost. */
  setCount(count: number): void {
    this.group.clear();
    this.tubes.length = 0;
    for (let k = 0; k < count; ++k) {
      const tube = new Tube(k === 0 ? this.wireMaterial : outerMaterial(k));
      this.tubes.push(tube);
      this.group.add(tube.mesh);
    }
  }

  /** Moves the tubes to the instruments of a state. leastMm: smallest thickness. measured: color by force, not depth. */
  place(state: WireState, scene: Scene, leastMm: number, measured: boolean): void {
    for (const [k, tube] of this.tubes.entries()) {
      const radius = Math.max(scene.instruments[k]!.radius_mm, leastMm * (1 + 0.5 * countInside(state, k)));
      const own = state.instruments[k]!.nodesMm;
      if (own.length > 0) {
        // A state has the contacts of the innermost curve only.
        tube.set(own, own.length / 3, radius, (_, out) => colorAt(NaN, out));
        continue;
      }
      const count = k === 0 ? state.nodesMm.length / 3 : nodesOf(state, k);
      const share = (node: number) =>
        measured ? state.contactMN[node]! / FORCE_MN : state.depthUm[node]! / DEPTH_UM;
      tube.set(state.nodesMm, count, radius, (node, out) => colorAt(share(node), out));
    }
  }

  /** Color of the tube of an instrument at its entry, as a hexadecimal number: for tests. */
  colorOf(instrument: number): string {
    return this.tubes[instrument]?.color() ?? "";
  }

  /** Middle of each ring of the tube of an instrument as it is drawn: for tests. */
  middlesMm(instrument: number): number[][] {
    return this.tubes[instrument]?.middles() ?? [];
  }
}
