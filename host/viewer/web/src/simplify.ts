// Simplifies a surface to fewer triangles, for drawing without a graphics card.

/**
 * Returns corners of triangles, at most `most` if possible. Of the corners in a cell of a grid, the one nearest to
 * their mean replaces the others. So each vertex of the result is a vertex of the surface.
 */
export function fewerTriangles(verticesMm: Float32Array, triangles: Uint32Array, most: number): Uint32Array {
  if (triangles.length / 3 <= most) return triangles;
  // About two triangles remain for each cell on the surface.
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
