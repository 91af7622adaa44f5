// Pad on the page, for fingers and mouse: a stick that pushes and turns, and buttons to hold.

import { element, setData } from "./dom.js";
import type { Held, Source, Steering } from "./steering.js";

const DEAD = 0.15; // fraction of the stick's travel without motion

/** Square of the deflection beyond the dead zone: fine near the middle. */
export function response(deflection: number): number {
  const beyond = Math.max(Math.abs(deflection) - DEAD, 0) / (1 - DEAD);
  return Math.sign(deflection) * Math.min(beyond, 1) ** 2;
}

export class Pad implements Source {
  private readonly stick = element<HTMLElement>("#stick");
  private readonly knob = element<HTMLElement>("#stick i");
  private readonly holders: Holder[];
  private readonly xray: Holder;
  private readonly contrast: Holder;
  private push = 0;
  private turn = 0;

  constructor(private readonly steering: Steering) {
    steering.add(this);
    this.xray = new Holder(element("#pad-xray"), () => steering.tell());
    this.contrast = new Holder(element("#pad-contrast"), () => steering.tell());
    this.holders = [this.xray, this.contrast];
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
    this.xray.button.hidden = !xray;
    this.contrast.button.hidden = !contrast;
    element<HTMLElement>("#pad-next").hidden = instruments < 2;
  }

  held(): Held {
    return {
      xray: this.xray.held, contrast: this.contrast.held, push: this.push, turn: this.turn, lao: 0, cra: 0,
    };
  }

  release(): void {
    for (const holder of this.holders) holder.held = false;
    this.push = this.turn = 0;
    this.knob.style.transform = "";
  }

  private move(event: PointerEvent): void {
    const box = this.stick.getBoundingClientRect();
    const half = box.width / 2;
    const share = (value: number) => Math.min(Math.max(value / half, -1), 1);
    this.moveTo(share(event.clientX - box.left - half), share(event.clientY - box.top - half));
  }

  private moveTo(x: number, y: number): void {
    this.turn = response(x);
    this.push = response(-y);
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
