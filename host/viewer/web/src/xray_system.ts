// Settings of the X-ray system: display mode, pulse rate, field and shutters.

import { element, setText } from "./dom.js";
import type { Imaging } from "./frames.js";

const MODES = ["scene's display", "plain", "subtraction", "road map"];
const PULSES = [0, 7.5, 15, 30];
const MAGNIFICATIONS = [1, 1.5, 2, 3];
const SHUTTERS = [0, 0.1, 0.2, 0.3];
const ECHO_MS = 500; // delay until torquer-viewer reports the newest choice

function after(list: readonly number[], value: number): number {
  const place = list.findIndex((entry) => Math.abs(entry - value) < 1e-6);
  return list[(place + 1) % list.length]!;
}

export class XraySystem {
  private readonly root = element<HTMLElement>("#system");
  private now: Imaging = { mode: 0, pulses_per_s: 0, magnification: 1, shutters: [0, 0, 0, 0] };
  private enabled = false;
  private chosenMs = -Infinity;

  constructor(private readonly send: (imaging: Imaging) => void) {
    for (const key of ["M", "R", "Z", "K"]) {
      element(`#system-${key}`).addEventListener("click", () => this.next(`Key${key}`));
    }
  }

  /** Takes over the current settings from torquer-viewer. A page that cannot steer hides them. */
  take(imaging: Imaging, enabled: boolean): void {
    if (performance.now() - this.chosenMs > ECHO_MS) this.now = imaging;
    this.enabled = enabled;
    this.show();
  }

  private show(): void {
    const { enabled, now: imaging } = this;
    this.root.hidden = !enabled;
    const say = (key: string, text: string) => setText(element(`#system-${key} span`), text);
    say("M", MODES[imaging.mode] ?? "");
    say("R", imaging.pulses_per_s === 0 ? "scene's pulse rate" : `${imaging.pulses_per_s} pulses/s`);
    say("Z", `field ×${imaging.magnification}`);
    const most = Math.max(...imaging.shutters);
    say("K", most === 0 ? "shutters open" : `shutters ${Math.round(100 * most)} %`);
  }

  /** Chooses the next value of the setting of a key; false for other keys. */
  next(code: string): boolean {
    if (!this.enabled) return false;
    const { mode, pulses_per_s: pulses, magnification, shutters } = this.now;
    if (code === "KeyM") this.choose({ mode: (mode + 1) % MODES.length });
    else if (code === "KeyR") this.choose({ pulses_per_s: after(PULSES, pulses) });
    else if (code === "KeyZ") this.choose({ magnification: after(MAGNIFICATIONS, magnification) });
    else if (code === "KeyK") {
      const next = after(SHUTTERS, shutters[0]);
      this.choose({ shutters: [next, next, next, next] });
    } else return false;
    return true;
  }

  private choose(change: Partial<Imaging>): void {
    this.now = { ...this.now, ...change };
    this.chosenMs = performance.now();
    this.show();
    this.send(this.now);
  }
}
