// Color scale of the instruments in the 3D view.

import * as THREE from "three";
import { element, setText } from "./dom.js";
import { colorAt } from "./tube.js";

export const FORCE_MN = 50; // the end of the scale
export const DEPTH_UM = 100; // the same for a scene that does not measure forces

/** Draws the scale of contact forces. If a scene does not measure them, draws the scale of depths in the wall. */
export function drawLegend(measured: boolean): void {
  const scale = element<HTMLCanvasElement>("#legend canvas");
  const screen = scale.getContext("2d")!;
  const color = new THREE.Color();
  for (let x = 0; x < scale.width; ++x) {
    screen.fillStyle = `#${colorAt(x / (scale.width - 1), color).getHexString()}`;
    screen.fillRect(x, 0, 1, scale.height);
  }
  setText(
    element("#legend span"),
    measured ? `contact force: 0 to ${FORCE_MN} mN per node` : `depth in the wall: 0 to ${DEPTH_UM} µm`,
  );
}
