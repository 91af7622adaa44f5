// Diameter of a cylinder in a picture: its two edges, from a fit of the gray across it.

/** Gray at a distance across the vessel's course, px; the mean of `weight` pixels. */
export interface ProfilePoint {
  across: number;
  gray: number;
  weight: number;
}

/** Lengths in px. */
export interface CylinderFit {
  middle: number; // of the two edges, from the course
  diameter: number;
  diameterSd: number; // standard deviation, from the noise about the fit
  contrast: number; // gray at the middle, below that beside the vessel
  density: number; // gray per px of depth
  noise: number; // variance of a pixel's gray about the fit
  points: number;
  misfit: number; // sum of the squared residuals
}

/** Known density: value and standard deviation, and the variance of a pixel's gray. */
export interface Density {
  value: number;
  sd: number;
  noise: number;
}

const PARAMETERS = 5; // gray beside it, its slope, gray per px of depth, middle, radius
const MOST_STEPS = 30;
const LEAST_RADIUS = 0.3;

// Integral of the chord 2 sqrt(r^2 - x^2) of a circle from its middle to x.
function chordIntegral(x: number, r: number): number {
  const c = Math.min(Math.max(x, -r), r);
  return c * Math.sqrt(Math.max(r * r - c * c, 0)) + r * r * Math.asin(c / r);
}

// Focal spot and detector blur a picture by 1/4 1/2 1/4, and a pixel is the mean over its area. So a value is a sum of
// the chords' integral at four places.
const PLACES = [[-1.5, -0.25], [-0.5, -0.25], [0.5, 0.25], [1.5, 0.25]] as const;

// Depth of a cylinder that is seen at a distance from its axis, and its derivatives by distance and radius.
function seenDepth(across: number, radius: number): [number, number, number] {
  let [depth, byAcross, byRadius] = [0, 0, 0];
  for (const [step, weight] of PLACES) {
    const x = across + step;
    depth += weight * chordIntegral(x, radius);
    byAcross += weight * 2 * Math.sqrt(Math.max(radius * radius - x * x, 0));
    byRadius += weight * 2 * radius * Math.asin(Math.min(Math.max(x / radius, -1), 1));
  }
  return [depth, byAcross, byRadius];
}

/** Solves a symmetric positive system in place; returns its inverse, or null. */
function invert(matrix: number[][]): number[][] | null {
  const size = matrix.length;
  const rows = matrix.map((row, k) => [...row, ...row.map((_, j) => (j === k ? 1 : 0))]);
  for (let k = 0; k < size; ++k) {
    const pivot = rows[k]!;
    if (!(Math.abs(pivot[k]!) > 1e-12)) return null;
    const scale = 1 / pivot[k]!;
    for (let j = 0; j < 2 * size; ++j) pivot[j]! *= scale;
    for (const [i, row] of rows.entries()) {
      const factor = row[k]!;
      if (i === k || factor === 0) continue;
      for (let j = 0; j < 2 * size; ++j) row[j]! -= factor * pivot[j]!;
    }
  }
  return rows.map((row) => row.slice(size));
}

interface Normal {
  matrix: number[][];
  right: number[];
  squares: number; // weighted sum of the squared residuals
}

// Normal equations of the fit at these parameters.
function normalOf(profile: readonly ProfilePoint[], at: readonly number[], known: Density | null): Normal {
  const [beside, slope, density, middle, radius] = at as [number, number, number, number, number];
  const matrix = Array.from({ length: PARAMETERS }, () => new Array<number>(PARAMETERS).fill(0));
  const right = new Array<number>(PARAMETERS).fill(0);
  let squares = 0;
  for (const { across, gray, weight } of profile) {
    const [depth, byAcross, byRadius] = seenDepth(across - middle, radius);
    const residual = gray - (beside + slope * across - density * depth);
    const by = [1, across, -depth, density * byAcross, -density * byRadius];
    for (let i = 0; i < PARAMETERS; ++i) {
      right[i]! += weight * by[i]! * residual;
      for (let j = 0; j < PARAMETERS; ++j) matrix[i]![j]! += weight * by[i]! * by[j]!;
    }
    squares += weight * residual * residual;
  }
  if (known !== null) {
    const weight = known.noise / known.sd ** 2;
    matrix[2]![2]! += weight;
    right[2]! += weight * (known.value - density);
    squares += weight * (known.value - density) ** 2;
  }
  return { matrix, right, squares };
}

function stepFrom(at: readonly number[], { matrix, right }: Normal, damping: number): number[] | null {
  const inverse = invert(matrix.map((row, i) => row.map((value, j) => (i === j ? value * (1 + damping) + 1e-9 : value))));
  if (inverse === null) return null;
  const next = at.map((value, i) => value + inverse[i]!.reduce((sum, part, j) => sum + part * right[j]!, 0));
  next[4] = Math.max(next[4]!, LEAST_RADIUS);
  return next;
}

// Gray beside a vessel of this radius, its slope and density: the fit is linear in them.
function startOf(profile: readonly ProfilePoint[], radius: number): number[] {
  const outside = profile.filter(({ across }) => Math.abs(across) > radius + 1);
  const inside = profile.filter(({ across }) => Math.abs(across) < radius / 2 + 0.5);
  const mean = (points: readonly ProfilePoint[]) =>
    points.reduce((sum, one) => sum + one.weight * one.gray, 0) / Math.max(points.reduce((sum, one) => sum + one.weight, 0), 1e-9);
  const beside = mean(outside.length > 0 ? outside : profile);
  return [beside, 0, (beside - mean(inside.length > 0 ? inside : profile)) / (2 * radius), 0, radius];
}

/** Fits a cylinder with edges near `radius`. Null if the profile does not determine it. */
export function fitCylinder(profile: readonly ProfilePoint[], radius: number, known: Density | null = null): CylinderFit | null {
  if (profile.length < PARAMETERS + 3) return null;
  let at = startOf(profile, radius);
  if (known !== null) at[2] = known.value;
  let normal = normalOf(profile, at, known);
  let damping = 1e-2;
  for (let step = 0; step < MOST_STEPS && damping < 1e6; ++step) {
    const next = stepFrom(at, normal, damping);
    if (next === null) return null;
    const there = normalOf(profile, next, known);
    if (!(there.squares < normal.squares)) {
      damping *= 5;
      continue;
    }
    const gained = normal.squares - there.squares;
    [at, normal, damping] = [next, there, damping / 5];
    if (gained < 1e-5 * there.squares) break;
  }
  const noise = normal.squares / (profile.length - PARAMETERS);
  const variance = noise * (invert(normal.matrix)?.[4]?.[4] ?? NaN);
  const [, , density, middle, r] = at as [number, number, number, number, number];
  if (!(density > 0) || !(variance >= 0)) return null;
  const contrast = density * seenDepth(0, r)[0];
  return { middle, diameter: 2 * r, diameterSd: 2 * Math.sqrt(variance), contrast, density, noise, points: profile.length, misfit: normal.squares };
}
