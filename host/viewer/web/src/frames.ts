// Messages from torquer-viewer: layouts of host/viewer/README.md.

export const STATUS = {
  converged: 1,
  budgetSpent: 2,
  outsideLumen: 4,
  snapped: 8,
  inputRefused: 16,
  inDoubt: 32,
  stalled: 64,
  leftModel: 128,
} as const;

export interface InstrumentState {
  insertionMm: number;
  rotationRad: number;
  carriedMm: number;
  carriedRad: number;
  latencyMs: number; // NaN if unknown
  tipMm: [number, number, number];
  nodesMm: Float32Array; // up to its tip; empty if it lies on the curve of the state
}

export interface WireState {
  kind: "state";
  timeS: number;
  tick: number;
  residual: number;
  penetrationUm: number;
  solveUs: number;
  energyMJ: number;
  status: number;
  contacts: number;
  instruments: InstrumentState[];
  nodesMm: Float32Array; // x, y, z of each node
  contactMN: Float32Array; // NaN if the scene does not measure it, or the state did not converge
  depthUm: Float32Array;
}

export interface Picture {
  kind: "picture";
  held: boolean;
  lateral: boolean; // of the second plane
  number: number;
  timeS: number;
  laoRad: number;
  craRad: number;
  width: number;
  height: number;
  jpeg: Uint8Array;
}

export interface VesselSurface {
  kind: "vessel";
  shares: Float32Array[]; // of each motion, of each vertex: one for each corner of the motions
  hash: string;
  verticesMm: Float32Array;
  triangles: Uint32Array;
}

export interface Scene {
  kind: "scene";
  name: string;
  hash: string;
  vessel: string;
  method: string;
  effects: string[];
  off: string[]; // effects that the scene does not name
  instruments: { name: string; radius_mm: number; hollow: boolean; max_length_mm: number }[];
  min_mm: number[];
  max_mm: number[];
  left: number[];
  posterior: number[];
  superior: number[];
}

export interface Lines {
  kind: "lines";
  hash: string;
  // x, y, z of each point in order; shares as for the vessel's vertices.
  curves: { name: string; points_mm: number[]; shares: number[][] }[];
  target: {
    at_mm: [number, number, number]; radius_mm: number; force_limit_mN: number; route_mm: number[]; route_shares: number[][];
    instrument: number; // whose tip is to reach it
  } | null;
  motions: Motion[];
}

/** Periodic motion of parts of the vessel: way_mm times pulse, which has one period. */
export interface Motion {
  way_mm: [number, number, number];
  period_s: number;
  phase: number;
  pulse: number[];
}

export interface Health {
  kind: "health";
  process: string;
  instrument: string;
  device: string;
  state: string;
  message: string;
  counters: Record<string, number>;
}

export interface Readings {
  kind: "readings";
  time_s: number;
  values: Record<string, number | null>; // null: not known
}

/** Devices that the instruments are now. */
export interface Devices {
  kind: "devices";
  devices: string[]; // of each instrument; "": the scene alone describes it
  exchanges: number; // since the start
  refusal: string; // reason if the newest order was refused
}

/** Devices of the library. */
export interface Tray {
  kind: "tray";
  devices: { name: string; product: string; hollow: boolean }[];
}

/** Curves of the last second, and figures of the last whole beat. null: not known. */
export interface Patient {
  kind: "patient";
  time_s: number;
  heart_rate_per_min: number | null;
  beat_s: number | null; // time of the newest R wave
  systolic_mmHg: number | null;
  diastolic_mmHg: number | null;
  mean_mmHg: number | null;
  wedged: boolean; // the tip closes the lumen
  alarms: number; // bits: ALARM
  rate_limits_per_min: [number, number];
  systolic_limits_mmHg: [number, number];
  sample_s: number;
  first_sample: number; // its time is first_sample times sample_s
  ecg: (number | null)[]; // the R wave has the height 1
  pressure_mmHg: (number | null)[];
}

export const ALARM = { rateLow: 1, rateHigh: 2, systolicLow: 4, systolicHigh: 8, damped: 16 } as const;

/** Position of a wedge filter. The first comes in from the left, the second from the right. */
export interface Wedge {
  share: number; // of the picture that its edge has crossed
  rotation_deg: number; // clockwise in the picture
}

/** Settings of the X-ray system. Zero pulses and mode 0 select the scene's values. */
export interface Imaging {
  mode: number;
  pulses_per_s: number;
  magnification: number;
  shutters: [number, number, number, number]; // left, right, top, bottom: covered fractions
  wedges: Wedge[]; // two; a replay has none
}

/** Display (2 subtraction, 4 cine) and pulses while the pedal of the acquisition is down. */
export interface Acquisition {
  mode: number;
  pulses_per_s: number;
}

export interface Viewer extends Imaging {
  kind: "viewer";
  steer: boolean;
  steered: boolean;
  page: number;
  lao_rad: number;
  cra_rad: number;
  xray: boolean;
  acquires?: boolean; // the pedal of the acquisition is down; a replay has none
  acquisition?: Acquisition;
  contrast: boolean;
  answered?: number[]; // number of the newest X-ray choice of each page, taken or refused; a replay has none
  hands: Hand[]; // of devices; a page that steers has none
  states_per_s: number;
  problem?: string; // several simulators on the same bus
}

/** State of one input device and its hand. */
export interface Hand {
  instrument: string;
  uncalibrated: boolean;
  clutch: boolean; // held: the hand moves, the instrument does not
  table: boolean; // the joystick moves the table, not the C-arm
  height: boolean; // the joystick moves the table up and down
  lift: boolean; // the sensor sees no surface: motion is held
  fault: boolean; // the sensor does not answer
}

/** State of torquer-replay; its page is always a replay page. */
export interface Replay {
  kind: "replay";
  at_s: number;
  length_s: number;
  playing: boolean;
  speed: number;
  states: number; // in the log
  damage: string;
  check: {
    states: number; missing: number; differing: number; first_difference: number; done: boolean; error: string;
  } | null;
}

/** A scene that a trainee can choose. */
export interface TrainingCase {
  name: string;
  title: string;
  task: string;
  difficulty: number; // 1 to 5
  xray: boolean;
  instruments: string[];
  picture: boolean; // cases/NAME.jpg
}

/** Case list of a torquer-viewer that starts simulators itself. */
export interface Cases {
  kind: "cases";
  cases: TrainingCase[];
  phase: "choose" | "starting" | "running" | "ending" | "ended";
  chosen: number; // -1 before the first
  examination: boolean; // of the chosen case: locked, and noted in its record
  run: number;
  problem: string;
  report: boolean; // report.html
  folder: string; // of the session's files
}

export type Incoming =
  | WireState
  | Devices
  | Tray
  | Picture
  | VesselSurface
  | Lines
  | Scene
  | Health
  | Readings
  | Patient
  | Replay
  | Cases
  | Viewer;

export const VERSION = 1;

function readState(view: DataView, buffer: ArrayBuffer): WireState {
  const instrumentCount = view.getUint16(2, true);
  const nodes = view.getUint32(4, true);
  const number = (offset: number) => view.getFloat64(offset, true);
  const instruments: InstrumentState[] = [];
  for (let k = 0; k < instrumentCount; ++k) {
    const at = 64 + 64 * k;
    instruments.push({
      insertionMm: number(at),
      rotationRad: number(at + 8),
      carriedMm: number(at + 16),
      carriedRad: number(at + 24),
      latencyMs: number(at + 32),
      tipMm: [number(at + 40), number(at + 48), number(at + 56)],
      nodesMm: new Float32Array(),
    });
  }
  const first = 64 + 64 * instrumentCount;
  let own = first + 20 * nodes;
  for (const instrument of instruments) {
    instrument.nodesMm = new Float32Array(buffer, own + 4, 3 * view.getUint32(own, true));
    own += 4 + instrument.nodesMm.byteLength;
  }
  return {
    kind: "state",
    timeS: number(8),
    tick: number(16),
    residual: number(24),
    penetrationUm: number(32),
    solveUs: number(40),
    energyMJ: number(48),
    status: view.getUint32(56, true),
    contacts: view.getUint32(60, true),
    instruments,
    nodesMm: new Float32Array(buffer, first, 3 * nodes),
    contactMN: new Float32Array(buffer, first + 12 * nodes, nodes),
    depthUm: new Float32Array(buffer, first + 16 * nodes, nodes),
  };
}

function readPicture(view: DataView, buffer: ArrayBuffer): Picture {
  return {
    kind: "picture",
    held: (view.getUint16(2, true) & 1) !== 0,
    lateral: (view.getUint16(2, true) & 2) !== 0,
    number: view.getFloat64(8, true),
    timeS: view.getFloat64(16, true),
    laoRad: view.getFloat32(24, true),
    craRad: view.getFloat32(28, true),
    width: view.getUint32(32, true),
    height: view.getUint32(36, true),
    jpeg: new Uint8Array(buffer, 40, view.getUint32(4, true)),
  };
}

function readVessel(view: DataView, buffer: ArrayBuffer): VesselSurface {
  const vertices = view.getUint32(4, true);
  const triangles = view.getUint32(8, true);
  const motions = view.getUint16(2, true);
  const perMotion = vertices * 2 ** motions;
  return {
    kind: "vessel",
    shares: Array.from({ length: motions }, (_, motion) =>
      new Float32Array(buffer, 32 + 12 * (vertices + triangles) + 4 * perMotion * motion, perMotion)),
    hash: String.fromCharCode(...new Uint8Array(buffer, 16, 16)),
    verticesMm: new Float32Array(buffer, 32, 3 * vertices),
    triangles: new Uint32Array(buffer, 32 + 12 * vertices, 3 * triangles),
  };
}

/** Decodes a message. Throws if its version is not the version of this page. */
export function read(data: string | ArrayBuffer): Incoming {
  if (typeof data === "string") return JSON.parse(data) as Incoming;
  const view = new DataView(data);
  if (view.getUint8(1) !== VERSION) throw new Error("another version of torquer-viewer");
  switch (view.getUint8(0)) {
    case 1:
      return readState(view, data);
    case 2:
      return readPicture(view, data);
    case 3:
      return readVessel(view, data);
    default:
      throw new Error("a message of an unknown kind");
  }
}
