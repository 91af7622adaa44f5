"""Centerlines of a closed surface: medial graph, shortest paths, a tree that covers the lumen, centering.

    curves = torquer.importer.centerlines.find(mesh)
    curves[0]    from the root to the farthest tip; each other one begins on its parent

The nodes of the graph are circumcenters of a Delaunay triangulation of points on the surface. VMTK does the same
(Antiga et al., IEEE Trans. Med. Imaging 22:674, 2003). Edges join neighboring nodes. Ways are shortest for the length
over the squared radius.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
from typing import Any, List, Optional, Sequence, Tuple

import numpy as np
import numpy.typing as npt

from .._polyline import arcs_of, resampled
from ..export import slicer_curve
from ._base import Error, Points, as_text, need
from .surface import Mesh, part_at

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

# Points on the surface: their number, and their distance by the ratio of volume to area, within limits.
_MOST_POINTS, _STEP_SHARE, _STEPS_MM = 20_000, 0.3, (0.4, 1.0)
_WIDEST_MM = 60.0
# Distance of a tip's generating points, in radii. A tip with less is only a sliver beside the wall.
_APART = 1.2
# A branch covers _COVER radii and _COVER_MM about itself. A curve's free part is farther than _OUTSIDE radii from the
# other curves. A curve is kept if its free part is longer than _LEAST_RADII radii and _LEAST_MM.
_COVER, _COVER_MM = 1.3, 2.0
_OUTSIDE, _LEAST_RADII, _LEAST_MM = 1.15, 2.5, 3.0
_MOST_CURVES = 200
# A point outside of the lumen moves _BACK_MM into it.
_ROUNDS, _PUSH, _SMOOTHING, _BACK_MM = 80, 0.3, 0.35, 0.1
STEP_MM = 1.0
"""Distance of a curve's points."""
LEVEL_MM = 2.0
"""Tips whose heights differ by less are equally low."""
# A branch lies on its parent's line within this share of its radius.
_ON_LINE = 0.25
# A path ends in a corner of a flat end. Its end is cut where the radius is below this share of that before.
_END_SHARE = 0.75
_ROOT_MM = 20.0
# Tips this near to the widest are as wide as it. Sampling changes the means by less.
_AS_WIDE = 0.95
_NO_LINE = "no centerline was found in the surface; is it a vessel longer than it is wide?"


@dataclasses.dataclass
class Curve:
    """A centerline from its start, the root or a place on its parent, to its tip."""

    name: str
    points: Points
    """Shape (n, 3), mm."""
    radii: Floats
    """Shape (n,), mm: distance to the wall; within the parent's lumen at most that where it leaves it."""
    parent: Optional[int]

    def lengths_mm(self) -> Floats:
        """Arc length of each point."""
        return arcs_of(self.points)


def sample(mesh: Mesh, step_mm: float, seed: int = 1) -> Tuple[Points, Points]:
    """Points on the surface about step_mm apart, and the outward unit normals there."""
    vectors = mesh.area_vectors()
    areas = np.linalg.norm(vectors, axis=1)
    counts = np.ceil(3 * areas / step_mm**2).astype(int)
    which = np.repeat(np.arange(len(areas)), counts)
    random = np.random.default_rng(seed)
    a, b = random.random((2, len(which)))
    flip = a + b > 1
    a[flip], b[flip] = 1 - a[flip], 1 - b[flip]
    corners = mesh.corners()[which]
    points = corners[:, 0] + a[:, None] * (corners[:, 1] - corners[:, 0]) + b[:, None] * (corners[:, 2] - corners[:, 0])
    _, first = np.unique(np.floor(points / step_mm).astype(np.int64), axis=0, return_index=True)
    chosen = which[first]
    return points[first], vectors[chosen] / np.maximum(areas[chosen], 1e-30)[:, None]


def _step_mm(mesh: Mesh) -> float:
    """Distance of points on the surface that show its narrow vessels."""
    area = float(np.linalg.norm(mesh.area_vectors(), axis=1).sum())
    fine_mm = float(np.clip(_STEP_SHARE * abs(mesh.volume_mm3()) / area, *_STEPS_MM))
    return max(fine_mm, float(np.sqrt(area / _MOST_POINTS)))


def wall_of(mesh: Mesh) -> Points:
    """Points on the surface, dense enough for the distance from a centerline to the wall."""
    return _Wall(mesh).points


class _Wall:
    """Points on the surface, as in wall_of, with outward normals."""

    def __init__(self, mesh: Mesh) -> None:
        points, normals = sample(mesh, _step_mm(mesh) / 2)
        corners = np.zeros_like(mesh.points)
        for corner in range(3):
            np.add.at(corners, mesh.triangles[:, corner], mesh.area_vectors())
        corners /= np.maximum(1e-30, np.linalg.norm(corners, axis=1))[:, None]
        self.points = np.vstack([points, mesh.points])
        self._normals = np.vstack([normals, corners])
        self._tree = need("scipy.spatial").cKDTree(self.points)

    def distances(self, points: Points) -> Floats:
        """Distances to the wall."""
        out: Floats = self._tree.query(points)[0]
        return out

    def inward(self, points: Points) -> Tuple[Floats, Points]:
        """Depth in the lumen, negative outside, and the unit direction away from the wall, into the lumen."""
        distances, number = self._tree.query(points)
        off = points - self.points[number]
        side = np.where(np.einsum("ij,ij->i", off, self._normals[number]) > 0, -1.0, 1.0)
        return side * distances, side[:, None] * off / np.maximum(1e-9, distances)[:, None]


class _Graph:
    """Medial graph within a surface."""

    def __init__(self, points: Points, normals: Points) -> None:
        spatial = need("scipy.spatial")
        tetrahedra = spatial.Delaunay(points)
        corners = points[tetrahedra.simplices]
        edges = corners[:, 1:] - corners[:, :1]
        volume = np.abs(np.linalg.det(edges))
        solvable = volume > 1e-9
        centers = np.full((len(corners), 3), np.nan)
        half = np.einsum("nij,nij->ni", edges, edges)[solvable] / 2
        centers[solvable] = np.linalg.solve(edges[solvable], half[..., None])[..., 0] + corners[solvable, 0]
        off = corners - centers[:, None]
        radii = np.linalg.norm(off[:, 0], axis=1)
        outward = np.einsum("nij,nij->ni", off, normals[tetrahedra.simplices])
        with np.errstate(invalid="ignore"):
            inside = (outward > 0.1 * radii[:, None]).all(axis=1) & (radii < _WIDEST_MM)
        pairs = self._pairs(tetrahedra.neighbors, inside)
        number = np.full(len(corners), -1)
        number[inside] = np.arange(np.count_nonzero(inside))
        self.points, self.radii = centers[inside], radii[inside]
        widths = np.linalg.norm(corners[inside][:, :, None] - corners[inside][:, None], axis=3).max(axis=(1, 2))
        self.is_deep = widths > _APART * self.radii
        self._keep_largest(number[pairs])

    @staticmethod
    def _pairs(neighbors: Any, inside: Any) -> Any:
        first = np.repeat(np.arange(len(neighbors)), 4)
        pairs = np.column_stack([first, neighbors.ravel()])
        pairs = pairs[(pairs[:, 0] < pairs[:, 1])]
        return pairs[inside[pairs].all(axis=1)]

    def _keep_largest(self, pairs: Any) -> None:
        sparse, csgraph = need("scipy.sparse"), need("scipy.sparse.csgraph")
        count = len(self.points)
        if count == 0:
            raise Error("the surface encloses no lumen; check that it is closed, and its normals")
        lengths = np.maximum(1e-9, np.linalg.norm(self.points[pairs[:, 0]] - self.points[pairs[:, 1]], axis=1))
        joined = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), (count, count))
        _, part = csgraph.connected_components(joined, directed=False)
        kept = part == np.bincount(part).argmax()
        number = np.cumsum(kept) - 1
        within = kept[pairs[:, 0]]
        self.pairs = number[pairs[within]]
        self.lengths = lengths[within]
        self.points, self.radii, self.is_deep = self.points[kept], self.radii[kept], self.is_deep[kept]
        narrow = self.radii[self.pairs].min(axis=1)
        count = len(self.points)
        self._costs = sparse.coo_matrix((self.lengths / narrow**2, self.pairs.T), (count, count)).tocsr()

    def tree(self, root: int) -> Tuple[Indices, Floats]:
        """Predecessor of each node on the way from the root, and the way's length, mm."""
        costs, before = need("scipy.sparse.csgraph").dijkstra(
            self._costs, directed=False, indices=root, return_predecessors=True
        )
        lengths = np.zeros(len(costs))
        steps = np.linalg.norm(self.points - self.points[np.maximum(before, 0)], axis=1)
        for node in np.argsort(costs, kind="stable"):
            if before[node] >= 0:
                lengths[node] = lengths[before[node]] + steps[node]
        return before, lengths


def _branches(graph: _Graph, root: int) -> List[Tuple[Indices, Optional[int]]]:
    """Nodes of each branch, from its place on an earlier one (or the root) to its tip. Also that earlier branch."""
    spatial = need("scipy.spatial")
    before, lengths = graph.tree(root)
    nodes = spatial.cKDTree(graph.points)
    open_ = graph.is_deep.copy()
    owner = np.full(len(graph.points), -1)
    found: List[Tuple[Indices, Optional[int]]] = []
    kept = np.zeros(0, np.intp)
    while open_.any() and len(found) < _MOST_CURVES:
        tip = int(np.where(open_, lengths, -1).argmax())
        way = [tip]
        while owner[way[-1]] < 0 and before[way[-1]] >= 0:
            way.append(int(before[way[-1]]))
        path = np.array(way[::-1], np.intp)
        parent = int(owner[path[0]]) if owner[path[0]] >= 0 else None
        if _is_branch(graph, path, kept):
            own = path if parent is None else path[1:]
            owner[own] = len(found)
            found.append((path, parent))
            kept = np.concatenate([kept, own])
        thin = _thinned(graph, path)
        near = nodes.query_ball_point(graph.points[thin], _COVER * graph.radii[thin] + _COVER_MM)
        open_[np.concatenate([np.array(some, np.intp) for some in near])] = False
        open_[tip] = False
    return found


def _thinned(graph: _Graph, path: Indices) -> Indices:
    """Nodes of a path that lie at least half a radius apart, and its tip; their balls cover it."""
    out = [int(path[0])]
    for node in path[1:]:
        if np.linalg.norm(graph.points[node] - graph.points[out[-1]]) > graph.radii[node] / 2:
            out.append(int(node))
    return np.array([*out, int(path[-1])], np.intp)


def _is_branch(graph: _Graph, path: Indices, kept: Indices) -> bool:
    if len(path) < 2:
        return False
    points, radii = graph.points[path], graph.radii[path]
    outside = np.ones(len(path), bool)
    if len(kept):
        # Nearest nodes of the tree; its nodes lie denser than their radii.
        distances, nearest = need("scipy.spatial").cKDTree(graph.points[kept]).query(points, k=min(8, len(kept)))
        distances, nearest = distances.reshape(len(path), -1), nearest.reshape(len(path), -1)
        outside = (distances > _OUTSIDE * graph.radii[kept[nearest]]).all(axis=1)
    if not outside.any():
        return False
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(steps[outside[1:]].sum())
    return length > max(_LEAST_RADII * float(radii[outside].max()), _LEAST_MM)


def _tips(graph: _Graph) -> Tuple[Indices, Floats]:
    """Nodes at the tips of all branches, and the mean radius of each branch over its last 20 mm."""
    if not graph.is_deep.any():
        raise Error(_NO_LINE)
    widest = int(np.where(graph.is_deep, graph.radii, 0).argmax())
    _, lengths = graph.tree(widest)
    # The farthest place is a tip, and so the ways from it end in all the others.
    found = _branches(graph, int(np.where(graph.is_deep, lengths, -1).argmax()))
    if not found:
        raise Error(_NO_LINE)
    paths = [found[0][0][::-1], *(path for path, _ in found)]
    means = []
    for path in paths:
        back = np.linalg.norm(graph.points[path] - graph.points[path[-1]], axis=1)
        last = (back < _ROOT_MM) & (back >= min(5.0, back.max() / 2))
        means.append(float(graph.radii[path][last if last.any() else slice(None)].mean()))
    return np.array([path[-1] for path in paths], np.intp), np.array(means)


def _root(graph: _Graph, root_mm: Optional[Any], notes: List[str]) -> int:
    """Tip nearest to a place; default: that of the widest vessel."""
    tips, means = _tips(graph)
    if root_mm is not None:
        return int(tips[np.linalg.norm(graph.points[tips] - np.asarray(root_mm, float), axis=1).argmin()])
    wide = np.flatnonzero(means >= _AS_WIDE * means.max())
    best = wide[lowest(graph.points[tips[wide]])]
    if len(wide) > 1:
        notes.append(
            f"Root: {len(wide)} tips are about as wide ({means[wide].min():.2f} to {means[wide].max():.2f} mm). The lowest was "
            f"taken, {as_text(graph.points[tips[best]])} mm; --root chooses another one."
        )
    return int(tips[best])


def lowest(points: Points) -> int:
    """Number of the lowest point; among those up to LEVEL_MM above it, the one farthest to the patient's right.

    So noise does not choose between the tips of symmetric vessels.
    """
    level = np.flatnonzero(points[:, 2] <= points[:, 2].min() + LEVEL_MM)
    return int(level[points[level, 0].argmin()])


def _centered(points: Points, wall: _Wall) -> Points:
    """The curve moved across itself, away from the nearest point of the wall, and smoothed.

    A point outside, where the graph or the smoothing left a thin vessel, moves back into the lumen.
    """
    for round_ in range(_ROUNDS):
        tangents = np.gradient(points, axis=0)
        tangents /= np.maximum(1e-12, np.linalg.norm(tangents, axis=1))[:, None]
        depths, away = wall.inward(points)
        outside = depths < 0
        shift = _PUSH * (1 - round_ / _ROUNDS) * depths[:, None] * away
        shift[1:-1] += _SMOOTHING * ((points[:-2] + points[2:]) / 2 - points[1:-1])
        shift -= np.einsum("ij,ij->i", shift, tangents)[:, None] * tangents
        shift[outside] = (_BACK_MM - depths[outside])[:, None] * away[outside]
        points = points + shift
    return resampled(points, STEP_MM)


def _without_corner(points: Points, radii: Floats) -> int:
    """Number of points to keep, up to where the radius falls towards a flat end."""
    last = len(points)
    while last > 4:
        before = float(np.median(radii[max(0, last - 12) : max(1, last - 2)]))
        if radii[last - 1] >= _END_SHARE * before or len(points) - last > 2 * before / STEP_MM:
            break
        last -= 1
    return last


def _nearest_on(points: Points, point: Any) -> Tuple[Any, int]:
    """Nearest place on a polyline, and the step it lies on."""
    begin, way = points[:-1], np.diff(points, axis=0)
    share = np.einsum("ij,ij->i", point - begin, way) / np.maximum(1e-12, np.einsum("ij,ij->i", way, way))
    places = begin + np.clip(share, 0, 1)[:, None] * way
    step = int(np.linalg.norm(places - point, axis=1).argmin())
    return places[step], step


def _joined(curve: Points, parent: Curve) -> Points:
    """The curve from the place where it leaves the parent's line; its first point is moved there."""
    distances, nearest = need("scipy.spatial").cKDTree(parent.points).query(curve)
    away = np.flatnonzero(distances > _ON_LINE * parent.radii[nearest] + STEP_MM / 2)
    first = max(0, int(away[0]) - 1) if len(away) else len(curve) - 1
    place, _ = _nearest_on(parent.points, curve[first])
    return np.vstack([place, curve[first + 1 :]])


def clamp(radii: Floats, points: Points, parent: Curve) -> Floats:
    """Radii within the parent's lumen: at most that where the curve leaves it."""
    _, step = _nearest_on(parent.points, points[0])
    left = np.flatnonzero(np.linalg.norm(points - points[0], axis=1) > parent.radii[step])
    if not len(left):
        return radii
    out = radii.copy()
    out[: left[0]] = np.minimum(out[: left[0]], out[left[0]])
    return out


def find(mesh: Mesh, root_mm: Optional[Any] = None, notes: Optional[List[str]] = None) -> List[Curve]:
    """Centerlines of a closed surface of one part whose triangles face outward.

    root_mm: the first curve begins at the tip nearest to this point; default: the tip of the widest vessel. `notes` gets
    sentences about a choice that was close. Raises Error if the surface encloses no lumen.
    """
    points, normals = sample(mesh, _step_mm(mesh))
    graph = _Graph(points, normals)
    root = _root(graph, root_mm, [] if notes is None else notes)
    wall = _Wall(mesh)
    curves: List[Curve] = []
    kept: List[Optional[int]] = []
    for path, parent in _branches(graph, root):
        line = _centered(resampled(graph.points[path], STEP_MM), wall)
        above = None
        if parent is not None:
            above = kept[parent]
            if above is None:
                kept.append(None)
                continue
            line = _joined(line, curves[above])
        if len(line) < 3:
            kept.append(None)
            continue
        radii = wall.distances(line)
        last = _without_corner(line, radii)
        first = 0 if above is not None else len(line) - _without_corner(line[::-1], radii[::-1])
        line, radii = line[first:last], radii[first:last]
        if len(line) < 3:
            kept.append(None)
            continue
        if above is not None:
            radii = clamp(radii, line, curves[above])
        kept.append(len(curves))
        curves.append(Curve(f"c{len(curves):02}", line, np.maximum(radii, 0.05), above))
    if not curves:
        raise Error(_NO_LINE)
    return curves


def find_all(found: Sequence[Mesh], roots_mm: Sequence[Any] = (), notes: Optional[List[str]] = None) -> List[Curve]:
    """Centerlines of all parts of a surface, a tree in each.

    A tree begins at the tip nearest to the first root that is nearest to its part. `notes` gets a sentence about a part
    without a centerline. Raises Error if there is none at all.
    """
    notes = [] if notes is None else notes
    owners = [part_at(found, place) for place in roots_mm]
    curves: List[Curve] = []
    for k, mesh in enumerate(found):
        root = next((place for owner, place in zip(owners, roots_mm) if owner == k), None)
        try:
            add_tree(curves, find(mesh, root, notes))
        except Error as error:
            if len(found) == 1:
                raise
            notes.append(f"A part of {mesh.volume_mm3() / 1000:.2f} mL at {as_text(mesh.points[0])} mm has no flow: {error}.")
    if not curves:
        raise Error(_NO_LINE)
    return curves


def add_tree(curves: List[Curve], tree: List[Curve]) -> None:
    """Adds the curves of another tree, with names and parents that go on from those before."""
    first = len(curves)
    for k, curve in enumerate(tree, first):
        parent = None if curve.parent is None else first + curve.parent
        curves.append(dataclasses.replace(curve, name=f"c{k:02}", parent=parent))


def write(folder: pathlib.Path, curves: List[Curve]) -> None:
    """A curve of 3D Slicer for each centerline, in LPS and mm, in a new folder."""
    folder.mkdir()
    for curve in curves:
        (folder / f"{curve.name}.mrk.json").write_text(slicer_curve(curve.points, curve.radii))


def read(folder: pathlib.Path) -> List[Curve]:
    """Curves that `write` wrote."""
    curves: List[Curve] = []
    for path in sorted(folder.glob("*.mrk.json")):
        (markup,) = json.loads(path.read_text())["markups"]
        points = np.array([point["position"] for point in markup["controlPoints"]], float)
        radii = np.array(markup["measurements"][0]["controlPointValues"], float)
        near = [float(np.linalg.norm(curve.points - points[0], axis=1).min()) for curve in curves]
        # The first curve of each tree begins on no other one.
        parent = int(np.argmin(near)) if near and min(near) <= STEP_MM else None
        curves.append(Curve(path.name.split(".")[0], points, radii, parent))
    return curves
