// Settings of the X-ray system: display mode, pulse rate, acquisition, field, shutters and wedge filters.

import { element, setText } from "./dom.js";
import type { Acquisition, Imaging, Viewer } from "./frames.js";

const MODES = ["as scene", "plain", "subtraction", "road map", "cine"];
const PULSES = [0, 7.5, 15, 30];
// The heart needs cine, vessels that rest need a subtraction with few pictures.
const ACQUISITIONS: readonly Acquisition[] = [
  { mode: 4, pulses_per_s: 15 }, { mode: 4, pulses_per_s: 30 }, { mode: 4, pulses_per_s: 7.5 },
  { mode: 2, pulses_per_s: 3 }, { mode: 2, pulses_per_s: 6 },
];
const MAGNIFICATIONS = [1, 1.5, 2, 3];
const SHUTTERS = [0, 0.1, 0.2, 0.3];
const WEDGES = [0, 1, 2, 3]; // bits: 1 the left one is in, 2 the right one
const DEPTHS = [0.1, 0.2, 0.3, 0.4, 0.5]; // fractions of the picture
const WEDGE_NAMES = ["wedges out", "wedge left", "wedge right", "wedges in"];
const TURNS = [0, 30, 60, 90, -60, -30];
const ANSWER_MS = 10000; // a choice without an answer is lost then

function after(list: readonly number[], value: number): number {
  const place = list.findIndex((entry) => Math.abs(entry - value) < 1e-6);
  return list[(place + 1) % list.length]!;
}

// Bits of the wedges that are in the beam.
function wedgesIn({ wedges }: Imaging): number {
  return wedges.reduce((bits, { share }, k) => bits | (share > 0 ? 1 << k : 0), 0);
}

export class XraySystem {
  private readonly root = element<HTMLElement>("#system");
  private now: Imaging = { mode: 0, pulses_per_s: 0, magnification: 1, shutters: [0, 0, 0, 0], wedges: [] };
  private acquires = ACQUISITIONS[0]!;
  private enabled = false;
  private choice = crypto.getRandomValues(new Uint32Array(1))[0]!; // number of the newest choice; pages have different ones
  private chosenMs = -Infinity;
  private answered = true;
  private depth = 0.3; // of wedges that come in next

  /** `send` returns false if there is no connection. */
  constructor(private readonly send: (imaging: Imaging, acquisition: Acquisition, choice: number) => boolean) {
    for (const code of ["KeyM", "KeyR", "KeyZ", "KeyK", "KeyU", "Digit9", "KeyT"]) {
      element(`#system-${code.slice(-1)}`).addEventListener("click", () => this.next(code));
    }
    for (const id of ["#pad-kind", "#system-acquisition"]) element(id).addEventListener("click", () => this.next("Minus"));
  }

  /**
   * Takes over the current settings from torquer-viewer. A report from before the answer to the newest choice is
   * older than that choice, however late it comes. A page that cannot steer hides the settings.
   */
  take(viewer: Viewer, enabled: boolean): void {
    if (viewer.answered?.includes(this.choice) === true) this.answered = true;
    if (this.answered || this.problem !== "") {
      this.now = viewer;
      this.acquires = viewer.acquisition ?? this.acquires;
    }
    this.enabled = enabled;
    this.show();
  }

  /** Sentence for people if torquer-viewer does not answer; else "". */
  get problem(): string {
    const late = !this.answered && performance.now() - this.chosenMs > ANSWER_MS;
    return late ? "X-ray setting not taken: no answer" : "";
  }

  /** Kind of the acquisition, in words. */
  get acquisition(): string {
    return `${MODES[this.acquires.mode]} ${this.acquires.pulses_per_s}/s`;
  }

  private show(): void {
    const { enabled, now: imaging } = this;
    this.root.hidden = !enabled;
    const say = (key: string, text: string) => setText(element(`#system-${key} span`), text);
    say("M", MODES[imaging.mode] ?? "");
    say("R", imaging.pulses_per_s === 0 ? "scene's rate" : `${imaging.pulses_per_s} pulses/s`);
    say("Z", `field ×${imaging.magnification}`);
    setText(element("#pad-kind"), this.acquisition);
    say("acquisition", `acquires ${this.acquisition}`);
    const most = Math.max(...imaging.shutters);
    say("K", most === 0 ? "shutters open" : `shutters ${Math.round(100 * most)} %`);
    const wedges = wedgesIn(imaging);
    say("U", WEDGE_NAMES[wedges] ?? "");
    say("9", `${Math.round(100 * this.share)} %`);
    say("T", `${this.turn}°`);
    for (const key of ["9", "T"]) element<HTMLElement>(`#system-${key}`).hidden = wedges === 0;
  }

  /** Chooses the next value of the setting of a key; false for other keys. */
  next(code: string): boolean {
    if (!this.enabled) return false;
    const { mode, pulses_per_s: pulses, magnification, shutters } = this.now;
    if (code === "KeyM") this.choose({ mode: (mode + 1) % MODES.length });
    else if (/^(?:Minus|NumpadSubtract)$/.test(code)) {
      const place = ACQUISITIONS.findIndex(({ mode, pulses_per_s }) => mode === this.acquires.mode && pulses_per_s === this.acquires.pulses_per_s);
      this.choose({}, ACQUISITIONS[(place + 1) % ACQUISITIONS.length]!);
    } else if (code === "KeyR") this.choose({ pulses_per_s: after(PULSES, pulses) });
    else if (code === "KeyZ") this.choose({ magnification: after(MAGNIFICATIONS, magnification) });
    else if (code === "KeyK") {
      const next = after(SHUTTERS, shutters[0]);
      this.choose({ shutters: [next, next, next, next] });
    } else if (code === "KeyU") this.placeWedges(after(WEDGES, wedgesIn(this.now)), this.share, this.turn);
    else if (wedgesIn(this.now) === 0) return false;
    else if (/^(?:Digit|Numpad)9$/.test(code)) this.placeWedges(wedgesIn(this.now), after(DEPTHS, this.share), this.turn);
    else if (code === "KeyT") this.placeWedges(wedgesIn(this.now), this.share, after(TURNS, this.turn));
    else return false;
    return true;
  }

  private get share(): number {
    return this.now.wedges.find(({ share }) => share > 0)?.share ?? this.depth;
  }

  private get turn(): number {
    return this.now.wedges[0]?.rotation_deg ?? 0;
  }

  // Both have the same depth and turn, so that opposite sides of the picture are covered.
  private placeWedges(bits: number, share: number, turn: number): void {
    const place = (bit: number) => ({ share: (bits & bit) !== 0 ? share : 0, rotation_deg: turn });
    this.depth = share;
    this.choose({ wedges: [place(1), place(2)] });
  }

  private choose(change: Partial<Imaging>, acquisition = this.acquires): void {
    const { mode, pulses_per_s, magnification, shutters, wedges } = { ...this.now, ...change };
    const chosen = { mode, pulses_per_s, magnification, shutters, wedges };
    const choice = (this.choice + 1) % 2 ** 32;
    if (!this.send(chosen, acquisition, choice)) return;
    this.acquires = acquisition;
    this.choice = choice;
    this.now = chosen;
    this.chosenMs = performance.now();
    this.answered = false;
    this.show();
  }
}
