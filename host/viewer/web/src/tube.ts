// Tubes in the 3D view, and the colors along them.

import * as THREE from "three";

// Colors from no contact to the largest: viridis, whose order is visible with any color vision.
const COLORS = ["#6fb7ff", "#4ac6a8", "#a5db36", "#fde725"].map((text) => new THREE.Color(text));
const UNKNOWN = new THREE.Color("#8a959d");
const SIDES = 8;

/** Color of a fraction from 0 (no contact) to 1; gray for NaN (unknown). */
export function colorAt(share: number, out: THREE.Color): THREE.Color {
  if (Number.isNaN(share)) return out.copy(UNKNOWN);
  const place = Math.min(Math.max(share, 0), 1) * (COLORS.length - 1);
  const index = Math.min(Math.floor(place), COLORS.length - 2);
  return out.lerpColors(COLORS[index]!, COLORS[index + 1]!, place - index);
}

/** Tube along a polyline, whose sides follow it without twist. */
export class Tube {
  readonly mesh: THREE.Mesh;
  private readonly geometry = new THREE.BufferGeometry();
  private capacity = 0;

  constructor(material: THREE.Material) {
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
  }

  set(nodesMm: Float32Array, count: number, radiusMm: number, color: (node: number, out: THREE.Color) => void): void {
    this.mesh.visible = count > 1;
    if (count < 2) return;
    this.reserve(count);
    const position = this.geometry.getAttribute("position") as THREE.BufferAttribute;
    const normal = this.geometry.getAttribute("normal") as THREE.BufferAttribute;
    const colors = this.geometry.getAttribute("color") as THREE.BufferAttribute;
    const node = (i: number, out: THREE.Vector3) => out.fromArray(nodesMm, 3 * i);
    const [before, here, after, tangent, side, up, spoke] = Array.from({ length: 7 }, () => new THREE.Vector3()) as [
      THREE.Vector3, THREE.Vector3, THREE.Vector3, THREE.Vector3, THREE.Vector3, THREE.Vector3, THREE.Vector3,
    ];
    const shade = new THREE.Color();
    for (let i = 0; i < count; ++i) {
      node(Math.max(i - 1, 0), before);
      node(i, here);
      node(Math.min(i + 1, count - 1), after);
      tangent.subVectors(after, before).normalize();
      if (i === 0) side.set(Math.abs(tangent.x) < 0.9 ? 1 : 0, Math.abs(tangent.x) < 0.9 ? 0 : 1, 0);
      side.addScaledVector(tangent, -side.dot(tangent)).normalize();
      up.crossVectors(tangent, side);
      color(i, shade);
      for (let k = 0; k < SIDES; ++k) {
        const turn = (2 * Math.PI * k) / SIDES;
        spoke.copy(side).multiplyScalar(Math.cos(turn)).addScaledVector(up, Math.sin(turn));
        const at = i * SIDES + k;
        position.setXYZ(at, here.x + radiusMm * spoke.x, here.y + radiusMm * spoke.y, here.z + radiusMm * spoke.z);
        normal.setXYZ(at, spoke.x, spoke.y, spoke.z);
        colors.setXYZ(at, shade.r, shade.g, shade.b);
      }
    }
    this.geometry.setDrawRange(0, (count - 1) * SIDES * 6);
    position.needsUpdate = normal.needsUpdate = colors.needsUpdate = true;
  }

  /** Color of the first ring, as a hexadecimal number. */
  color(): string {
    const colors = this.geometry.getAttribute("color") as THREE.BufferAttribute;
    return new THREE.Color().fromBufferAttribute(colors, 0).getHexString();
  }

  /** Middle of each ring. */
  middles(): number[][] {
    if (!this.mesh.visible || this.capacity === 0) return [];
    const position = this.geometry.getAttribute("position");
    const rings = this.geometry.drawRange.count / (SIDES * 6) + 1;
    return Array.from({ length: rings }, (_, ring) => {
      const middle = new THREE.Vector3();
      for (let k = 0; k < SIDES; ++k) middle.add(new THREE.Vector3().fromBufferAttribute(position, ring * SIDES + k));
      return middle.divideScalar(SIDES).toArray();
    });
  }

  private reserve(count: number): void {
    if (count <= this.capacity) return;
    this.capacity = Math.ceil(1.5 * count);
    for (const name of ["position", "normal", "color"]) {
      this.geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3 * SIDES * this.capacity), 3));
    }
    const index: number[] = [];
    for (let i = 0; i + 1 < this.capacity; ++i) {
      for (let k = 0; k < SIDES; ++k) {
        const [a, b] = [i * SIDES + k, i * SIDES + ((k + 1) % SIDES)];
        index.push(a, b, a + SIDES, b, b + SIDES, a + SIDES);
      }
    }
    this.geometry.setIndex(index);
  }
}
