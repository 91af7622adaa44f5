// The tray: devices of the library, for which instruments can be exchanged.

import { element, setText } from "./dom.js";
import type { Devices, Scene, Tray, WireState } from "./frames.js";

const OUTSIDE_MM = 1e-3; // so far an instrument counts as withdrawn

export class TrayBar {
  private readonly root = element<HTMLElement>("#tray");
  private readonly name = element<HTMLElement>("#tray-instrument");
  private readonly choice = element<HTMLSelectElement>("#tray-device");
  private readonly exchange = element<HTMLButtonElement>("#tray-exchange");
  private readonly answer = element<HTMLElement>("#tray-state");
  private readonly warning = element<HTMLElement>("#tray-warning");
  private tray: Tray["devices"] = [];
  private scene: Scene | null = null;
  private now: Devices | null = null;
  private insertedMm: number[] = [];
  private instrument = 0;
  private before: Devices | null = null; // when the newest order was given
  enabled = false;

  constructor(private readonly send: (instrument: number, device: string) => void) {
    this.choice.addEventListener("change", () => this.say());
    this.choice.addEventListener("keydown", (event) => event.stopPropagation()); // letters choose a device here
    this.exchange.addEventListener("click", () => this.order());
    element("#tray-close").addEventListener("click", () => this.close());
  }

  /** Product of each device, by its name. */
  get products(): Map<string, string> {
    return new Map(this.tray.map(({ name, product }) => [name, product]));
  }

  setTray(tray: Tray): void {
    this.tray = tray.devices;
  }

  setScene(scene: Scene): void {
    this.scene = scene;
  }

  setState(state: WireState): void {
    this.insertedMm = state.instruments.map(({ insertionMm }) => insertionMm);
  }

  take(devices: Devices): void {
    this.now = devices;
  }

  /** Discards the data of the last run. */
  clear(): void {
    this.scene = this.now = this.before = null;
    this.close();
  }

  /** Opens the tray for an instrument, and closes it for the one that is shown. */
  toggle(instrument: number): void {
    const again = !this.root.hidden && this.instrument === instrument;
    if (again || !this.enabled || this.scene === null || this.now === null) return this.close();
    this.instrument = instrument;
    this.before = null;
    const { name, hollow } = this.scene.instruments[instrument]!;
    setText(this.name, name);
    const options = this.tray.filter((device) => device.hollow === hollow).map(({ name: device, product }) => {
      const option = document.createElement("option");
      option.value = device;
      option.textContent = product;
      option.selected = device === this.now!.devices[instrument];
      return option;
    });
    this.choice.replaceChildren(...options);
    this.root.hidden = false;
    this.say();
    this.choice.focus();
  }

  close(): void {
    this.root.hidden = true;
  }

  /** Four times a second. */
  refresh(): void {
    if (!this.root.hidden && !this.enabled) this.close();
    if (!this.root.hidden) this.say();
  }

  private order(): void {
    this.before = this.now;
    this.send(this.instrument, this.choice.value);
    this.say();
  }

  private say(): void {
    const insertedMm = this.insertedMm[this.instrument] ?? NaN;
    const out = insertedMm <= OUTSIDE_MM;
    this.exchange.disabled = !out;
    const current = this.now?.devices[this.instrument] ?? "";
    const product = this.tray.find(({ name }) => name === current)?.product;
    setText(this.answer, `now: ${product ?? (current === "" ? "as the scene describes it" : current)}`);
    const refused = this.before !== null && this.now !== this.before ? (this.now?.refusal ?? "") : "";
    setText(this.warning, out ? refused : `Withdraw it to 0 mm first; it is ${insertedMm.toFixed(0)} mm inside`);
  }
}
