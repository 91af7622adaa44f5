// Patient monitor: ECG and pressure as a beam that sweeps from left to right, their figures, and alarms.

import { element, setText } from "./dom.js";
import { ALARM, type Patient, type Scene } from "./frames.js";

const SPAN_S = 4; // of the whole width
const GAP_S = 0.3; // before the beam, between the new curve and the old one
const FRAME_MS = 40;
const CHASE_S = 0.15; // messages come in steps of 0.1 s, and the beam follows smoothly
const JUMP_S = 1.5; // further away the beam does not follow but jumps
const UNKNOWN = "--";
const SCALES_MMHG = [20, 40, 80, 120, 160, 200, 300, 500];
const ROOM = 1.1; // above the curve, for the scale's number
const ECG_RANGE: [number, number] = [-0.35, 1.15];

const figure = (value: number | null) => (value === null ? UNKNOWN : value.toFixed(0).replace("-", "−"));

/** Texts of the alarms, each figure with its limit. */
export function alarmTexts(patient: Patient): string[] {
  const rate = `Heart rate ${figure(patient.heart_rate_per_min)}`;
  const systolic = `Systolic ${figure(patient.systolic_mmHg)}`;
  const texts: [number, string][] = [
    [ALARM.rateLow, `${rate} < ${patient.rate_limits_per_min[0]} /min`],
    [ALARM.rateHigh, `${rate} > ${patient.rate_limits_per_min[1]} /min`],
    [ALARM.systolicLow, `${systolic} < ${patient.systolic_limits_mmHg[0]} mmHg`],
    [ALARM.systolicHigh, `${systolic} > ${patient.systolic_limits_mmHg[1]} mmHg`],
    [ALARM.damped, "Pressure damped: the tip closes the vessel"],
  ];
  return texts.filter(([bit]) => (patient.alarms & bit) !== 0).map(([, text]) => text);
}

interface Sample {
  number: number;
  ecg: number | null;
  pressure: number | null;
}

export class PatientMonitor {
  private readonly root = element<HTMLElement>("#patient");
  private readonly canvas = element<HTMLCanvasElement>("#patient canvas");
  private readonly screen = this.canvas.getContext("2d")!;
  private ring: Sample[] = []; // sample n at n modulo its length
  private newest: Patient | null = null;
  private lastNumber = -1;
  private beamS = 0; // time that is drawn at the beam
  private drawnMs = 0;
  private drawnS = -1;

  constructor() {
    new ResizeObserver(() => (this.drawnS = -1)).observe(this.canvas);
  }

  setScene(scene: Scene): void {
    this.root.hidden = !scene.effects.includes("patient_monitor");
  }

  clear(): void {
    this.newest = null;
    this.ring = [];
    this.lastNumber = -1;
    this.drawnS = -1;
  }

  /** For tests: the newest message, and the kept samples in the order of their times. */
  get shown(): { patient: Patient | null; samples: Sample[] } {
    const samples = this.ring.filter((sample) => sample !== undefined);
    return { patient: this.newest, samples: samples.sort((a, b) => a.number - b.number) };
  }

  take(patient: Patient): void {
    const length = Math.round(SPAN_S / patient.sample_s);
    const last = patient.first_sample + patient.ecg.length - 1;
    // A replay may go back.
    if (length !== this.ring.length || last < this.lastNumber) {
      this.clear();
      this.ring = new Array<Sample>(length);
    }
    for (const [k, ecg] of patient.ecg.entries()) {
      const number = patient.first_sample + k;
      this.ring[number % length] = { number, ecg, pressure: patient.pressure_mmHg[k] ?? null };
    }
    this.newest = patient;
    this.lastNumber = last;
  }

  /** Four times a second. */
  refresh(fresh: boolean): void {
    const patient = fresh ? this.newest : null;
    setText(element("#patient-rate b"), figure(patient?.heart_rate_per_min ?? null));
    const [systolic, diastolic] = [patient?.systolic_mmHg ?? null, patient?.diastolic_mmHg ?? null];
    setText(element("#patient-pressure b"),
      systolic === null || diastolic === null ? UNKNOWN : `${figure(systolic)}/${figure(diastolic)}`);
    setText(element("#patient-pressure i"), figure(patient?.mean_mmHg ?? null));
    setText(element("#patient-alarms"), patient === null ? "" : alarmTexts(patient).join(" · "));
  }

  draw(nowMs: number): void {
    if (this.root.hidden || nowMs - this.drawnMs < FRAME_MS) return;
    const passedS = Math.min(1, (nowMs - this.drawnMs) / 1000);
    this.drawnMs = nowMs;
    const sampleS = this.newest?.sample_s ?? 0;
    const lastS = this.lastNumber * sampleS;
    const behindS = lastS - this.beamS;
    this.beamS = behindS < 0 || behindS > JUMP_S ? lastS : this.beamS + behindS * Math.min(1, passedS / CHASE_S);
    if (Math.abs(this.beamS - this.drawnS) < sampleS / 2) return;
    this.drawnS = this.beamS;
    this.paint(sampleS);
  }

  private paint(sampleS: number): void {
    const scale = Math.min(2, devicePixelRatio);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const [columns, rows] = [Math.round(width * scale), Math.round(height * scale)];
    if (this.canvas.width !== columns || this.canvas.height !== rows) {
      this.canvas.width = columns;
      this.canvas.height = rows;
    }
    this.screen.setTransform(scale, 0, 0, scale, 0, 0);
    this.screen.clearRect(0, 0, width, height);
    if (this.newest === null) return;
    const known = this.ring.map((sample) => sample?.pressure ?? null).filter((value) => value !== null);
    const highest = known.length === 0 ? 0 : Math.max(...known);
    const most = SCALES_MMHG.find((scaled) => scaled >= ROOM * highest) ?? highest;
    const middle = 0.44 * height;
    if (known.length > 0) this.ruler(middle + 6, height - 4, width, most);
    this.curve(sampleS, width, "#6fe08a", ({ ecg }) => ecg, ECG_RANGE, [middle - 3, 3]);
    this.curve(sampleS, width, "#ff8f8f", ({ pressure }) => pressure, [0, most], [height - 4, middle + 6]);
  }

  // Lines at 0 and at the largest pressure of the scale.
  private ruler(top: number, bottom: number, width: number, most: number): void {
    this.screen.strokeStyle = "#2a343d";
    this.screen.lineWidth = 1;
    this.screen.beginPath();
    for (const y of [top, bottom]) {
      this.screen.moveTo(0, y);
      this.screen.lineTo(width, y);
    }
    this.screen.stroke();
    this.screen.fillStyle = "#93a3af";
    this.screen.font = "11px system-ui, sans-serif";
    this.screen.textBaseline = "top";
    this.screen.fillText(String(most), 2, top + 2);
  }

  private curve(
    sampleS: number, width: number, color: string, value: (sample: Sample) => number | null,
    [low, high]: [number, number], [bottom, top]: [number, number],
  ): void {
    const length = this.ring.length;
    const last = Math.round(this.beamS / sampleS);
    this.screen.strokeStyle = color;
    this.screen.lineWidth = 1.5;
    this.screen.lineJoin = "round";
    this.screen.beginPath();
    let pen = false;
    for (let n = Math.max(0, last - length + Math.round(GAP_S / sampleS)); n <= last; ++n) {
      const at = n % length;
      const sample = this.ring[at];
      const here = sample?.number === n ? value(sample) : null;
      if (here === null || at === 0) pen = false;
      if (here === null) continue;
      const [x, y] = [(at / length) * width, bottom + ((here - low) / (high - low)) * (top - bottom)];
      if (pen) this.screen.lineTo(x, y);
      else this.screen.moveTo(x, y);
      pen = true;
    }
    this.screen.stroke();
  }
}
