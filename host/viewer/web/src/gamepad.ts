// Gamepad with the standard layout. The left stick pushes and turns, the right stick moves the C-arm. The cross moves
// the table, the triggers lower and raise it. A is the X-ray, B the contrast. The right shoulder selects the next instrument, the left shoulder fine motion.

import { response } from "./pad.js";
import type { Held, Source, Steering } from "./steering.js";

const FINE = 0.15;
const [A, B, X, LEFT_SHOULDER, RIGHT_SHOULDER] = [0, 1, 2, 4, 5] as const;
const [LEFT_TRIGGER, RIGHT_TRIGGER, UP, DOWN, LEFT, RIGHT] = [6, 7, 12, 13, 14, 15] as const;
const NOTHING: Held = {
  xray: false, acquisition: false, contrast: false, push: 0, turn: 0, lao: 0, cra: 0, tableLeft: 0, tableHead: 0,
  tableUp: 0,
};

export class GamepadSource implements Source {
  private now: Held = NOTHING;
  private nextDown = false;

  constructor(private readonly steering: Steering) {
    steering.add(this);
  }

  /** Reads the gamepads, once per frame: browsers report them only on request. */
  poll(): void {
    if (!this.steering.enabled || document.hidden || !document.hasFocus()) return;
    const pad = navigator.getGamepads().find((found) => found !== null && found.mapping === "standard");
    const before = this.now;
    this.now = pad ? GamepadSource.read(pad) : NOTHING;
    const nextDown = pad?.buttons[RIGHT_SHOULDER]?.pressed === true;
    if (nextDown && !this.nextDown) this.steering.next(1);
    this.nextDown = nextDown;
    if (JSON.stringify(before) !== JSON.stringify(this.now)) this.steering.tell();
  }

  held(): Held {
    return this.now;
  }

  release(): void {
    this.now = NOTHING;
  }

  private static read(pad: Gamepad): Held {
    const speed = pad.buttons[LEFT_SHOULDER]?.pressed === true ? FINE : 1;
    const axis = (k: number) => response(pad.axes[k] ?? 0);
    const pressed = (k: number) => pad.buttons[k]?.pressed === true;
    const share = (k: number) => pad.buttons[k]?.value ?? 0;
    // Upwards is negative on a stick. -0 becomes 0, so that it does not count as a change.
    return {
      xray: pressed(A), acquisition: pressed(X), contrast: pressed(B),
      push: 0 - speed * axis(1), turn: speed * axis(0), lao: axis(2), cra: 0 - axis(3),
      tableLeft: share(RIGHT) - share(LEFT), tableHead: share(UP) - share(DOWN),
      tableUp: share(RIGHT_TRIGGER) - share(LEFT_TRIGGER),
    };
  }
}
