// Renderer of the 3D view, and the check for a graphics card.

import * as THREE from "three";
import { element, setText } from "./dom.js";

/** True if this browser renders 3D in software. */
export function drawsBySoftware(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2");
  const names = probe?.getExtension("WEBGL_debug_renderer_info");
  if (probe == null || names == null) return false;
  const name = String(probe.getParameter(names.UNMASKED_RENDERER_WEBGL));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return /SwiftShader|llvmpipe|softpipe|Basic Render/i.test(name);
}

/** Renderer of a canvas; null, with a notice, where the browser has no WebGL. */
export function makeRenderer(canvas: HTMLCanvasElement, bySoftware: boolean): THREE.WebGLRenderer | null {
  try {
    const renderer = new THREE.WebGLRenderer({
      canvas, antialias: !bySoftware, preserveDrawingBuffer: true,
    });
    renderer.localClippingEnabled = true;
    return renderer;
  } catch {
    setText(element("#space-notice"), "The 3D view needs WebGL, which this browser does not have.");
    return null;
  }
}
