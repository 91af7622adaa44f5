// Diameters along a vessel filled with contrast agent, and its narrowing: quantitative coronary angiography (QCA).

import { fitCylinder, type CylinderFit, type Density, type ProfilePoint } from "./cylinder_fit.js";
import { courseOf, evenly, smooth, type Gray, type Point } from "./vessel_course.js";

/** Edges of the vessel at a place of its course, px. */
export interface Station {
  at: Point; // middle of both edges
  edges: [Point, Point];
  fit: CylinderFit;
}

/** A length and its error for 95 %, px. */
export interface Length {
  px: number;
  error: number;
}

export interface VesselSize {
  stations: Station[];
  least: Length;
  reference: Length; // diameter of the healthy vessel at the same place
  narrowest: number; // index of the station with the least diameter
  lengthPx: number;
}

const ROWS = 1.5; // px along the course, on both sides, that share a profile
const [BLACKEST, WHITEST] = [2, 253];
const WIDEST = 80; // px to both sides at first
const FIRST_RADII = [1.2, 2.5, 5, 10, 20, 40];
const LEAST_CONTRAST = 8; // grays
const LEAST_WIDTH_PX = 2.5; // a thinner vessel has no two edges in a picture
const LEAST_STATIONS = 12;
const MOST_GAP = 4; // stations in a row without a fit
const HEALTHY_PART = 0.3; // least part of the stations that determines the reference
const DENSITY_SPREAD = 0.1; // relative standard deviation of the density between places of a vessel
// A parabola of the diameters of so many stations on both sides, or of this part of a diameter.
const LEAST_REACH = 5;
const REACH_PART = 0.75;
// Errors for 95 %, against cylinders of known diameter. The least of many diameters is too small by their noise.
const Z = 1.96;
const LEAST_Z = 2 * Z;
const REFERENCE_ERROR_PX = 0.15;
const LEAST_ERROR_PX = 0.3;

/** Means of grays at distances across a course. */
class Bins {
  private readonly bins = new Map<number, ProfilePoint>(); // with sums in place of means

  constructor(private readonly widthPx: number) {}

  add(across: number, gray: number): void {
    const key = Math.round(across / this.widthPx);
    const bin = this.bins.get(key);
    if (bin === undefined) {
      this.bins.set(key, { across, gray, weight: 1 });
      return;
    }
    bin.across += across;
    bin.gray += gray;
    ++bin.weight;
  }

  profile(): ProfilePoint[] {
    return [...this.bins.values()].map(({ across, gray, weight }) => ({ across: across / weight, gray: gray / weight, weight }));
  }
}

// Adds the pixels near a point of the course. Black and white ones may be clipped, or lie under a shutter.
function addAcross(bins: Bins, gray: Gray, [x, y]: Point, [dx, dy]: Point, half: number): void {
  const [reachX, reachY] = [Math.abs(dy) * half + ROWS, Math.abs(dx) * half + ROWS];
  const [left, right] = [Math.max(Math.ceil(x - reachX), 0), Math.min(Math.floor(x + reachX), gray.width - 1)];
  const [top, bottom] = [Math.max(Math.ceil(y - reachY), 0), Math.min(Math.floor(y + reachY), gray.height - 1)];
  for (let row = top; row <= bottom; ++row) {
    for (let column = left; column <= right; ++column) {
      const along = (column - x) * dx + (row - y) * dy;
      const across = (row - y) * dx - (column - x) * dy;
      const value = gray.value[row * gray.width + column]!;
      if (Math.abs(along) <= ROWS && Math.abs(across) <= half && value >= BLACKEST && value <= WHITEST) bins.add(across, value);
    }
  }
}

function directions(course: readonly Point[]): Point[] {
  const REACH = 4;
  return course.map((_, k) => {
    const [from, to] = [course[Math.max(k - REACH, 0)]!, course[Math.min(k + REACH, course.length - 1)]!];
    const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
    return length > 0 ? [(to[0] - from[0]) / length, (to[1] - from[1]) / length] : [1, 0];
  });
}

const median = (values: readonly number[]) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)]!;

/** Radius that fits the mean of all profiles best. */
function typicalRadius(gray: Gray, course: readonly Point[]): number | null {
  const ways = directions(course);
  const bins = new Bins(1);
  for (const [k, at] of course.entries()) if (k % 3 === 0) addAcross(bins, gray, at, ways[k]!, WIDEST);
  const profile = bins.profile();
  let best: { radius: number; misfit: number } | null = null;
  for (const radius of FIRST_RADII) {
    const near = profile.filter(({ across }) => Math.abs(across) < 2 * radius + 6);
    const fit = fitCylinder(near, radius);
    if (fit === null || fit.contrast < LEAST_CONTRAST / 2 || Math.abs(fit.middle) > radius + 3) continue;
    const misfit = fit.misfit / near.reduce((sum, { weight }) => sum + weight, 0) / fit.contrast ** 2;
    if (best === null || misfit < best.misfit) best = { radius: fit.diameter / 2, misfit };
  }
  return best?.radius ?? null;
}

// Fits of all places of a course; null for a place without a fit.
function fitAll(gray: Gray, course: readonly Point[], radius: number, known: Density | null): (Station | null)[] {
  const ways = directions(course);
  const half = 1.7 * radius + 6;
  return course.map((at, k) => {
    const [dx, dy] = ways[k]!;
    const bins = new Bins(0.5);
    addAcross(bins, gray, at, [dx, dy], half);
    const fit = fitCylinder(bins.profile(), radius, known);
    if (fit === null || fit.contrast < LEAST_CONTRAST || Math.abs(fit.middle) > half / 2 || fit.diameter > 2 * half) return null;
    const across = (distance: number): Point => [at[0] - dy * distance, at[1] + dx * distance];
    const edge = (side: number) => across(fit.middle + (side * fit.diameter) / 2);
    return { at: across(fit.middle), edges: [edge(-1), edge(1)], fit };
  });
}

function present(stations: readonly (Station | null)[]): Station[] {
  return stations.filter((station) => station !== null);
}

// Number of places in a row without a fit.
function longestGap(stations: readonly (Station | null)[]): number {
  let [longest, now] = [0, 0];
  for (const station of stations) longest = Math.max(longest, (now = station === null ? now + 1 : 0));
  return longest;
}

// The blood of a vessel is mixed across and along a short part of it. So the typical density is nearly that of each place.
function densityOf(stations: readonly Station[]): Density {
  const value = median(stations.map(({ fit }) => fit.density));
  return { value, sd: DENSITY_SPREAD * value, noise: median(stations.map(({ fit }) => fit.noise)) };
}

// Value at place k of the parabola through the places near it. Unlike a mean it does not fill a narrowing.
function parabolaAt(values: readonly number[], k: number, most: number): number {
  const reach = Math.min(most, k, values.length - 1 - k);
  if (reach < 2) return values.slice(Math.max(k - 2, 0), k + 3).reduce((sum, value, _, all) => sum + value / all.length, 0);
  let [fourth, second, zeroth, sum, moment] = [0, 0, 0, 0, 0];
  for (let i = -reach; i <= reach; ++i) {
    zeroth += 1;
    second += i ** 2;
    fourth += i ** 4;
    sum += values[k + i]!;
    moment += i ** 2 * values[k + i]!;
  }
  return (fourth * sum - second * moment) / (fourth * zeroth - second ** 2);
}

// Line through the diameters of the healthy part: narrow places are left out again and again.
function healthyLine(diameters: readonly number[], sd: number, reach: number): { at: (k: number) => number; sd: number } | null {
  let used = diameters.map((_, k) => k);
  for (let round = 0; ; ++round) {
    const n = used.length;
    if (n < Math.max(HEALTHY_PART * diameters.length, 4)) return null;
    const meanK = used.reduce((sum, k) => sum + k, 0) / n;
    const mean = used.reduce((sum, k) => sum + diameters[k]!, 0) / n;
    const spread = used.reduce((sum, k) => sum + (k - meanK) ** 2, 0);
    const slope = used.reduce((sum, k) => sum + (k - meanK) * (diameters[k]! - mean), 0) / spread;
    const at = (k: number) => mean + slope * (k - meanK);
    const rms = Math.sqrt(used.reduce((sum, k) => sum + (diameters[k]! - at(k)) ** 2, 0) / n);
    const kept = diameters.flatMap((value, k) => (value > at(k) - Math.max(1.5 * rms, 2 * sd) ? [k] : []));
    if (round === 12 || (kept.length === used.length && kept.every((k, i) => k === used[i]))) {
      return { at, sd: Math.max(rms, sd) / Math.sqrt(Math.max(n / (2 * ROWS + reach), 1)) };
    }
    used = kept;
  }
}

/** Size of the dark vessel between two points, or the reason why it has none. */
export function measureVessel(gray: Gray, from: Point, to: Point): VesselSize | string {
  const course = courseOf(gray, from, to);
  if (course.length < LEAST_STATIONS) return "the points are too close to each other";
  const first = typicalRadius(gray, course);
  const found = first === null ? [] : present(fitAll(gray, course, first, null));
  if (found.length < LEAST_STATIONS || found.length < course.length / 2) return "no dark vessel between the points";
  const middle = evenly(smooth(smooth(found.map(({ at }) => at), 4), 4));
  const all = fitAll(gray, middle, median(found.map(({ fit }) => fit.diameter)) / 2, densityOf(found));
  const stations = present(all);
  if (longestGap(all) > MOST_GAP || stations.length < LEAST_STATIONS) return "a part between the points is too faint";
  return sizeOf(stations, middle.length - 1);
}

function sizeOf(stations: Station[], lengthPx: number): VesselSize | string {
  const raw = stations.map(({ fit }) => fit.diameter);
  const reach = Math.max(LEAST_REACH, Math.round(REACH_PART * median(raw)));
  const diameters = raw.map((_, k) => parabolaAt(raw, k, reach));
  // In the middle of a parabola through n independent values the variance is 9 / (4 n) of one. Neighbors share pixels.
  const part = Math.min(1.5 / Math.sqrt((2 * reach + 1) / (2 * ROWS)), 1);
  const sds = stations.map(({ fit }) => part * fit.diameterSd);
  if (median(diameters) < LEAST_WIDTH_PX) return "the vessel is too thin for this field";
  const healthy = healthyLine(diameters, median(sds), reach);
  if (healthy === null) return "no healthy part between the points";
  const narrowest = diameters.indexOf(Math.min(...diameters));
  return {
    stations,
    narrowest,
    least: { px: diameters[narrowest]!, error: LEAST_Z * sds[narrowest]! + LEAST_ERROR_PX },
    reference: { px: healthy.at(narrowest), error: Z * healthy.sd + REFERENCE_ERROR_PX },
    lengthPx,
  };
}
