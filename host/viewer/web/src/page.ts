// The page: passes incoming messages to the screens, and sends the controls that are held down.

import { CaseScreen } from "./cases.js";
import { element, setData, setText } from "./dom.js";
import { Fluoroscopy } from "./fluoroscopy.js";
import { Examination } from "./examination.js";
import type { Incoming, Readings, Scene, Viewer, WireState } from "./frames.js";
import { STATUS } from "./frames.js";
import { GamepadSource } from "./gamepad.js";
import { InjectorPanel } from "./injector.js";
import { Keyboard } from "./keyboard.js";
import { Link } from "./link.js";
import { write, writeExchange, writeImaging, writeInjector, writeReplay, writeTable } from "./orders.js";
import { Pad } from "./pad.js";
import { Panel } from "./panel.js";
import { PatientMonitor } from "./patient.js";
import { Prices } from "./prices.js";
import { ReplayBar } from "./replay.js";
import { Space } from "./space.js";
import { Steering } from "./steering.js";
import { TrayBar } from "./tray.js";
import { XraySystem } from "./xray_system.js";

const STATE_OLD_MS = 1200; // a state comes five times a second at least
const REFRESH_MS = 250;

class Page {
  private readonly fluoroscopy = new Fluoroscopy();
  private readonly space = new Space();
  private readonly tray = new TrayBar((instrument, device) => this.link.send(writeExchange(instrument, device)));
  private readonly panel = new Panel((instrument) => this.tray.toggle(instrument));
  private readonly patient = new PatientMonitor();
  private readonly prices = new Prices();
  private readonly steering = new Steering(
    (controls) => {
      this.link.send(write(controls));
      this.link.send(writeTable(controls));
    },
    () => this.choose(),
  );
  private readonly keyboard = new Keyboard(this.steering);
  private readonly pad = new Pad(this.steering);
  private readonly gamepad = new GamepadSource(this.steering);
  private readonly xraySystem = new XraySystem((imaging, acquisition, choice) => this.link.send(writeImaging(imaging, acquisition, choice)));
  private readonly injector = new InjectorPanel((order, setUp) => this.link.send(writeInjector(order, setUp)));
  private readonly examination = new Examination();
  private readonly cases = new CaseScreen(
    (message) => this.link.send(message),
    (examination) => this.examination.set(examination, 0),
    () => this.forget(),
  );
  private readonly replay = new ReplayBar((controls) => this.link.send(writeReplay(controls)));
  private scene: Scene | null = null;
  private state: WireState | null = null;
  private viewer: Viewer | null = null;
  private readings: Readings | null = null;
  private stateMs = -Infinity;
  private pictures = 0;
  private hinted = "";
  private live = false; // true if the newest picture is live, not held
  private readonly link = new Link((message) => this.take(message), () => this.refresh());

  constructor() {
    element("#keys-button").addEventListener("click", () => this.showKeys());
    element("#pad-button").addEventListener("click", () => this.showPad(element<HTMLElement>("#pad").hidden));
    element("#exam").addEventListener("click", () => this.examine());
    addEventListener("keydown", (event) => this.shortcut(event));
    setInterval(() => this.refresh(), REFRESH_MS);
    const frame = () => {
      this.gamepad.poll();
      this.fluoroscopy.advance(performance.now());
      this.space.draw();
      this.patient.draw(performance.now());
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    this.refresh();
    // Access for tests to the shown data.
    Object.assign(window, {
      torquer: {
        space: this.space,
        state: () => this.state,
        scene: () => this.scene,
        readings: () => this.readings,
        patient: () => this.patient.shown,
        drawn: () => this.fluoroscopy.drawn,
        measured: () => this.fluoroscopy.measure.measured,
        mask: () => this.fluoroscopy.subtraction.now,
        take: (message: Incoming) => this.take(message),
        viewer: () => this.viewer,
        cases: () => this.cases.newest,
        pictures: () => this.pictures,
        plotted: () => this.panel.plotted(),
        controls: () => this.steering.controls(),
      },
    });
  }

  private take(message: Incoming): void {
    const nowMs = performance.now();
    switch (message.kind) {
      case "state":
        this.state = message;
        this.stateMs = nowMs;
        this.space.setState(message);
        this.panel.setState(message);
        this.tray.setState(message);
        break;
      case "picture":
        if (message.lateral) {
          this.fluoroscopy.showLateral(message);
          break;
        }
        ++this.pictures;
        this.live = !message.held;
        this.fluoroscopy.show(message);
        if (this.viewer?.steer !== true) this.setAngles(message.laoRad, message.craRad);
        this.lamp();
        break;
      case "vessel":
        this.space.setVessel(message);
        break;
      case "replay":
        this.replay.take(message);
        document.body.classList.add("replays");
        this.panel.replays = true;
        break;
      case "cases":
        this.cases.take(message);
        this.showName();
        this.enableSteering();
        break;
      case "lines":
        this.space.setLines(message);
        this.examination.setLines(message);
        break;
      case "scene":
        this.takeScene(message);
        break;
      case "readings":
        this.readings = message;
        this.fluoroscopy.setReadings(message, this.viewer?.contrast === true);
        this.injector.take(message.values, !this.replay.shown);
        break;
      case "tray":
        this.tray.setTray(message);
        break;
      case "devices":
        this.tray.take(message);
        this.panel.setDevices(message, this.tray.products, this.tray.enabled);
        break;
      case "patient":
        this.patient.take(message);
        break;
      case "health":
        this.panel.setHealth(message, nowMs);
        if (message.process === "simulator") this.prices.take(message);
        break;
      case "viewer":
        this.viewer = message;
        this.enableSteering();
        document.body.classList.toggle("steers", message.steer);
        this.xraySystem.take(message, !this.replay.shown);
        if (message.steer) this.setAngles(message.lao_rad, message.cra_rad);
        this.lamp();
        break;
    }
  }

  // Disabled while the list of cases is shown: the browser then handles the keys.
  private enableSteering(): void {
    const enabled = this.viewer?.steer === true && !this.cases.covers;
    if (enabled === this.steering.enabled) return;
    this.showPad(enabled && matchMedia("(pointer: coarse)").matches);
    this.steering.enabled = enabled;
  }

  // Discards the data shown for another scene, or for another run of the same one.
  private forget(): void {
    this.scene = null;
    this.state = null;
    this.stateMs = -Infinity;
    this.readings = null;
    this.pictures = 0;
    this.fluoroscopy.clear();
    this.injector.take({}, false);
    this.tray.clear();
    this.panel.clear();
    this.patient.clear();
    this.examination.set(this.cases.examines, 0);
  }

  private takeScene(scene: Scene): void {
    if (this.scene !== null && this.scene.hash !== scene.hash) this.forget();
    const another = this.scene?.hash !== scene.hash;
    this.scene = scene;
    this.space.setScene(scene);
    if (another) this.prices.setScene(scene);
    this.panel.setScene(scene);
    this.tray.setScene(scene);
    this.patient.setScene(scene);
    this.examination.setScene(scene);
    this.steering.setInstruments(scene.instruments.length);
    this.pad.setEffects(
      scene.effects.includes("fluoroscopy"), scene.effects.includes("contrast"), scene.instruments.length);
    document.body.classList.toggle("biplane", scene.effects.includes("lateral_plane"));
    document.body.classList.toggle("no-xray", !scene.effects.includes("fluoroscopy"));
    this.showName();
    document.title = `${scene.name} · Torquer`;
    this.choose();
  }

  // A running case has its title and task in the header.
  private showName(): void {
    const running = this.cases.running;
    setText(element("#scene-name"), running?.title ?? this.scene?.name.replaceAll("_", " ") ?? "");
    setText(element("#case-task"), running?.task ?? "");
  }

  // While a loop plays, its angles are shown.
  private setAngles(laoRad: number, craRad: number): void {
    if (!this.fluoroscopy.playing) this.fluoroscopy.setAngles(laoRad, craRad);
  }

  // A page that steers knows its own pedal. The state of a device's pedal follows from the pictures.
  private lamp(): void {
    const on = this.fresh() && this.xrayNow();
    this.fluoroscopy.setLamp(on);
    const held = this.fluoroscopy.playing ? "Recorded loop" : "Last image hold";
    this.fluoroscopy.setHold(on, this.pictures > 0 ? held : "");
  }

  private xrayNow(): boolean {
    return this.viewer?.steer === true ? this.viewer.xray : this.live;
  }

  private fresh(): boolean {
    if (!this.link.open) return false;
    // A recording does not age.
    return this.replay.shown ? this.state !== null : performance.now() - this.stateMs < STATE_OLD_MS;
  }

  private choose(): void {
    this.panel.choose(this.steering.chosen, this.keyboard.steers);
  }

  private refresh(): void {
    const nowMs = performance.now();
    this.cases.refresh();
    this.panel.refresh(this.viewer, this.readings, this.fresh(), nowMs);
    this.patient.refresh(this.fresh());
    this.examination.refresh(this.readings, this.state);
    this.tray.enabled = this.viewer !== null && !this.replay.shown;
    this.tray.refresh();
    const [level, text, notice] = this.session(nowMs);
    const shown = element<HTMLElement>("#state");
    setData(shown, "level", level);
    setText(shown, text.charAt(0).toUpperCase() + text.slice(1));
    this.fluoroscopy.setNotice(notice !== "" ? notice : this.pictureNotice());
    setText(element("#space-notice"), document.body.classList.contains("no-xray") ? notice : "");
    this.showHint();
    this.choose();
    this.lamp();
  }

  // Level, text for the header, and a sentence across the picture while there is no picture.
  private session(nowMs: number): ["good" | "warn", string, string] {
    if (!this.link.open) {
      return ["warn", "No connection", "No connection to the program that serves this page. The page keeps trying. If the program was started again, open its new link."];
    }
    if (this.cases.covers) return ["good", this.cases.words, ""];
    if (this.state === null || this.scene === null) {
      return ["warn", "Waiting for a simulator", "No simulator on the bus yet. Start one: torquer\u2011simulator --scene FILE"];
    }
    if (!this.fresh()) {
      const silentS = Math.round((nowMs - this.stateMs) / 1000);
      return ["warn", `Simulator silent for ${silentS} s`, "The simulator does not answer. The page shows its last state."];
    }
    if (this.replay.shown) return ["good", this.replay.playing ? "Replay" : "Replay, paused", ""];
    if (this.xraySystem.problem !== "") return ["warn", this.xraySystem.problem, ""];
    const missing = this.panel.missingDevice(nowMs);
    if (missing !== "") return ["warn", missing, ""];
    const hand = this.handInTrouble();
    if (hand !== "") return ["warn", hand, ""];
    if ((this.state.status & STATUS.inDoubt) !== 0) {
      return ["warn", this.viewer?.steer === true ? "Wire held: no page steers" : "Wire held: no commands from the device", ""];
    }
    if (this.viewer?.steer !== true && !this.panel.hasDaemon()) return ["good", "No device", ""];
    return ["good", this.handWord(), ""];
  }

  // The joystick of the innermost instrument's device, the first, is the one that counts.
  private handWord(): string {
    const hands = this.viewer?.hands ?? [];
    if (hands.some(({ clutch }) => clutch)) return "Clutch held";
    const name = this.scene?.instruments[0]?.name;
    const first = hands.find(({ instrument }) => instrument === name);
    if (first?.table === true) return "Running, stick moves the table";
    return first?.height === true ? "Running, stick moves the table up and down" : "Running";
  }

  // First problem of the devices that move instruments; "" if there is none.
  private handInTrouble(): string {
    for (const { instrument, fault, lift, uncalibrated } of this.viewer?.hands ?? []) {
      if (fault) return `${instrument}: the sensor does not answer`;
      if (lift) return `${instrument}: no wire below the sensor, the wire is held`;
      if (uncalibrated) return `${instrument}: the device is not calibrated`;
    }
    return "";
  }

  private pictureNotice(): string {
    if (this.pictures > 0 || document.body.classList.contains("no-xray")) return "";
    if (this.replay.shown) return "No X-ray so far";
    return this.viewer?.steer === true ? "Hold the space bar for X-ray" : "No X-ray yet: press the pedal";
  }

  private showHint(): void {
    let parts: [string, string][] = [["F", "follow the tip"], ["V", "whole vessel"]];
    if (this.viewer?.steer === true) {
      const effects = this.scene?.effects ?? [];
      const xray: [string, string][] = [["Space", "X-ray"], ["Enter", this.xraySystem.acquisition], ["W A S D", "C-arm"]];
      if (effects.includes("contrast")) xray.splice(2, 0, ["C", "contrast"]);
      parts = [
        ["↑ ↓", "push, pull"], ["← →", "turn"], ["Shift", "fine"], ["Tab", "next instrument"],
        // A second row of hints would make the picture smaller.
        ...(effects.includes("fluoroscopy") ? [...xray, parts[0]!] : parts),
      ];
    } else if (this.replay.shown) {
      parts.unshift(["Space", "play, pause"], ["← →", "one state back, forward"], ["Shift ← →", "5 s back, forward"]);
    } else {
      parts.unshift(["", "Devices move the instruments; this page only shows them."]);
    }
    const hint = element("#hint");
    const text = JSON.stringify(parts);
    if (this.hinted === text) return;
    this.hinted = text;
    hint.replaceChildren();
    for (const [keys, what] of parts) {
      const part = document.createElement("span");
      for (const key of keys.split(" ").filter((word) => word !== "")) {
        const shown = document.createElement("kbd");
        shown.textContent = key;
        part.append(shown);
      }
      part.append(` ${what}`);
      hint.append(part);
    }
  }

  private showPad(shown: boolean): void {
    element<HTMLElement>("#pad").hidden = !shown;
    element("#pad-button").setAttribute("aria-pressed", String(shown));
  }

  private examine(): void {
    // The choice of a case decides if it is an examination. Its record notes the choice.
    if (document.body.classList.contains("no-xray") || this.cases.newest !== null) return;
    this.examination.set(!this.examination.on, this.state?.timeS ?? 0);
  }

  private showKeys(): void {
    element<HTMLDialogElement>("#keys").showModal();
  }

  private shortcut(event: KeyboardEvent): void {
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
    if (this.cases.covers || document.querySelector("dialog[open]") !== null) return;
    if (event.key === "?") this.showKeys();
    if (event.code === "KeyF") this.space.follow(!this.space.follows);
    if (event.code === "KeyV") this.space.showAll();
    if (event.code === "KeyI") this.space.lookFromInside(!this.space.insideLumen);
    if (event.code === "KeyX") this.space.section(!this.space.cuts);
    if (event.code === "KeyL") this.fluoroscopy.togglePlay();
    if (event.code === "KeyO") this.fluoroscopy.store();
    if (event.code === "Comma") this.fluoroscopy.stepLoop(-1);
    if (event.code === "Period") this.fluoroscopy.stepLoop(1);
    this.fluoroscopy.subtraction.keys(event.code);
    if (event.code === "KeyQ") this.fluoroscopy.measure.next();
    if (event.code === "KeyE") this.examine();
    this.xraySystem.next(event.code);
    this.injector.key(event.code);
    if (event.code === "KeyP" && this.steering.enabled) this.showPad(element<HTMLElement>("#pad").hidden);
  }
}

new Page();
