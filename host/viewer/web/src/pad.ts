// Pad on the page, for fingers and mouse: a stick, and buttons to hold. A button chooses if the stick moves the
// instrument, the C-arm or the table.

import { element, setData, setText } from "./dom.js";
import type { Held, Source, Steering } from "./steering.js";

const DEAD = 0.15; // fraction of the stick's travel without motion

/** Square of the deflection beyond the dead zone: fine near the middle. */
export function response(deflection: number): number {
  const beyond = Math.max(Math.abs(deflection) - DEAD, 0) / (1 - DEAD);
  return Math.sign(deflection) * Math.min(beyond, 1) ** 2;
}

const MODES = {
  instrument: { name: "instrument", stick: "up and down push and pull, left and right turn" },
  arm: { name: "C-arm", stick: "up and down to CRA and CAU, left and right to RAO and LAO" },
  table: { name: "table", stick: "up and down to head and feet, left and right to the patient's right and left" },
};
type Mode = keyof typeof MODES;

export class Pad implements Source {
  private readonly stick = element<HTMLElement>("#stick");
  private readonly knob = element<HTMLElement>("#stick i");
  private readonly holders: Holder[];
  private readonly xray: Holder;
  private readonly acquisition: Holder;
  private readonly contrast: Holder;
  private readonly up: Holder;
  private readonly down: Holder;
  private mode: Mode = "instrument";
  private instruments = 1;
  private hasXray = false;
  private x = 0; // of the stick, to the right
  private y = 0; // up

  constructor(private readonly steering: Steering) {
    steering.add(this);
    this.xray = new Holder(element("#pad-xray"), () => steering.tell());
    this.acquisition = new Holder(element("#pad-acquisition"), () => steering.tell());
    this.contrast = new Holder(element("#pad-contrast"), () => steering.tell());
    this.up = new Holder(element("#pad-up"), () => steering.tell());
    this.down = new Holder(element("#pad-down"), () => steering.tell());
    this.holders = [this.xray, this.acquisition, this.contrast, this.up, this.down];
    element("#pad-mode").addEventListener("click", () => this.chooseMode());
    element("#pad-next").addEventListener("click", () => steering.next(1));
    this.stick.addEventListener("pointerdown", (event) => {
      this.stick.setPointerCapture(event.pointerId);
      this.move(event);
    });
    this.stick.addEventListener("pointermove", (event) => {
      if (this.stick.hasPointerCapture(event.pointerId)) this.move(event);
    });
    this.stick.addEventListener("lostpointercapture", () => this.moveTo(0, 0));
  }

  /** Hides the buttons of effects and instruments that the scene does not have. */
  setEffects(xray: boolean, contrast: boolean, instruments: number): void {
    this.xray.button.hidden = this.acquisition.button.hidden = !xray;
    this.contrast.button.hidden = !contrast;
    this.hasXray = xray;
    this.instruments = instruments;
    if (!xray) this.mode = "instrument";
    this.showMode();
  }

  held(): Held {
    const stick = (mode: Mode, value: number) => (this.mode === mode ? value : 0);
    return {
      xray: this.xray.held, acquisition: this.acquisition.held, contrast: this.contrast.held,
      push: stick("instrument", this.y), turn: stick("instrument", this.x),
      lao: stick("arm", this.x), cra: stick("arm", this.y),
      tableLeft: stick("table", this.x), tableHead: stick("table", this.y),
      tableUp: (this.up.held ? 1 : 0) - (this.down.held ? 1 : 0),
    };
  }

  private chooseMode(): void {
    const all = Object.keys(MODES) as Mode[];
    this.mode = all[(all.indexOf(this.mode) + 1) % all.length]!;
    this.showMode();
  }

  private showMode(): void {
    const { name, stick } = MODES[this.mode];
    setData(element<HTMLElement>("#pad"), "mode", this.mode);
    const button = element<HTMLElement>("#pad-mode");
    button.hidden = !this.hasXray;
    setText(button, `Stick: ${name}`);
    this.stick.setAttribute("aria-label", `Drag: ${stick}`);
    element<HTMLElement>("#pad-next").hidden = this.mode !== "instrument" || this.instruments < 2;
    for (const { button: one } of [this.up, this.down]) one.hidden = this.mode !== "table";
    // A phone has room for six buttons.
    element<HTMLElement>("#pad-kind").hidden = !this.hasXray || this.mode === "table";
  }

  release(): void {
    for (const holder of this.holders) holder.held = false;
    this.x = this.y = 0;
    this.knob.style.transform = "";
  }

  private move(event: PointerEvent): void {
    const box = this.stick.getBoundingClientRect();
    const half = box.width / 2;
    const share = (value: number) => Math.min(Math.max(value / half, -1), 1);
    this.moveTo(share(event.clientX - box.left - half), share(event.clientY - box.top - half));
  }

  private moveTo(x: number, y: number): void {
    this.x = response(x);
    this.y = response(-y);
    this.knob.style.transform = `translate(${35 * x}px, ${35 * y}px)`;
    this.steering.tell();
  }
}

class Holder {
  private down = false;

  constructor(
    readonly button: HTMLButtonElement,
    private readonly changed: () => void,
  ) {
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      this.set(true);
    });
    button.addEventListener("lostpointercapture", () => this.set(false));
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  get held(): boolean {
    return this.down;
  }
  set held(down: boolean) {
    this.down = down;
    setData(this.button, "held", String(down));
  }

  private set(down: boolean): void {
    this.held = down;
    this.changed();
  }
}
