// The power injector: its set-up, its two buttons, and its figures.

import { element, setData, setText, short } from "./dom.js";
import type { Readings } from "./frames.js";
import type { InjectorOrder, InjectorSetUp } from "./orders.js";

type Values = Readings["values"];
type Key = keyof InjectorSetUp;

const OFF = 0, ARMED = 1, INJECTING = 2, COMPLETE = 3, ABORTED = 4; // injector_phase
const LIMITS: Record<Key, { name: string; least: number; most: number; unit: string }> = {
  volume_mL: { name: "Volume", least: 0.1, most: 150, unit: "mL" },
  rate_mL_s: { name: "Rate", least: 0.1, most: 45, unit: "mL/s" },
  delay_s: { name: "Delay", least: 0, most: 99.9, unit: "s" },
  rise_s: { name: "Rise", least: 0, most: 9.9, unit: "s" },
};
const ANSWER_MS = 10_000; // a set-up that the simulator does not show by then was refused
const KEYS = Object.keys(LIMITS) as Key[];

/** State in words, for the figures; null without an injector. */
export function injectorWords(values: Values): string | null {
  const phase = values["injector_phase"];
  const mL = (name: string) => {
    const value = values[name] ?? NaN;
    return `${value.toFixed(value < 99.95 ? 1 : 0)} mL`;
  };
  switch (phase) {
    case OFF:
      return "off";
    case ARMED:
      return `armed ${mL("injector_left_mL")}`;
    case INJECTING:
      return `${mL("injector_left_mL")} left`;
    case COMPLETE:
      return `${mL("injection_mL")} done`;
    case ABORTED:
      return `aborted ${mL("injection_mL")}`;
    default:
      return null;
  }
}

export class InjectorPanel {
  private readonly root = element<HTMLElement>("#injector");
  private readonly inputs = new Map<Key, HTMLInputElement>();
  private readonly arm = element<HTMLButtonElement>("#injector-arm");
  private readonly fire = element<HTMLButtonElement>("#injector-fire");
  private readonly opener = element<HTMLButtonElement>("#injector-button");
  private values: Values = {};
  private enabled = false;
  private open = false;
  private chosen: InjectorSetUp | null = null; // that the readings do not show yet
  private chosenMs = -Infinity;

  constructor(private readonly send: (order: InjectorOrder, setUp: InjectorSetUp) => void) {
    for (const key of KEYS) {
      const input = element<HTMLInputElement>(`#injector-${key}`);
      input.min = String(LIMITS[key].least);
      input.max = String(LIMITS[key].most);
      input.addEventListener("change", () => this.change());
      input.addEventListener("keydown", (event) => {
        if (event.code === "Escape" || event.code === "Enter") input.blur();
        event.stopPropagation(); // digits are no shortcuts here
      });
      this.inputs.set(key, input);
    }
    this.arm.addEventListener("click", () => this.press("1"));
    this.fire.addEventListener("click", () => this.press("3"));
    this.opener.addEventListener("click", () => this.show(!this.open));
  }

  private get phase(): number | undefined {
    return this.values["injector_phase"] ?? undefined;
  }

  /** Takes over the newest readings. A page that cannot order hides the injector. */
  take(values: Values, enabled: boolean): void {
    const isNew = this.phase === undefined;
    this.values = values;
    this.enabled = enabled && this.phase !== undefined;
    this.opener.hidden = !this.enabled;
    this.root.hidden = !this.enabled || !this.open;
    this.fill(isNew);
    this.say();
  }

  private fill(isNew: boolean): void {
    const now = this.inEffect();
    const isLate = performance.now() - this.chosenMs > ANSWER_MS;
    if (isNew || isLate || KEYS.every((key) => this.chosen?.[key] === now[key])) this.chosen = null;
    // Values stay while one of them is edited or out of range.
    const inputs = [...this.inputs.values()];
    const isEdited = inputs.some((input) => input === document.activeElement || input.dataset["bad"] === "true");
    if (this.phase === undefined || this.chosen !== null || (isEdited && !isNew)) return;
    for (const [key, input] of this.inputs) input.value = String(now[key]);
  }

  /** Keys 1 and 3: arm or disarm; inject or abort. Key 7 opens and closes the panel. */
  key(code: string): void {
    const digit = /^(?:Digit|Numpad)([137])$/.exec(code)?.[1];
    if (digit === "7") this.show(!this.open);
    else if (digit !== undefined) this.press(digit);
  }

  private press(digit: string): void {
    if (!this.enabled) return;
    const live = this.phase === ARMED || this.phase === INJECTING;
    if (digit === "1") this.order(live ? "off" : "arm");
    else if (live) this.order(this.phase === ARMED ? "inject" : "off");
  }

  // A change of the set-up disarms the injector.
  private change(): void {
    this.say();
    if (this.phase === INJECTING) return;
    this.chosen = this.setUp();
    this.chosenMs = performance.now();
    this.order("off");
  }

  private order(order: InjectorOrder): void {
    const setUp = this.setUp();
    if (setUp !== null) this.send(order, setUp);
    else if (order === "off") this.send("off", this.inEffect());
  }

  private inEffect(): InjectorSetUp {
    const value = (key: Key) => this.values[`injector_${key}`] ?? -1;
    return { volume_mL: value("volume_mL"), rate_mL_s: value("rate_mL_s"), delay_s: value("delay_s"), rise_s: value("rise_s") };
  }

  // Null if a value is out of range.
  private setUp(): InjectorSetUp | null {
    const setUp = this.inEffect();
    for (const [key, input] of this.inputs) {
      if (this.fault(key) !== "") return null;
      setUp[key] = input.valueAsNumber;
    }
    return setUp;
  }

  private fault(key: Key): string {
    const { name, least, most, unit } = LIMITS[key];
    const value = this.inputs.get(key)!.valueAsNumber;
    return value >= least && value <= most ? "" : `${name}: give ${least} to ${most} ${unit}`;
  }

  private show(open: boolean): void {
    this.open = open && this.enabled;
    this.root.hidden = !this.open;
    this.opener.setAttribute("aria-pressed", String(this.open));
  }

  private say(): void {
    let problem = "";
    for (const [key, input] of this.inputs) {
      const fault = this.fault(key);
      setData(input, "bad", String(fault !== ""));
      if (problem === "") problem = fault;
    }
    const { phase } = this;
    setText(this.arm.firstElementChild!, phase === ARMED || phase === INJECTING ? "Disarm" : "Arm");
    setText(this.fire.firstElementChild!, phase === INJECTING ? "Abort" : "Inject");
    this.fire.disabled = phase !== ARMED && phase !== INJECTING;
    for (const input of this.inputs.values()) input.disabled = phase === INJECTING;
    setText(element("#injector-state"), injectorWords(this.values) ?? "");
    setText(element("#injector-warning"), problem !== "" ? problem : this.excess());
  }

  // Warning before an injection that would exceed the patient's limit; "" if it would not.
  private excess(): string {
    const limit = this.values["contrast_limit_mL"];
    const injected = this.values["contrast_injected_mL"];
    if (typeof limit !== "number" || typeof injected !== "number" || this.phase === INJECTING) return "";
    const after = injected + this.inputs.get("volume_mL")!.valueAsNumber;
    return after > limit ? `above the patient's limit: ${short(after)} of ${short(limit)} mL` : "";
  }
}
