// History of a figure: its name, its newest value, and a plot of the last minute.

import uPlot from "uplot";
import { setText } from "./dom.js";

const SPAN_S = 60;
const SAMPLES = 240; // four a second
const HEIGHT_PX = 48;
const AXIS_PX = 46;

export interface Figure {
  title: string;
  unit: string; // with its leading space; "" if the figure has no unit
  shown: (value: number) => string;
  logarithmic?: boolean;
}

/** Range from 0 to the next round number above the largest value. */
function linearRange(largest: number): [number, number] {
  if (!(largest > 0)) return [0, 1];
  const decade = 10 ** Math.floor(Math.log10(largest));
  const step = [1, 2, 5, 10].find((factor) => factor * decade >= largest) ?? 10;
  return [0, step * decade];
}

/** Range of whole decades around all values above 0. */
function decades(smallest: number, largest: number): [number, number] {
  if (!(smallest > 0)) return [1e-9, 1];
  return [10 ** Math.floor(Math.log10(smallest)), 10 ** Math.max(Math.ceil(Math.log10(largest)), Math.floor(Math.log10(smallest)) + 1)];
}

export class History {
  readonly root = document.createElement("div");
  private readonly value = document.createElement("b");
  private readonly plot: uPlot;
  private readonly times: number[] = [];
  private readonly values: (number | null)[] = [];

  constructor(private readonly figure: Figure) {
    this.root.className = "history";
    this.root.setAttribute("role", "group");
    this.root.setAttribute("aria-label", figure.title);
    const head = document.createElement("div");
    const name = document.createElement("span");
    name.textContent = figure.title;
    head.append(name, this.value);
    const place = document.createElement("div");
    this.root.append(head, place);
    this.plot = new uPlot(this.options(), [[], []], place);
    new ResizeObserver(() => this.plot.setSize({ width: place.clientWidth, height: HEIGHT_PX })).observe(place);
  }

  /** Adds a value. NaN: unknown, drawn as a gap. */
  add(nowS: number, value: number): void {
    const known = Number.isFinite(value) && !(this.figure.logarithmic === true && value <= 0);
    setText(this.value, Number.isFinite(value) ? `${this.figure.shown(value)}${this.figure.unit}` : "–");
    this.times.push(nowS);
    this.values.push(known ? value : null);
    if (this.times.length > SAMPLES) {
      this.times.shift();
      this.values.shift();
    }
    this.plot.setData([this.times.map((time) => time - nowS), this.values]);
  }

  /** For tests: the values of the last minute, oldest first. */
  get kept(): readonly (number | null)[] {
    return this.values;
  }

  private options(): uPlot.Options {
    const range = (): [number, number] => {
      const known = this.values.filter((value) => value !== null);
      const largest = Math.max(0, ...known);
      return this.figure.logarithmic === true ? decades(Math.min(...known, largest), largest) : linearRange(largest);
    };
    return {
      width: 200, height: HEIGHT_PX, cursor: { show: false }, legend: { show: false }, padding: [8, 4, 8, 0],
      scales: {
        x: { time: false, range: [-SPAN_S, 0] },
        y: { distr: this.figure.logarithmic === true ? 3 : 1, range },
      },
      axes: [
        { show: false },
        {
          size: AXIS_PX, font: "12px system-ui, sans-serif", stroke: "#93a3af", ticks: { show: false }, gap: 4,
          grid: { stroke: "#2a343d", width: 1 },
          splits: (_plot, _axis, min, max) => [min, max],
          filter: (_plot, splits) => splits,
          values: (_plot, splits) => splits.map((value) => (this.figure.logarithmic === true ? value.toExponential(0).replace("-", "−") : String(Number(value.toPrecision(3))))),
        },
      ],
      series: [{}, { stroke: "#8fd3ff", width: 1.5, fill: "#8fd3ff1c", points: { show: false }, spanGaps: false }],
    };
  }
}
