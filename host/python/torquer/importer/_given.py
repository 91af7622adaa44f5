"""Surfaces and centerlines that another program made: STL, OBJ, PLY, VTP and VTK, lines of VMTK, curves of 3D Slicer."""

from __future__ import annotations

import os
import pathlib
import re
from typing import Any, Callable, List, Optional, Sequence, Tuple

import numpy as np
import numpy.typing as npt

from .. import Surface
from .._polyline import resampled
from .._user_file import load_json, read_text
from ..centerlines import MM, Line, read_vtp, without_trunks
from ._base import Error, Points, as_text, need
from .centerlines import STEP_MM, Curve, add_tree, clamp, wall_of
from .scan import Path
from .surface import Mesh, from_vtk, in_order, part_at
from .surface import parts as split

_BY_VTK = (".vtp", ".vtk")
ENDINGS = (".stl", ".obj", ".ply", *_BY_VTK)
"""Ends of the names of surfaces."""
SPACES = ("LPS", "RAS")
_HEADER_BYTES = 1000
# An end of a line joins another one within this share of its radius there. A hand is less exact than a program.
_JOINS, _JOINS_BY_HAND = 0.25, 0.75
# Points of curves lie closer than that, so that the nearest one tells the distance.
_FINE_MM = 0.25
_BY_VMTK, _BY_HAND = "compute all lines from one source by vmtkcenterlines", "move its first point onto another curve"


def is_surface(path: Path) -> bool:
    """True for a file with the name of a surface."""
    return os.fspath(path).lower().endswith(ENDINGS) and not os.path.isdir(path)


def read_surface(path: Path, mesh_unit: str, space: Optional[str]) -> Tuple[Mesh, str, List[str]]:
    """Repaired, closed surface in LPS and mm, the space of the file, and sentences about it.

    space: LPS or RAS from the user; otherwise from the file; otherwise LPS. Raises Error naming the file, the defect
    and the remedy.
    """
    path = os.fspath(path)
    if path.lower().endswith(_BY_VTK):
        points, triangles, said = _by_vtk(path)
        read = Surface.from_triangles(points, triangles, path, mesh_unit)
    else:
        read = Surface(path, mesh_unit)
        said = read.space
    if space and said and space != said:
        raise Error(f"{path}: the file says SPACE={said}, but --space is {space}; leave out --space")
    used = space or said or "LPS"
    origin = "the file says so" if said else "by --space" if space else "assumed, because the file does not say it; see --space"
    # The same mesh in another file gives the same centerlines.
    mesh = in_order(Mesh(in_lps(read.points_mm, used), read.triangles.astype(np.int64)))
    return mesh, used, [*read.findings, f"Coordinates in {mesh_unit} and {used}: {origin}."]


def in_lps(points: Points, space: str) -> Points:
    """Points of a space in LPS."""
    return points * [-1, -1, 1] if space == "RAS" else points


def _by_vtk(path: str) -> Tuple[Points, npt.NDArray[np.int64], str]:
    """Points in the file's unit, triangles and the space, or an empty text."""
    try:
        with open(path, "rb") as file:
            header = file.read(_HEADER_BYTES)
    except OSError as error:
        raise Error(f"{path}: cannot be read ({error.strerror}); check the path") from None
    faults: List[str] = []
    data = _polydata(path, header, faults)
    if faults:
        raise Error(f"{path}: cannot be read ({faults[0][:200]}); save it again as VTK PolyData, or as STL")
    if data.GetNumberOfPolys() + data.GetNumberOfStrips() == 0:
        lines = data.GetNumberOfLines()
        remedy = "give it by --centerlines, beside its surface" if lines else "give the vessel's surface"
        raise Error(f"{path}: holds {lines} lines and no triangles; {remedy}")
    split = need("vtkmodules.vtkFiltersCore").vtkTriangleFilter()
    split.SetInputData(data)
    split.PassLinesOff()
    split.PassVertsOff()
    split.Update()
    mesh = from_vtk(split.GetOutput())
    named = data.GetFieldData().GetAbstractArray("SPACE")
    space = str(named.GetVariantValue(0).ToString()) if named is not None and named.GetNumberOfValues() else ""
    at = header.find(b"SPACE=")
    space = space or (header[at + 6 : at + 9].decode("latin-1") if at >= 0 else "")
    return mesh.points, mesh.triangles, space if space in SPACES else ""


def _polydata(path: str, header: bytes, faults: List[str]) -> Any:
    """Contents of a file; `faults` gets VTK's messages about it."""
    core = need("vtkmodules.vtkCommonCore")
    if header.lstrip().startswith(b"<"):
        reader = need("vtkmodules.vtkIOXML").vtkXMLPolyDataReader()
    else:
        reader = need("vtkmodules.vtkIOLegacy").vtkGenericDataObjectReader()
    # Some messages, as of a file that is cut off, reach no observer of the reader.
    window, before = core.vtkStringOutputWindow(), core.vtkOutputWindow.GetInstance()
    core.vtkOutputWindow.SetInstance(window)
    core.vtkLogger.SetStderrVerbosity(core.vtkLogger.VERBOSITY_OFF)
    try:
        reader.SetFileName(path)
        reader.Update()
    finally:
        core.vtkOutputWindow.SetInstance(before)
    lines = [line for line in window.GetOutput().splitlines() if line.strip() and not re.search(r": In .*, line \d+$", line)]
    faults += [re.sub(r"^vtk\w+ \(0x[0-9a-f]+\): ", "", line) for line in lines]
    data = reader.GetOutputDataObject(0)
    if not faults and (data is None or not data.IsA("vtkPolyData")):
        name = "no data" if data is None or data.GetClassName() == "vtkDataObject" else data.GetClassName()
        faults.append(f"it holds {name}, not vtkPolyData")
    return data


def read_lines(
    path: Path, mesh_unit: str, space: str, roots_mm: Sequence[Any] = (), parts: Sequence[Mesh] = ()
) -> Tuple[List[Curve], List[str]]:
    """Trees of the lines in a .vtp of VMTK, one in each of the surface's parts, and sentences about them.

    Lines may share their trunk, as from vmtkcenterlines, or end where they branch. A tree begins at the free end
    nearest to the root of its part, or at the first point of its first line.
    """
    read = read_vtp(path)
    lines = without_trunks(read)
    lines = [Line(in_lps(MM[mesh_unit] * line.points, space), MM[mesh_unit] * line.radii) for line in lines]
    curves, trees = _trees(lines, roots_mm, parts, lambda some: _Lines(os.fspath(path), some, _JOINS, _BY_VMTK))
    return curves, [f"{len(read)} lines of {os.fspath(path)} are {trees} of {len(curves)} branches."]


def read_curves(folder: Path, mesh: Mesh, roots_mm: Sequence[Any] = ()) -> Tuple[List[Curve], List[str]]:
    """Trees of the curves of 3D Slicer in a folder, such as edited ones, one in each part of the surface `mesh`.

    Also sentences about them. Their radii are the distances to `mesh`, because an edited curve has left those of its
    file.
    """
    paths = sorted(pathlib.Path(folder).glob("*.mrk.json"))
    if not paths:
        raise Error(f"{os.fspath(folder)}: holds no curve (.mrk.json); save the centerlines there from 3D Slicer")
    read = [resampled(_slicer_points(path), _FINE_MM) for path in paths]
    wall = need("scipy.spatial").cKDTree(wall_of(mesh))
    lines = [Line(points, wall.query(points)[0]) for points in read]
    # The longest first, because the tree begins at its first point.
    lines.sort(key=lambda line: -len(line.points))
    name = os.fspath(folder)
    curves, trees = _trees(lines, roots_mm, split(mesh), lambda some: _Lines(name, some, _JOINS_BY_HAND, _BY_HAND))
    for curve in curves:
        curve.points = resampled(curve.points, STEP_MM)
        curve.radii = np.maximum(0.05, wall.query(curve.points)[0])
        if curve.parent is not None:
            curve.radii = clamp(curve.radii, curve.points, curves[curve.parent])
    return curves, [f"{len(paths)} curves of {name} are {trees} of {len(curves)} branches; radii by the surface."]


def _slicer_points(path: pathlib.Path) -> Points:
    """Control points of a curve, in LPS and mm."""
    again = "save it again as .mrk.json from 3D Slicer"
    try:
        markups = load_json(read_text(path))["markups"]
        (markup,) = [one for one in markups if one["type"] == "Curve"]
        placed = [one for one in markup["controlPoints"] if one.get("positionStatus", "defined") == "defined"]
        points = np.array([one["position"] for one in placed], float)
        system, unit = markup.get("coordinateSystem", "LPS"), markup.get("coordinateUnits", "mm")
    except (ValueError, KeyError, TypeError, AttributeError):
        raise Error(f"{path}: is not one curve with points (markups, controlPoints, position); {again}") from None
    if system not in SPACES:
        raise Error(f"{path}: field coordinateSystem is {str(system)[:20]!r}, not LPS or RAS; {again}")
    if not isinstance(unit, str) or unit not in MM:
        raise Error(f"{path}: field coordinateUnits is {str(unit)[:20]!r}, not one of {', '.join(MM)}; {again}")
    if points.ndim != 2 or points.shape[1:] != (3,) or len(points) < 2 or not (np.abs(points) < 1e5).all():
        raise Error(f"{path}: field controlPoints has no two places of three numbers; {again}")
    return in_lps(MM[unit] * points, system)


class _Lines:
    """Graph of the points of all lines."""

    def __init__(self, path: str, lines: List[Line], joins: float, remedy: str) -> None:
        self._joins, self._remedy = joins, remedy
        every = np.vstack([line.points for line in lines])
        self.points, first, number = np.unique(every, axis=0, return_index=True, return_inverse=True)
        self.radii = np.concatenate([line.radii for line in lines])[first]
        starts = np.cumsum([0, *(len(line.points) for line in lines)])
        numbers = [number.ravel()[a:b] for a, b in zip(starts, starts[1:])]
        self.first = int(numbers[0][0])
        pairs = [np.column_stack([some[:-1], some[1:]]) for some in numbers]
        if len(lines) > 1:
            pairs.append(self._joints(numbers))
        joined = np.unique(np.sort(np.vstack(pairs), axis=1), axis=0)
        self.pairs = joined[joined[:, 0] != joined[:, 1]]
        self._check_joined(path)

    def _joints(self, numbers: List[Any]) -> Any:
        """Pairs that join the ends of lines to the other lines."""
        tree = need("scipy.spatial").cKDTree
        found = np.zeros((0, 2), np.intp)
        for k, some in enumerate(numbers):
            others = np.unique(np.concatenate([other for n, other in enumerate(numbers) if n != k]))
            ends = some[[0, -1]]
            distances, nearest = tree(self.points[others]).query(self.points[ends])
            near = distances <= self._joins * np.maximum(self.radii[ends], self.radii[others[nearest]])
            found = np.vstack([found, np.column_stack([ends, others[nearest]])[near]])
        return found

    def _check_joined(self, path: str) -> None:
        sparse, csgraph = need("scipy.sparse"), need("scipy.sparse.csgraph")
        count = len(self.points)
        lengths = np.linalg.norm(self.points[self.pairs[:, 0]] - self.points[self.pairs[:, 1]], axis=1)
        self.costs = sparse.coo_matrix((np.maximum(lengths, 1e-9), self.pairs.T), (count, count)).tocsr()
        parts, part = csgraph.connected_components(self.costs, directed=False)
        if parts > 1:
            lost = self.points[np.flatnonzero(part != part[self.first])[0]]
            raise Error(
                f"{path}: the line at {as_text(lost)} mm meets no other one; {self._remedy}"
            )


def _trees(
    lines: List[Line], roots_mm: Sequence[Any], parts: Sequence[Mesh], graph_of: Callable[[List[Line]], _Lines]
) -> Tuple[List[Curve], str]:
    """A tree of the lines in each part of the surface, and the number of trees in words."""
    many = len(parts) > 1
    owners = [part_at(parts, line.points[len(line.points) // 2]) if many else 0 for line in lines]
    ends = [part_at(parts, root) if many else 0 for root in roots_mm]
    curves: List[Curve] = []
    numbers = sorted(set(owners), key=owners.index)
    for number in numbers:
        graph = graph_of([line for owner, line in zip(owners, lines) if owner == number])
        root = next((place for end, place in zip(ends, roots_mm) if end == number), None)
        add_tree(curves, _tree(graph, root))
    return curves, "a tree" if len(numbers) == 1 else f"{len(numbers)} trees"


def _tree(graph: _Lines, root_mm: Optional[Any]) -> List[Curve]:
    root = graph.first
    if root_mm is not None:
        ends = np.flatnonzero(np.bincount(graph.pairs.ravel(), minlength=len(graph.points)) == 1)
        root = int(ends[np.linalg.norm(graph.points[ends] - np.asarray(root_mm, float), axis=1).argmin()])
    lengths, before = need("scipy.sparse.csgraph").dijkstra(graph.costs, directed=False, indices=root, return_predecessors=True)
    tips = np.setdiff1d(np.arange(len(graph.points)), before)
    owner = np.full(len(graph.points), -1)
    curves: List[Curve] = []
    for tip in tips[np.argsort(-lengths[tips])]:
        way = [int(tip)]
        while owner[way[-1]] < 0 and way[-1] != root:
            way.append(int(before[way[-1]]))
        nodes = np.array(way[::-1])
        parent = int(owner[nodes[0]]) if owner[nodes[0]] >= 0 else None
        owner[nodes if parent is None else nodes[1:]] = len(curves)
        points, radii = graph.points[nodes], graph.radii[nodes]
        if parent is not None:
            radii = clamp(radii, points, curves[parent])
        curves.append(Curve(f"c{len(curves):02}", points, np.maximum(radii, 0.05), parent))
    return curves
