// Messages to torquer-viewer: layouts of host/viewer/README.md.

import { type Acquisition, type Imaging, VERSION } from "./frames.js";

export interface Controls {
  xray: boolean;
  acquisition: boolean;
  contrast: boolean;
  instrument: number;
  pushMmS: number;
  turnRadS: number;
  laoRadS: number;
  craRadS: number;
  tableLeftMmS: number; // motion of the table, and of the patient on it
  tableHeadMmS: number;
  tableUpMmS: number;
}

export function write(controls: Controls): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(20));
  view.setUint8(0, 16);
  view.setUint8(1, VERSION);
  view.setUint8(2, (controls.xray ? 1 : 0) | (controls.contrast ? 2 : 0) | (controls.acquisition ? 4 : 0));
  view.setUint8(3, controls.instrument);
  view.setFloat32(4, controls.pushMmS, true);
  view.setFloat32(8, controls.turnRadS, true);
  view.setFloat32(12, controls.laoRadS, true);
  view.setFloat32(16, controls.craRadS, true);
  return view.buffer;
}

export function writeTable(controls: Controls): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(20));
  view.setUint8(0, 20);
  view.setUint8(1, VERSION);
  view.setFloat32(4, controls.tableLeftMmS, true);
  view.setFloat32(8, controls.tableHeadMmS, true);
  view.setFloat32(12, controls.tableUpMmS, true);
  return view.buffer;
}

/** `choice`: the page's number of this choice, which torquer-viewer answers. */
export function writeImaging(imaging: Imaging, acquisition: Acquisition, choice: number): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(28));
  view.setUint8(0, 18);
  view.setUint8(1, VERSION);
  view.setUint8(2, imaging.mode);
  view.setUint8(3, acquisition.mode);
  view.setFloat32(4, imaging.pulses_per_s, true);
  view.setFloat32(8, imaging.magnification, true);
  for (const [k, share] of imaging.shutters.entries()) view.setUint8(12 + k, Math.round(100 * share));
  view.setUint32(16, choice, true);
  for (const [k, wedge] of imaging.wedges.entries()) {
    view.setUint8(20 + k, Math.round(100 * wedge.share));
    view.setInt8(22 + k, Math.round(wedge.rotation_deg));
  }
  view.setFloat32(24, acquisition.pulses_per_s, true);
  return view.buffer;
}

/** Set-up of the power injector. */
export interface InjectorSetUp {
  volume_mL: number;
  rate_mL_s: number;
  delay_s: number;
  rise_s: number;
}

export type InjectorOrder = "off" | "arm" | "inject";

export function writeInjector(order: InjectorOrder, setUp: InjectorSetUp): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(40));
  view.setUint8(0, 21);
  view.setUint8(1, VERSION);
  view.setUint8(2, { off: 0, arm: 1, inject: 2 }[order]);
  view.setFloat64(8, setUp.volume_mL, true);
  view.setFloat64(16, setUp.rate_mL_s, true);
  view.setFloat64(24, setUp.delay_s, true);
  view.setFloat64(32, setUp.rise_s, true);
  return view.buffer;
}

/** Order to exchange an instrument for a device. */
export function writeExchange(instrument: number, device: string): ArrayBuffer {
  const bytes = new Uint8Array(64);
  const name = new TextEncoder().encode(device);
  bytes.set([22, VERSION, instrument, name.length]);
  bytes.set(name, 4);
  return bytes.buffer;
}

export interface ReplayControls {
  play: boolean;
  speed: number;
  atS: number; // new position; NaN: the present position
  steps: number; // states from there
}

export function writeReplay(controls: ReplayControls): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(20));
  view.setUint8(0, 17);
  view.setUint8(1, VERSION);
  view.setUint8(2, controls.play ? 1 : 0);
  view.setFloat32(4, controls.speed, true);
  view.setFloat64(8, controls.atS, true);
  view.setInt32(16, controls.steps, true);
  return view.buffer;
}

export type CaseAction = "start" | "end" | "close" | "examine";

export function writeCase(action: CaseAction, number: number): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(20));
  view.setUint8(0, 19);
  view.setUint8(1, VERSION);
  view.setUint8(2, { start: 1, end: 2, close: 3, examine: 4 }[action]);
  view.setUint8(3, number);
  return view.buffer;
}
