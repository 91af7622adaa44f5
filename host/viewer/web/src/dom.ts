// Helpers for the page's elements, and formats of numbers.

export function element<T extends Element>(selector: string): T {
  const found = document.querySelector<T>(selector);
  if (found === null) throw new Error(`the page has no ${selector}`);
  return found;
}

export function setText(target: Element, text: string): void {
  if (target.textContent !== text) target.textContent = text;
}

export function setData(target: HTMLElement | SVGElement, name: string, value: string): void {
  if (target.dataset[name] !== value) target.dataset[name] = value;
}

const UNKNOWN = "–";

/** Number with a sign, for positions of a hand. */
export function signed(value: number, digits: number): string {
  if (!Number.isFinite(value)) return UNKNOWN;
  const text = value.toFixed(digits).replace("-", "−");
  return value > 0 ? `+${text}` : text;
}

/** Time as min:s, such as "1:05 min". */
export function seconds(value: number): string {
  if (!Number.isFinite(value)) return UNKNOWN;
  const whole = Math.max(0, Math.floor(value));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} min`;
}

/** Three significant digits, or all digits before the point: "41.2", "1250", "3.14e−7". */
export function short(value: number): string {
  if (!Number.isFinite(value)) return UNKNOWN;
  if (value === 0) return "0";
  if (Math.abs(value) < 0.001) return value.toExponential(2).replaceAll("-", "−");
  return Math.abs(value) >= 99.95 ? value.toFixed(0) : value.toPrecision(3);
}

/** Rows of a definition list, by term. A row keeps its elements when its value changes. */
export class Rows {
  private readonly values = new Map<string, HTMLElement>();

  constructor(private readonly list: HTMLElement) {}

  set(term: string, value: string): HTMLElement {
    let shown = this.values.get(term);
    if (shown === undefined) {
      const name = document.createElement("dt");
      name.textContent = term;
      shown = document.createElement("dd");
      this.list.append(name, shown);
      this.values.set(term, shown);
    }
    setText(shown, value);
    return shown;
  }

  clear(): void {
    this.values.clear();
    this.list.replaceChildren();
  }
}
