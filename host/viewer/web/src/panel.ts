// Panel of figures: instruments and wall force, and the developer part with solver and programs.

import { element, setData, setText, short, signed } from "./dom.js";
import { type Devices, type Health, type Readings, type Scene, STATUS, type Viewer, type WireState } from "./frames.js";
import { type Figure, History } from "./history.js";

const OLD_MS = 2500; // health comes once a second
const MOST_OTHERS = 16;
const NONE = -Infinity; // maximum without a state, shown as unknown
const DEG = 180 / Math.PI;
const FIGURES = {
  rate: { title: "States", unit: " /s", shown: short },
  latency: { title: "Hand to wire", unit: " ms", shown: short },
  solve: { title: "Solve time", unit: " ms", shown: short },
  residual: { title: "Residual", unit: "", shown: short, logarithmic: true },
  penetration: { title: "Penetration of the wall", unit: " µm", shown: short },
  error: { title: "Error by the segments", unit: " mm", shown: short },
  force: { title: "Wall force", unit: " mN", shown: short },
} satisfies Record<string, Figure>;
const STATUS_WORDS: [number, string][] = [
  [STATUS.outsideLumen, "outside the lumen"],
  [STATUS.leftModel, "left the model"],
  [STATUS.stalled, "stalled"],
  [STATUS.inputRefused, "command refused"],
  [STATUS.budgetSpent, "behind the hand"],
  [STATUS.snapped, "tip snapped"],
  [STATUS.inDoubt, "state in doubt"],
];

export class Panel {
  private readonly instruments = element<HTMLElement>("#instruments");
  private readonly histories = new Map<string, History>();
  private readonly health = element<HTMLElement>("#health");
  private readonly problem = element<HTMLElement>("#problem");
  private readonly solver = element<HTMLElement>("#solver");
  private readonly processes = new Map<string, { health: Health; heardMs: number }>();
  private rows: { row: HTMLElement; insertion: Element; rotation: Element; device: HTMLButtonElement; note: Element }[] = [];
  private scene: Scene | null = null;
  private residual = NONE;
  private solveUs = NONE;
  private penetrationUm = NONE;
  private latencyMs = NaN;
  private status = 0; // bits of all states since the last refresh
  private newestStatus = 0;
  replays = false; // true for a recording, in which no process counts as silent

  /** `exchange`: called with the number of an instrument whose device is clicked. */
  constructor(private readonly exchange: (instrument: number) => void) {}

  setScene(scene: Scene): void {
    if (this.scene?.hash === scene.hash) return;
    this.scene = scene;
    this.rows = scene.instruments.map((instrument, k) => {
      const row = document.createElement("div");
      row.className = "instrument";
      const [name, insertion, rotation, note] = ["span", "b", "b", "small"].map((tag) => document.createElement(tag)) as [
        HTMLElement, HTMLElement, HTMLElement, HTMLElement,
      ];
      name.textContent = instrument.name;
      const device = document.createElement("button");
      device.type = "button";
      device.hidden = true;
      device.addEventListener("click", () => this.exchange(k));
      row.append(name, insertion, rotation, device, note);
      return { row, insertion, rotation, device, note };
    });
    this.instruments.replaceChildren(...this.rows.map(({ row }) => row));
    this.histories.clear();
    for (const place of ["#histories", "#solver-histories"]) element(place).replaceChildren();
  }

  /** `products`: names of the devices for people. `tray`: they can be exchanged now. */
  setDevices(devices: Devices, products: Map<string, string>, tray: boolean): void {
    for (const [k, { device }] of this.rows.entries()) {
      const now = devices.devices[k] ?? "";
      setText(device, now === "" ? "Exchange …" : (products.get(now) ?? now));
      device.title = tray ? "exchange for another device" : "device";
      device.hidden = !tray && now === "";
      device.disabled = !tray;
    }
  }

  /** Discards the data of the last run. */
  clear(): void {
    this.scene = null;
    this.processes.clear();
  }

  setState(state: WireState): void {
    for (const [k, instrument] of state.instruments.entries()) {
      const shown = this.rows[k];
      if (shown === undefined) continue;
      setText(shown.insertion, `${short(instrument.insertionMm)} mm`);
      setText(shown.rotation, `${signed(instrument.rotationRad * DEG, 0)}°`);
      const carried = Math.abs(instrument.carriedMm);
      setText(shown.note, carried > 1 ? `${short(carried)} mm behind the hand` : "");
      if (Number.isFinite(instrument.latencyMs) && k === 0) this.latencyMs = instrument.latencyMs;
    }
    // Maximum since the last refresh: a peak of one tick must stay visible.
    this.residual = Math.max(this.residual, state.residual);
    this.solveUs = Math.max(this.solveUs, state.solveUs);
    this.penetrationUm = Math.max(this.penetrationUm, state.penetrationUm);
    this.newestStatus = state.status;
    this.status |= state.status;
  }

  setHealth(health: Health, nowMs: number): void {
    this.processes.set(`${health.process}\n${health.instrument}`, { health, heardMs: nowMs });
    // Any program may send any name. Of the names that the session does not need, only the newest stay.
    const others = [...this.processes].filter(([, { health: one }]) => !this.needs(one));
    others.sort(([, a], [, b]) => a.heardMs - b.heardMs);
    for (const [name] of others.slice(0, Math.max(0, others.length - MOST_OTHERS))) this.processes.delete(name);
  }

  private needs(health: Health): boolean {
    if (health.process === "daemon") return this.lacks(health) === "";
    return health.instrument === "" && ["simulator", "emulator"].includes(health.process);
  }

  /** Remark on a daemon whose instrument the scene does not have; "" for all others. */
  private lacks(health: Health): string {
    if (health.process !== "daemon" || this.scene === null) return "";
    const has = this.scene.instruments.some(({ name }) => name === health.instrument);
    return has ? "" : ", an instrument that the scene does not have";
  }

  choose(chosen: number, steers: boolean): void {
    for (const [k, { row }] of this.rows.entries()) setData(row, "chosen", String(steers && k === chosen));
  }

  /** Four times a second: numbers that change faster cannot be read. */
  refresh(viewer: Viewer | null, readings: Readings | null, fresh: boolean, nowMs: number): void {
    const figure = (name: keyof typeof FIGURES, value: number) =>
      this.history(name).add(1e-3 * nowMs, fresh ? value : NaN);
    figure("rate", viewer?.states_per_s ?? NaN);
    figure("latency", this.latencyMs);
    figure("solve", 1e-3 * this.solveUs);
    figure("residual", this.residual);
    figure("penetration", this.penetrationUm);
    const force = readings?.values["wall_force_largest_mN"];
    if (force !== undefined) figure("force", force ?? NaN);
    const error = readings?.values["segment_error_mm"];
    if (error !== undefined) figure("error", error ?? NaN);
    const words = fresh ? Panel.words(this.status) : "";
    setText(this.solver, `Solver status: ${!fresh ? "no states" : words === "" ? "good" : words}`);
    setData(this.solver, "level", fresh && words === "" ? "" : "warn");
    this.residual = this.solveUs = this.penetrationUm = NONE;
    this.status = this.newestStatus;
    this.showHealth(nowMs);
    setText(this.problem, viewer?.problem ?? "");
    this.problem.hidden = (viewer?.problem ?? "") === "";
  }

  /** Number of values of each plot, for tests. */
  plotted(): Record<string, number> {
    return Object.fromEntries(
      [...this.histories].map(([name, history]) => [name, history.kept.filter((value) => value !== null).length]));
  }

  private history(name: keyof typeof FIGURES): History {
    let history = this.histories.get(name);
    if (history === undefined) {
      history = new History(FIGURES[name]);
      this.histories.set(name, history);
      element(name === "force" ? "#histories" : "#solver-histories").append(history.root);
    }
    return history;
  }

  /** Message about the first daemon without a device; "" if every daemon has one. */
  missingDevice(nowMs: number): string {
    for (const { health, heardMs } of this.processes.values()) {
      if (health.process !== "daemon" || this.lacks(health) !== "") continue;
      if (nowMs - heardMs > OLD_MS) return `${health.instrument}: no data from the device`;
      if (health.state !== "running") return `${health.instrument}: ${health.state}`;
    }
    return "";
  }

  hasDaemon(): boolean {
    return [...this.processes.values()].some(({ health }) => health.process === "daemon");
  }

  private static words(status: number): string {
    return STATUS_WORDS.filter(([bit]) => (status & bit) !== 0)
      .map(([, word]) => word)
      .join(", ");
  }

  private showHealth(nowMs: number): void {
    const lines = [...this.processes.values()].map(({ health, heardMs }) => {
      const line = document.createElement("li");
      const silentS = (nowMs - heardMs) / 1000;
      const silent = !this.replays && nowMs - heardMs > OLD_MS;
      const of = health.instrument === "" ? "" : ` of the ${health.instrument}`;
      line.textContent = `${health.process}${of}: ${silent ? `silent for ${silentS.toFixed(0)} s` : health.state}${this.lacks(health)}`;
      const good = !silent && health.state === "running" && this.lacks(health) === "";
      line.dataset["level"] = good ? "good" : "warn";
      return line;
    });
    this.health.replaceChildren(...lines);
  }
}
