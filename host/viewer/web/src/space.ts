// The 3D teaching view: vessel, wire, contact. Draws only when something has changed.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { element, setText } from "./dom.js";
import type { Lines, Scene, VesselSurface, WireState } from "./frames.js";
import { Instruments, measuresForces } from "./instruments.js";
import { drawLegend } from "./legend.js";
import { VesselMotion } from "./motion.js";
import { drawsBySoftware, makeRenderer } from "./renderer.js";
import { fewerTriangles } from "./simplify.js";

const DRAWN_RADIUS = 0.0019; // smallest radius of a wire, as a fraction of its distance to the camera
const OUTSIDE_FOV_DEG = 35;
const INSIDE_FOV_DEG = 80;
const BEHIND_TIP_MM = 9; // position of the eye within the lumen
const FARTHEST_MIDDLE_MM = 30; // of a lumen from a wire within it
const LINE_COLOR = "#62737f";
const ROUTE_COLOR = "#8fd3ff";
// Limits without a graphics card, because drawing then takes cores that the simulator needs.
const SOFTWARE_TRIANGLES = 12000;
const SOFTWARE_FRAME_MS = 20; // from frame to frame, at least

/** Drawn points that move with the vessel. */
interface Moving {
  drawn: THREE.BufferAttribute;
  atRestMm: ArrayLike<number>;
  shares: readonly ArrayLike<number>[];
}

export class Space {
  private readonly canvas = element<HTMLCanvasElement>("#space");
  private readonly bySoftware = drawsBySoftware();
  private readonly renderer: THREE.WebGLRenderer | null;
  private readonly world = new THREE.Scene();
  private readonly patient = new THREE.Group(); // the vessel's frame, turned as the patient lies
  private readonly camera = new THREE.PerspectiveCamera(OUTSIDE_FOV_DEG, 1, 1, 5000);
  private readonly orbit: OrbitControls;
  private readonly vesselMaterial = new THREE.MeshPhongMaterial({
    color: "#e07a88", transparent: true, opacity: 0.3, side: THREE.DoubleSide, depthWrite: false, shininess: 40,
  });
  private readonly instruments = new Instruments();
  private readonly tip = new THREE.Mesh(
    new THREE.SphereGeometry(1, 16, 12), new THREE.MeshBasicMaterial({ color: "#ffd166" }));
  private readonly guides = new THREE.Group(); // centerlines, route and target
  private readonly target = new THREE.Mesh(
    new THREE.SphereGeometry(1, 24, 16),
    new THREE.MeshBasicMaterial({ color: ROUTE_COLOR, transparent: true, opacity: 0.5, depthWrite: false }));
  private readonly cut = new THREE.Plane();
  private lines: Lines | null = null;
  private motion = new VesselMotion([]);
  private moving: Moving[] = []; // drawn points that move with the vessel
  private pulses: number[] = []; // at which it was drawn
  private inside = false;
  private cutting = false;
  private vessel: THREE.Mesh | null = null;
  private surface: VesselSurface | null = null;
  private scene: Scene | null = null;
  private state: WireState | null = null;
  private center = new THREE.Vector3();
  private sizeMm = 300;
  private halfMm = new THREE.Vector3(100, 100, 100); // half the size of the vessel's box in the view
  private legendMeasured = false;
  private following = false;
  private atHome = true; // true while the view shows the whole vessel, not turned by the user
  private changed = true;
  private drawnMs = -Infinity;
  frames = 0;

  constructor() {
    this.renderer = makeRenderer(this.canvas, this.bySoftware);
    this.world.background = new THREE.Color("#10151a");
    this.world.add(new THREE.HemisphereLight("#ffffff", "#53606a", 1.7), this.patient);
    const lamp = new THREE.DirectionalLight("#ffffff", 1.6);
    lamp.position.set(-1, 1, 2);
    this.camera.add(lamp);
    this.world.add(this.camera);
    this.patient.add(this.instruments.group, this.tip, this.guides);
    this.tip.visible = false;
    this.orbit = new OrbitControls(this.camera, this.canvas);
    this.orbit.enableDamping = false;
    this.orbit.addEventListener("change", () => (this.changed = true));
    this.orbit.addEventListener("start", () => (this.atHome = false));
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement!);
    element("#follow").addEventListener("click", () => this.follow(!this.following));
    element("#home").addEventListener("click", () => this.showAll());
    element("#inside").addEventListener("click", () => this.lookFromInside(!this.inside));
    element("#section").addEventListener("click", () => this.section(!this.cutting));
    this.showLegend(false);
  }

  setScene(scene: Scene): void {
    if (this.scene?.hash === scene.hash) return;
    this.scene = scene;
    // x to the viewer's right is the patient's left, y up is the head, as seen from the front.
    const row = (values: number[]) => new THREE.Vector3(...(values as [number, number, number]));
    const [left, superior, anterior] = [row(scene.left), row(scene.superior), row(scene.posterior).negate()];
    const turn = new THREE.Matrix4().makeBasis(left, superior, anterior).transpose();
    this.patient.quaternion.setFromRotationMatrix(turn);
    const [min, max] = [row(scene.min_mm), row(scene.max_mm)];
    this.center = min.clone().add(max).multiplyScalar(0.5);
    this.sizeMm = min.distanceTo(max);
    this.patient.position.copy(this.center.clone().applyQuaternion(this.patient.quaternion).negate());
    const size = max.clone().sub(min).multiplyScalar(0.5).applyQuaternion(this.patient.quaternion);
    this.halfMm.set(Math.abs(size.x), Math.abs(size.y), Math.abs(size.z));
    this.instruments.setCount(scene.instruments.length);
    this.showVessel();
    this.showLines();
    this.showAll();
  }

  setVessel(surface: VesselSurface): void {
    this.surface = surface;
    this.showVessel();
  }

  /** Centerlines, route and target of a scene. */
  setLines(lines: Lines): void {
    this.lines = lines;
    this.showLines();
  }

  setState(state: WireState): void {
    this.state = state;
    const measured = measuresForces(state, this.legendMeasured);
    if (measured !== this.legendMeasured) this.showLegend(measured);
    if (this.following) this.lookAtTip();
    if (this.inside) this.placeEye();
    this.changed = true;
  }

  get showsVessel(): boolean {
    return this.vessel !== null;
  }

  /** Position of a point of the vessel's frame on the canvas, in pixels from its top left. */
  project(pointMm: [number, number, number]): [number, number] {
    this.world.updateMatrixWorld();
    const at = new THREE.Vector3(...pointMm).applyMatrix4(this.patient.matrixWorld).project(this.camera);
    return [((at.x + 1) / 2) * this.canvas.clientWidth, ((1 - at.y) / 2) * this.canvas.clientHeight];
  }

  /** Camera parameters, for tests that project points. */
  cameraOf(): { position: number[]; target: number[]; fovDeg: number } {
    return {
      position: this.camera.position.toArray(), target: this.orbit.target.toArray(), fovDeg: this.camera.fov,
    };
  }

  drawn(): WireState | null {
    return this.state;
  }

  follow(on: boolean): void {
    if (on) this.lookFromInside(false);
    this.following = on;
    if (on) this.atHome = false;
    element("#follow").setAttribute("aria-pressed", String(on));
    if (on) this.lookAtTip(0.25 * this.sizeMm);
  }

  get follows(): boolean {
    return this.following;
  }

  get insideLumen(): boolean {
    return this.inside;
  }

  get cuts(): boolean {
    return this.cutting;
  }

  /** View from behind the tip along the wire, as in an endoscope. */
  lookFromInside(on: boolean): void {
    if (this.inside === on) return;
    if (on) this.follow(false);
    this.inside = on;
    element("#inside").setAttribute("aria-pressed", String(on));
    this.orbit.enabled = !on;
    this.camera.fov = on ? INSIDE_FOV_DEG : OUTSIDE_FOV_DEG;
    this.camera.near = on ? 0.1 : 1;
    this.camera.updateProjectionMatrix();
    this.vesselMaterial.opacity = on ? 1 : 0.3;
    this.vesselMaterial.depthWrite = on;
    this.vesselMaterial.needsUpdate = true;
    if (on) {
      this.atHome = false;
      this.placeEye();
    } else {
      this.showAll();
    }
    this.changed = true;
  }

  /** Hides the part of the vessel in front of the tip. */
  section(on: boolean): void {
    this.cutting = on;
    element("#section").setAttribute("aria-pressed", String(on));
    this.vesselMaterial.clippingPlanes = on ? [this.cut] : null;
    this.vesselMaterial.needsUpdate = true;
    this.changed = true;
  }

  showAll(): void {
    if (this.inside) return this.lookFromInside(false); // which comes back here
    this.follow(false);
    this.atHome = true;
    this.orbit.target.set(0, 0, 0);
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    const reachMm = Math.max(this.halfMm.y, this.halfMm.x / this.camera.aspect);
    this.camera.position.set(0, 0, (1.04 * reachMm) / half + this.halfMm.z);
    this.orbit.update();
    this.changed = true;
  }

  draw(): void {
    if (!this.changed || this.renderer === null) return;
    const nowMs = performance.now();
    if (this.bySoftware && nowMs - this.drawnMs < SOFTWARE_FRAME_MS) return;
    this.drawnMs = nowMs;
    this.changed = false;
    this.moveVessel();
    this.placeInstruments();
    if (this.cutting) this.placeCut();
    this.renderer.render(this.world, this.camera);
    ++this.frames;
  }

  /** Visible guides (lines and target), for tests. */
  guidesShown(): { lines: number; target: [number, number, number] | null } {
    return {
      lines: this.guides.children.filter((child) => child instanceof THREE.Line).length,
      target: this.guides.children.includes(this.target) ? this.target.position.toArray() : null,
    };
  }

  /** Middle of each ring of the tube of an instrument as it is drawn: for tests. */
  tubeMm(instrument: number): number[][] {
    return this.instruments.middlesMm(instrument);
  }

  /** Color of the tube of an instrument at its entry: for tests. */
  tubeColor(instrument: number): string {
    return this.instruments.colorOf(instrument);
  }

  private showLines(): void {
    this.guides.clear();
    this.motion = new VesselMotion([]);
    if (this.lines === null || this.scene === null || this.lines.hash !== this.scene.hash) return;
    this.motion = new VesselMotion(this.lines.motions);
    const line = (pointsMm: number[], color: string) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(pointsMm), 3));
      const shown = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color }));
      shown.frustumCulled = !this.motion.any;
      this.guides.add(shown);
    };
    for (const curve of this.lines.curves) line(curve.points_mm, LINE_COLOR);
    const { target } = this.lines;
    if (target !== null) {
      line(target.route_mm, ROUTE_COLOR);
      this.target.position.set(...target.at_mm);
      this.guides.add(this.target);
    }
    this.gatherMoving();
    this.changed = true;
  }

  private gatherMoving(): void {
    this.moving = [];
    this.pulses = [];
    if (!this.motion.any || this.lines === null) return;
    const positions = (drawn: THREE.Object3D) =>
      (drawn as THREE.Mesh | THREE.Line).geometry.getAttribute("position") as THREE.BufferAttribute;
    if (this.vessel !== null && this.surface !== null) {
      this.moving.push({ drawn: positions(this.vessel), atRestMm: this.surface.verticesMm, shares: this.surface.shares });
    }
    const lines = this.guides.children.filter((child) => child instanceof THREE.Line);
    const { curves, target } = this.lines;
    const points = curves.map(({ points_mm: atRestMm, shares }) => ({ atRestMm, shares }));
    if (target !== null) points.push({ atRestMm: target.route_mm, shares: target.route_shares });
    for (const [k, line] of lines.entries()) this.moving.push({ drawn: positions(line), ...points[k]! });
  }

  // The vessel moves with the time of the drawn state.
  private moveVessel(): void {
    if (this.moving.length === 0 || this.state === null) return;
    const pulses = this.motion.pulses(this.state.timeS);
    if (pulses.every((pulse, k) => pulse === this.pulses[k])) return;
    this.pulses = pulses;
    for (const { drawn, atRestMm, shares } of this.moving) {
      this.motion.move(atRestMm, shares, pulses, drawn.array as Float32Array);
      drawn.needsUpdate = true;
    }
    const route = this.moving.at(-1)!.drawn; // its end is the target
    if (this.lines?.target != null) this.target.position.fromBufferAttribute(route, route.count - 1);
  }

  get vertices(): number {
    return this.vessel?.geometry.getAttribute("position").count ?? 0;
  }

  /** A vertex of the vessel as it is drawn: for tests. */
  vertexMm(vertex: number): [number, number, number] | null {
    if (this.vessel === null) return null;
    const drawn = this.vessel.geometry.getAttribute("position");
    return [drawn.getX(vertex), drawn.getY(vertex), drawn.getZ(vertex)];
  }

  // The eye is behind the tip, and looks at it from the middle of the lumen if that is known.
  private placeEye(): void {
    const { state } = this;
    if (state === null || state.nodesMm.length < 6) return;
    const last = state.nodesMm.length / 3 - 1;
    const node = (i: number, out: THREE.Vector3) => out.fromArray(state.nodesMm, 3 * i);
    const [tip, eye] = [node(last, new THREE.Vector3()), new THREE.Vector3()];
    let behind = last;
    while (behind > 0 && node(behind, eye).distanceTo(tip) < BEHIND_TIP_MM) --behind;
    const middle = this.nearestOnCurves(eye);
    if (middle !== null) eye.lerp(middle, 0.7);
    this.patient.updateMatrixWorld();
    this.camera.position.copy(eye).applyMatrix4(this.patient.matrixWorld);
    this.orbit.target.copy(tip).applyMatrix4(this.patient.matrixWorld);
    this.camera.lookAt(this.orbit.target);
  }

  // Point of the centerlines nearest to a position; null if the position is in none of their vessels.
  private nearestOnCurves(place: THREE.Vector3): THREE.Vector3 | null {
    if (this.guides.children.length === 0 || this.lines === null) return null;
    const [best, here] = [new THREE.Vector3(), new THREE.Vector3()];
    let nearestMm = FARTHEST_MIDDLE_MM;
    for (const line of this.guides.children) {
      if (!(line instanceof THREE.Line)) continue;
      const points = line.geometry.getAttribute("position") as THREE.BufferAttribute;
      for (let i = 0; i < points.count; ++i) {
        const distanceMm = here.fromBufferAttribute(points, i).distanceTo(place);
        if (distanceMm >= nearestMm) continue;
        nearestMm = distanceMm;
        best.copy(here);
      }
    }
    return nearestMm < FARTHEST_MIDDLE_MM ? best : null;
  }

  private placeCut(): void {
    if (this.state === null) return;
    this.patient.updateMatrixWorld();
    const tip = new THREE.Vector3(...this.state.instruments[0]!.tipMm).applyMatrix4(this.patient.matrixWorld);
    this.cut.setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new THREE.Vector3()), tip);
  }

  private placeInstruments(): void {
    const [state, scene] = [this.state, this.scene];
    if (state === null || scene === null || state.instruments.length !== this.instruments.count) return;
    const leastMm = DRAWN_RADIUS * this.camera.position.distanceTo(this.orbit.target);
    this.instruments.place(state, scene, leastMm, this.legendMeasured);
    this.tip.position.fromArray(state.instruments[0]!.tipMm);
    this.tip.scale.setScalar(2.2 * Math.max(leastMm, scene.instruments[0]!.radius_mm));
    // Seen from inside the lumen, it would fill the view.
    this.tip.visible = !this.inside;
    this.target.scale.setScalar(Math.max(this.lines?.target?.radius_mm ?? 0, 3 * leastMm));
  }

  private showVessel(): void {
    if (this.vessel !== null) {
      this.patient.remove(this.vessel);
      this.vessel.geometry.dispose();
      this.vessel = null;
    }
    if (this.scene === null) return;
    const note = element("#space-note");
    if (this.surface === null || this.surface.hash !== this.scene.hash) {
      setText(note, "no vessel: start torquer-viewer with the --scene of the simulator");
      return;
    }
    setText(note, this.scene.effects.includes("fluoroscopy") ? "" : "this scene has no X-ray");
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(this.surface.verticesMm.slice(), 3));
    const { verticesMm, triangles } = this.surface;
    const drawn = this.bySoftware ? fewerTriangles(verticesMm, triangles, SOFTWARE_TRIANGLES) : triangles;
    geometry.setIndex(new THREE.BufferAttribute(drawn, 1));
    geometry.computeVertexNormals();
    this.vessel = new THREE.Mesh(geometry, this.vesselMaterial);
    this.vessel.renderOrder = 1;
    this.vessel.frustumCulled = this.surface.shares.length === 0;
    this.patient.add(this.vessel);
    this.gatherMoving();
    this.changed = true;
  }

  private lookAtTip(distanceMm?: number): void {
    if (this.state === null) return;
    this.patient.updateMatrixWorld();
    const tip = new THREE.Vector3(...this.state.instruments[0]!.tipMm).applyMatrix4(this.patient.matrixWorld);
    const away = this.camera.position.clone().sub(this.orbit.target);
    if (distanceMm !== undefined) away.setLength(distanceMm);
    this.orbit.target.copy(tip);
    this.camera.position.copy(tip).add(away);
    this.orbit.update();
    this.changed = true;
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (width === 0 || height === 0) return;
    this.renderer?.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.atHome) this.showAll();
    this.changed = true;
  }

  private showLegend(measured: boolean): void {
    this.legendMeasured = measured;
    drawLegend(measured);
  }
}
