"""Ways through a lumen that has no centerlines: along its middle, and the shortest."""

from __future__ import annotations

from typing import Any, List, Optional, Tuple

import numpy as np
import numpy.typing as npt

from .. import Scene
from .._polyline import resampled
from ._base import Error, Points, Values, as_text, as_tuple, need

_MARGIN_MM = 25.0
_MOST_PLACES, _FINEST_MM = 2_000_000, 0.5
_ROUNDS, _INSIDE_ROUNDS = 150, 60
_CHUNK = 500_000


class Lumen:
    """Grid of the places in a scene's lumen where the center of a wire can be.

    The grid covers the given points and a margin of 25 mm, within the bounds of the vessel. Its step
    is the cube root of a two-millionth of that volume, and at least 0.5 mm.
    """

    def __init__(self, scene: Scene, points: Points, radius_mm: float) -> None:
        self.scene, self.radius_mm = scene, radius_mm
        bounds = scene.bounds_mm
        low = np.maximum(bounds[0], points.min(axis=0) - _MARGIN_MM)
        size = np.maximum(np.minimum(bounds[1], points.max(axis=0) + _MARGIN_MM) - low, 1.0)
        self.step_mm = max(_FINEST_MM, float(np.cbrt(np.prod(size) / _MOST_PLACES)))
        counts = np.floor(size / self.step_mm).astype(int) + 1
        every = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1).reshape(-1, 3)
        depth = np.concatenate(
            [scene.clearance_mm(low + self.step_mm * every[k : k + _CHUNK]) for k in range(0, len(every), _CHUNK)]
        )
        inside = depth > radius_mm
        if not inside.any():
            raise Error(
                "no place of the lumen near the shapes has room for the wire; give the shapes in the frame and the unit "
                "of the scene's surface"
            )
        self.places: Points = low + self.step_mm * every[inside]
        self._depth: Values = depth[inside]
        numbers = np.full(counts, -1, np.int64)
        numbers.ravel()[inside] = np.arange(len(self.places))
        self._pairs = self._neighbors(numbers)
        self._graphs = {centered: self._graph(centered) for centered in (True, False)}
        self._tree = need("scipy.spatial").cKDTree(self.places)
        self._known: Tuple[int, bool, Optional[Tuple[Any, Any]]] = (-1, False, None)

    def __repr__(self) -> str:
        return f"Lumen(scene={self.scene.name!r}, places={len(self.places)}, step_mm={self.step_mm:.3g})"

    @staticmethod
    def _neighbors(numbers: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Pairs of places that touch by a side, an edge or a corner of their cells."""
        found: List[Any] = []
        for x, y, z in np.ndindex(3, 3, 3):
            if (x, y, z) <= (1, 1, 1):
                continue
            here, there = [], []
            for shift in (x - 1, y - 1, z - 1):
                here.append(slice(max(0, -shift), None if shift <= 0 else -shift))
                there.append(slice(max(0, shift), None if shift >= 0 else shift))
            a, b = numbers[tuple(here)].ravel(), numbers[tuple(there)].ravel()
            both = (a >= 0) & (b >= 0)
            found.append(np.stack([a[both], b[both]]))
        return np.concatenate(found, axis=1)

    def _graph(self, centered: bool) -> Any:
        """Costs between neighbors: length, or length over the square of the depth."""
        a, b = self._pairs
        cost = np.linalg.norm(self.places[a] - self.places[b], axis=1)
        if centered:
            cost = cost / ((self._depth[a] + self._depth[b]) / 2) ** 2
        return need("scipy.sparse").coo_matrix((cost, (a, b)), (len(self.places),) * 2).tocsr()

    def depth_mm(self, points: Points) -> Values:
        """Distance from the wall, positive in the lumen."""
        return self.scene.clearance_mm(points)

    def _slopes(self, points: Points) -> Points:
        """Gradient of the depth, over two steps of the grid."""
        steps = [self.depth_mm(points + self.step_mm * axis) - self.depth_mm(points - self.step_mm * axis) for axis in np.eye(3)]
        out: Points = np.stack(steps, axis=1) / (2 * self.step_mm)
        return out

    def moved_inside(self, point: Any) -> Tuple[float, float, float]:
        """The point, or a place near it at which the wire has 0.1 mm of room."""
        place = np.array(point, float)[None]
        for _ in range(_INSIDE_ROUNDS):
            lacking = self.radius_mm + 0.1 - float(self.depth_mm(place)[0])
            if lacking <= 0:
                return as_tuple(place[0])
            slope = self._slopes(place)
            size = float(np.linalg.norm(slope))
            if size < 1e-3:
                break
            place = place + lacking * slope / size
        return as_tuple(self.places[int(self._tree.query(point)[1])])

    def _from(self, start: Any, centered: bool) -> Tuple[Any, Any]:
        """Lengths or costs from a place to all others, and the place before each."""
        begin = int(self._tree.query(start)[1])
        if self._known[:2] != (begin, centered) or self._known[2] is None:
            search = need("scipy.sparse.csgraph").dijkstra
            found = search(self._graphs[centered], directed=False, indices=begin, return_predecessors=True)
            self._known = (begin, centered, found)
        known = self._known[2]
        assert known is not None
        return known

    def length_mm(self, start: Any, end: Any) -> float:
        """Length of the shortest way on the grid; infinite without a way."""
        costs, _ = self._from(start, False)
        return float(costs[int(self._tree.query(end)[1])])

    def way(self, start: Any, end: Any, centered: bool) -> Points:
        """Points from start to end, along the middle of the lumen, or by the shortest way.

        The way on the grid has the least sum of length over the square of the depth, or of length.
        It is then smoothed, and moved up the slope of the depth, or out of the wall.
        """
        costs, before = self._from(start, centered)
        at = int(self._tree.query(end)[1])
        if not np.isfinite(costs[at]):
            raise Error(
                f"no way through the lumen leads from {as_text(start)} to {as_text(end)} for a wire of radius "
                f"{self.radius_mm:g} mm; check frame and unit of the shape"
            )
        way = [at]
        while before[way[-1]] >= 0:
            way.append(int(before[way[-1]]))
        points = np.vstack([start, self.places[way[::-1]], end])
        for _ in range(_ROUNDS):
            points = resampled(points, 2 * self.step_mm)
            inner = points[1:-1] + 0.25 * (points[:-2] - 2 * points[1:-1] + points[2:])
            slope = self._slopes(inner)
            along = points[2:] - points[:-2]
            along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
            slope -= np.einsum("ij,ij->i", slope, along)[:, None] * along
            if centered:
                inner += 0.3 * self.step_mm * slope
            else:
                inner += np.maximum(self.radius_mm - self.depth_mm(inner), 0)[:, None] * slope
            points = np.vstack([points[:1], inner, points[-1:]])
        return points
