// Course of a dark vessel between two points of a picture.

export interface Gray {
  width: number;
  height: number;
  value: Uint8ClampedArray; // row by row
}

export type Point = [number, number]; // column, row; (0, 0) is the middle of the first pixel

const MARGIN = 60; // px around both points, in which the course may lie
const NEAR = 2; // px: half the side of the square that is the vessel, and of that beside it
const FAR = 40;
const DARK = 8; // grays: a way along pixels that are so much darker costs 1/e
const LEAST_COST = 0.02;

/** Sums of grays over rectangles. */
class Sums {
  private readonly sums: Float64Array;

  constructor(private readonly gray: Gray) {
    const { width, height, value } = gray;
    this.sums = new Float64Array((width + 1) * (height + 1));
    for (let row = 0; row < height; ++row) {
      let sum = 0;
      for (let column = 0; column < width; ++column) {
        sum += value[row * width + column]!;
        this.sums[(row + 1) * (width + 1) + column + 1] = this.sums[row * (width + 1) + column + 1]! + sum;
      }
    }
  }

  mean(column: number, row: number, half: number): number {
    const { width, height } = this.gray;
    const [left, right] = [Math.max(column - half, 0), Math.min(column + half + 1, width)];
    const [top, bottom] = [Math.max(row - half, 0), Math.min(row + half + 1, height)];
    const at = (x: number, y: number) => this.sums[y * (width + 1) + x]!;
    return (at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top)) / ((right - left) * (bottom - top));
  }
}

/** Smallest first. */
class Heap {
  private readonly keys: number[] = [];
  private readonly items: number[] = [];

  get empty(): boolean {
    return this.keys.length === 0;
  }

  push(key: number, item: number): void {
    let at = this.keys.length;
    for (let parent; at > 0 && this.keys[(parent = (at - 1) >> 1)]! > key; at = parent) this.move(parent, at);
    this.put(at, key, item);
  }

  pop(): number {
    const first = this.items[0]!;
    const [key, item] = [this.keys.pop()!, this.items.pop()!];
    const size = this.keys.length;
    if (size === 0) return first;
    let at = 0;
    for (let child; (child = 2 * at + 1) < size; at = child) {
      if (child + 1 < size && this.keys[child + 1]! < this.keys[child]!) ++child;
      if (this.keys[child]! >= key) break;
      this.move(child, at);
    }
    this.put(at, key, item);
    return first;
  }

  private move(from: number, to: number): void {
    this.put(to, this.keys[from]!, this.items[from]!);
  }

  private put(at: number, key: number, item: number): void {
    this.keys[at] = key;
    this.items[at] = item;
  }
}

const NEIGHBORS: readonly Point[] = [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]];

// Cheapest way over the pixels between both points (Dijkstra); dark pixels are cheap.
function cheapestWay(gray: Gray, from: Point, to: Point): Point[] {
  const sums = new Sums(gray);
  const left = Math.max(Math.min(from[0], to[0]) - MARGIN, 0);
  const top = Math.max(Math.min(from[1], to[1]) - MARGIN, 0);
  const columns = Math.min(Math.max(from[0], to[0]) + MARGIN + 1, gray.width) - left;
  const rows = Math.min(Math.max(from[1], to[1]) + MARGIN + 1, gray.height) - top;
  const costs = new Float64Array(columns * rows);
  for (let i = 0; i < costs.length; ++i) {
    const [column, row] = [left + (i % columns), top + Math.floor(i / columns)];
    costs[i] = LEAST_COST + Math.min(Math.exp((sums.mean(column, row, NEAR) - sums.mean(column, row, FAR)) / DARK), 2);
  }
  const index = ([column, row]: Point) => (row - top) * columns + column - left;
  const best = new Float64Array(columns * rows).fill(Infinity);
  const before = new Int32Array(columns * rows).fill(-1);
  const heap = new Heap();
  const [start, end] = [index(from), index(to)];
  best[start] = 0;
  heap.push(0, start);
  const done = new Uint8Array(columns * rows);
  while (!heap.empty && done[end] === 0) {
    const here = heap.pop();
    if (done[here] !== 0) continue;
    done[here] = 1;
    const [x, y] = [here % columns, Math.floor(here / columns)];
    for (const [dx, dy] of NEIGHBORS) {
      if (x + dx < 0 || x + dx >= columns || y + dy < 0 || y + dy >= rows) continue;
      const next = here + dy * columns + dx;
      const cost = best[here]! + (Math.hypot(dx, dy) * (costs[here]! + costs[next]!)) / 2;
      if (cost >= best[next]!) continue;
      best[next] = cost;
      before[next] = here;
      heap.push(cost, next);
    }
  }
  const way: Point[] = [];
  for (let here = end; here >= 0; here = before[here]!) way.push([left + (here % columns), top + Math.floor(here / columns)]);
  return way.reverse();
}

/** Mean of each point and its neighbors up to `half` places away; fewer at the ends, as many on both sides. */
export function smooth(way: readonly Point[], half: number): Point[] {
  return way.map((_, k) => {
    const reach = Math.min(half, k, way.length - 1 - k);
    const near = way.slice(k - reach, k + reach + 1);
    return [near.reduce((sum, [x]) => sum + x, 0) / near.length, near.reduce((sum, [, y]) => sum + y, 0) / near.length];
  });
}

/** Points of a way at distances of 1 px along it. */
export function evenly(way: readonly Point[]): Point[] {
  const points: Point[] = [way[0]!];
  let left = 1; // to the next point
  for (let k = 1; k < way.length; ++k) {
    const [[x, y], [toX, toY]] = [way[k - 1]!, way[k]!];
    const length = Math.hypot(toX - x, toY - y);
    for (; left <= length; ++left) points.push([x + ((toX - x) * left) / length, y + ((toY - y) * left) / length]);
    left -= length;
  }
  return points;
}

/** Course of the vessel between two points, at distances of 1 px. */
export function courseOf(gray: Gray, from: Point, to: Point): Point[] {
  const inside = ([x, y]: Point): Point => [
    Math.min(Math.max(Math.round(x), 0), gray.width - 1), Math.min(Math.max(Math.round(y), 0), gray.height - 1),
  ];
  return evenly(smooth(smooth(cheapestWay(gray, inside(from), inside(to)), 5), 5));
}
