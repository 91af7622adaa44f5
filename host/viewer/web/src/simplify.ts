// A surface of fewer triangles, for who must draw without a graphics card.

/**
 * The corners of triangles, at most `most` of them where that can be: corners that share a cell of a
 * grid become the one of them that is nearest to their middle, so that vertices stay what they are.
 */
export function fewerTriangles(verticesMm: Float32Array, triangles: Uint32Array, most: number): Uint32Array {
  if (triangles.length / 3 <= most) return triangles;
  // Two triangles for each cell that the surface goes through, or some more.
  let sideMm = Math.sqrt((2 * area(verticesMm, triangles)) / most);
  let fewer = triangles;
  for (; fewer.length / 3 > most; sideMm *= 1.15) fewer = merged(verticesMm, triangles, sideMm);
  return fewer;
}

function area(at: Float32Array, triangles: Uint32Array): number {
  let twice = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t]!, 3 * triangles[t + 1]!, 3 * triangles[t + 2]!];
    const [ux, uy, uz] = [at[b]! - at[a]!, at[b + 1]! - at[a + 1]!, at[b + 2]! - at[a + 2]!];
    const [vx, vy, vz] = [at[c]! - at[a]!, at[c + 1]! - at[a + 1]!, at[c + 2]! - at[a + 2]!];
    twice += Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
  }
  return twice / 2;
}

function merged(at: Float32Array, triangles: Uint32Array, sideMm: number): Uint32Array {
  const count = at.length / 3;
  const cellOf = new Uint32Array(count);
  const cells = new Map<string, number>();
  const sums: number[] = []; // x, y, z and how many
  for (let i = 0; i < count; ++i) {
    const key = [0, 1, 2].map((axis) => Math.floor(at[3 * i + axis]! / sideMm)).join();
    let cell = cells.get(key);
    if (cell === undefined) {
      cell = cells.size;
      cells.set(key, cell);
      sums.push(0, 0, 0, 0);
    }
    cellOf[i] = cell;
    for (let axis = 0; axis < 3; ++axis) sums[4 * cell + axis]! += at[3 * i + axis]!;
    ++sums[4 * cell + 3]!;
  }
  const [chosen, nearest] = [new Uint32Array(cells.size), new Float64Array(cells.size).fill(Infinity)];
  for (let i = 0; i < count; ++i) {
    const cell = cellOf[i]!;
    const share = sums[4 * cell + 3]!;
    const distance = Math.hypot(...[0, 1, 2].map((axis) => at[3 * i + axis]! - sums[4 * cell + axis]! / share));
    if (distance >= nearest[cell]!) continue;
    nearest[cell] = distance;
    chosen[cell] = i;
  }
  const kept: number[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [cellOf[triangles[t]!]!, cellOf[triangles[t + 1]!]!, cellOf[triangles[t + 2]!]!];
    if (a !== b && b !== c && c !== a) kept.push(chosen[a]!, chosen[b]!, chosen[c]!);
  }
  return Uint32Array.from(kept);
}
