// Case screen: the list of cases, the progress of start and end, and the report. It covers the page
// while no case runs. Only a torquer-viewer with --cases has it.

import { element, seconds, setText } from "./dom.js";
import type { Cases, TrainingCase } from "./frames.js";
import { type CaseAction, writeCase } from "./orders.js";

const HARDEST = 5;

export class CaseScreen {
  private readonly root = element<HTMLElement>("#cases");
  private readonly list = element<HTMLElement>("#case-list");
  private readonly buttons = new Map<string, HTMLButtonElement>();
  private cases: Cases | null = null;
  private phaseMs = 0; // when the phase began

  /** `began`: a case is running, or this page joins it; `cleared`: another run has started. */
  constructor(
    private readonly send: (message: ArrayBuffer) => void,
    private readonly began: (examination: boolean) => void,
    private readonly cleared: () => void,
  ) {
    this.button("#case-end", "end");
    this.button("#case-close", "close");
    element("#case-again").addEventListener("click", () => this.start(this.cases?.chosen ?? 0, this.cases?.examination ?? false));
  }

  take(cases: Cases): void {
    const before = this.cases;
    this.cases = cases;
    if (before === null) {
      this.fill(cases);
      // A page with cases shows the view of trainees.
      element<HTMLDetailsElement>("#developer").open = false;
    }
    if (before?.phase !== cases.phase) this.phaseMs = performance.now();
    if (before !== null && before.run !== cases.run) this.cleared();
    if (before?.phase !== "running" && cases.phase === "running") this.began(cases.examination);
    const report = element<HTMLIFrameElement>("#case-report");
    // Loads the report once, so that it keeps its scroll position.
    if (cases.report && !before?.report) report.src = "report.html";
    if (!cases.report && before?.report === true) report.removeAttribute("src");
    document.body.classList.add("has-cases");
    document.body.dataset["phase"] = cases.phase;
    if (cases.report) document.body.dataset["report"] = "";
    else delete document.body.dataset["report"];
    this.refresh();
    if (before !== null && before.phase !== cases.phase && this.covers) this.focus();
  }

  get newest(): Cases | null {
    return this.cases;
  }

  /** True if the case list covers the page, which then takes no keys. */
  get covers(): boolean {
    return this.cases !== null && this.cases.phase !== "running";
  }

  /** The running case. */
  get running(): TrainingCase | undefined {
    return this.cases?.phase === "running" ? this.chosen() : undefined;
  }

  /** True while an examination runs. */
  get examines(): boolean {
    return this.cases?.phase === "running" && this.cases.examination;
  }

  /** Text for the header; "" while a case runs. */
  get words(): string {
    const chosen = this.chosen()?.title ?? "";
    switch (this.cases?.phase) {
      case "choose":
        return "Choose a case";
      case "starting":
        return `Loading: ${chosen}`;
      case "ending":
        return "Ending";
      case "ended":
        return this.cases.problem === "" ? "Case ended" : "Case ended early";
      default:
        return "";
    }
  }

  /** Four times a second: updates the elapsed time of a start or an end. */
  refresh(): void {
    this.root.hidden = !this.covers;
    if (this.cases === null || !this.covers) return;
    const { phase, problem } = this.cases;
    const passedS = Math.floor((performance.now() - this.phaseMs) / 1000);
    const title = this.chosen()?.title ?? "";
    const notices: Record<string, string> = {
      choose: "Choose a case",
      starting: `${title}: loading the patient's vessels. The first start of a case takes longer. ${seconds(passedS)}`,
      ending: `${title}: writing the report. ${seconds(passedS)}`,
      ended: title,
      running: "",
    };
    setText(element("#case-title"), notices[phase] ?? "");
    setText(element("#case-problem"), problem);
    element<HTMLElement>("#case-problem").hidden = problem === "";
    setText(element("#case-folder"), phase === "ended" ? `Files of this session: ${this.cases.folder}` : "");
  }

  private chosen(): TrainingCase | undefined {
    return this.cases?.cases[this.cases.chosen];
  }

  private start(number: number, examination: boolean): void {
    this.send(writeCase(examination ? "examine" : "start", number));
  }

  private button(selector: string, action: CaseAction): void {
    element(selector).addEventListener("click", () => this.send(writeCase(action, 0)));
  }

  private focus(): void {
    const first = this.cases?.phase === "choose" ? [...this.buttons.values()][0] : element<HTMLElement>("#case-again");
    first?.focus({ preventScroll: true });
  }

  private fill(cases: Cases): void {
    this.list.replaceChildren(...cases.cases.map((one, number) => this.card(one, number)));
  }

  private card(one: TrainingCase, number: number): HTMLElement {
    const card = document.createElement("li");
    const picture = document.createElement(one.picture ? "img" : "div");
    picture.className = "case-picture";
    if (picture instanceof HTMLImageElement) {
      picture.src = `cases/${encodeURIComponent(one.name)}.jpg`;
      picture.alt = "";
    }
    const title = document.createElement("h2");
    title.textContent = one.title;
    const difficulty = document.createElement("p");
    difficulty.className = "case-difficulty";
    const dots = document.createElement("span");
    dots.textContent = "●".repeat(one.difficulty) + "○".repeat(HARDEST - one.difficulty);
    dots.setAttribute("role", "img");
    dots.setAttribute("aria-label", `difficulty ${one.difficulty} of ${HARDEST}`);
    const holds = [one.instruments.join(", "), one.xray ? "X-ray" : "no X-ray"].join(" · ");
    difficulty.append(dots, holds);
    const task = document.createElement("p");
    task.textContent = one.task;
    const row = document.createElement("div");
    row.append(this.startButton(one, number, false));
    // An examination shows only X-ray.
    if (one.xray) row.append(this.startButton(one, number, true));
    card.append(picture, title, difficulty, task, row);
    return card;
  }

  private startButton(one: TrainingCase, number: number, examination: boolean): HTMLButtonElement {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = examination ? "Examination" : "Practice";
    button.setAttribute("aria-label", `${button.textContent}: ${one.title}`);
    button.addEventListener("click", () => this.start(number, examination));
    if (!examination) this.buttons.set(one.name, button);
    return button;
  }
}
