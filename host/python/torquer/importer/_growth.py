"""Growth of regions voxel by voxel, from their surfaces. So the time grows with the region, not with the scan."""

from __future__ import annotations

from typing import Any, Iterable, List, Sequence

import numpy as np
import numpy.typing as npt

Flat = npt.NDArray[np.intp]
"""Indices into a raveled array."""


class Grid:
    """Flat indices of a volume with a border of one voxel, which stays empty."""

    def __init__(self, shape: Sequence[int]) -> None:
        self.shape = tuple(n + 2 for n in shape)
        _, rows, columns = self.shape
        steps = [(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1) if (a, b, c) != (0, 0, 0)]
        offsets = {step: (step[0] * rows + step[1]) * columns + step[2] for step in steps}
        self.by_faces = [offset for step, offset in offsets.items() if sum(n * n for n in step) == 1]
        self.by_edges = [offset for step, offset in offsets.items() if sum(n * n for n in step) <= 2]

    def bordered(self, values: Any, border: Any, dtype: Any) -> npt.NDArray[Any]:
        """A raveled copy with the border."""
        out = np.full(self.shape, border, dtype)
        out[1:-1, 1:-1, 1:-1] = values
        return out.ravel()

    def inner(self, flat: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The volume without its border, as a view."""
        return flat.reshape(self.shape)[1:-1, 1:-1, 1:-1]

    def at(self, index: Any) -> int:
        """Flat index of (column, row, slice) in the volume."""
        i, j, k = (int(n) + 1 for n in index)
        return (k * self.shape[1] + j) * self.shape[2] + i


def grow_once(front: Flat, offsets: Iterable[int], free: npt.NDArray[np.bool_]) -> Flat:
    """Takes the free neighbors of a front, and returns them; `free` is cleared there."""
    taken: List[Flat] = []
    for offset in offsets:
        near = front + offset
        near = near[free[near]]
        free[near] = False
        taken.append(near)
    return np.concatenate(taken)


def flood(starts: Flat, offsets: Sequence[int], free: npt.NDArray[np.bool_]) -> Flat:
    """All that is connected with the starts in `free`, which is cleared there. The starts must be free."""
    free[starts] = False
    parts = [starts]
    while len(parts[-1]):
        parts.append(grow_once(parts[-1], offsets, free))
    return np.concatenate(parts)


def within(grid: Grid, core: Flat, steps: int) -> npt.NDArray[np.bool_]:
    """Mask of the voxels within a number of steps of a core. Steps go by edges and by faces in turn."""
    free = grid.bordered(True, False, bool)
    free[core] = False
    mask = np.zeros(len(free), bool)
    mask[core] = True
    front = core
    for step in range(steps):
        front = grow_once(front, grid.by_faces if step % 2 else grid.by_edges, free)
        mask[front] = True
    return mask


def compete(first: Flat, second: Flat, free: npt.NDArray[np.bool_], offsets: Sequence[int]) -> List[Flat]:
    """Grows two regions in turn, step by step, into `free`; returns both with their cores."""
    free[first] = False
    free[second] = False
    regions = [[first], [second]]
    while any(len(region[-1]) for region in regions):
        for region in regions:
            region.append(grow_once(region[-1], offsets, free))
    return [np.concatenate(region) for region in regions]
