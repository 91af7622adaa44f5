"""Surface of the lumen: isosurface, its parts, smoothing that keeps the volume, decimation, files."""

from __future__ import annotations

import dataclasses
import os
import struct
from typing import Any, List, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from ._base import Error, Points, as_text, need

# Windowed sinc filter. A vessel has a radius of 1.5 mm and voxels of 0.4 to 0.7 mm. A pass band of 0.1 in 20 rounds
# changes its radius by less than 0.05 mm. A pass band of 0.03 or less destroys it.
_PASS_BAND, _ROUNDS = 0.1, 20
MOST_TRIANGLES = 60_000
"""Triangles after the decimation: the simulator loads them in 10 s, and five times as many in 34 s."""
# In a plane all collapses have the error 0. Then they gather at single points, and the time grows with the square of the
# triangles. Points moved by this standard deviation, mm, have errors.
_JITTER_MM = 0.002
# Parts of a surface that are named each; the others are summed up. Less than _SPECK_ML mL is noise and not a vessel.
_MOST_NAMED, _SPECK_ML = 3, 0.01
# A part with less than this share of the largest one's volume is a fragment, unless it is chosen.
_FRAGMENT_SHARE = 0.1

_STL_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])


@dataclasses.dataclass
class Mesh:
    """Triangles, counterclockwise as seen from outside."""

    points: Points
    """Shape (n, 3), mm."""
    triangles: npt.NDArray[np.int64]
    """Shape (m, 3)."""

    def corners(self) -> npt.NDArray[np.float64]:
        """Shape (m, 3, 3)."""
        return self.points[self.triangles]

    def volume_mm3(self) -> float:
        a, b, c = (self.corners() - self.points.mean(axis=0)).transpose(1, 0, 2)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    def area_vectors(self) -> Points:
        """Normal of each triangle, as long as its area, mm^2."""
        a, b, c = self.corners().transpose(1, 0, 2)
        out: Points = np.cross(b - a, c - a) / 2
        return out


def _vtk(name: str) -> Any:
    modules = {
        "vtkImageData": "vtkCommonDataModel", "vtkPolyData": "vtkCommonDataModel", "vtkCellArray": "vtkCommonDataModel",
        "vtkPoints": "vtkCommonCore", "vtkFlyingEdges3D": "vtkFiltersCore", "vtkWindowedSincPolyDataFilter": "vtkFiltersCore",
        "vtkQuadricDecimation": "vtkFiltersCore",
    }
    return getattr(need(f"vtkmodules.{modules[name]}"), name)()


def to_vtk(mesh: Mesh) -> Any:
    """The mesh as vtkPolyData."""
    support = need("vtkmodules.util.numpy_support")
    points = _vtk("vtkPoints")
    points.SetData(support.numpy_to_vtk(np.ascontiguousarray(mesh.points), deep=True))
    cells = _vtk("vtkCellArray")
    ends = np.arange(0, 3 * len(mesh.triangles) + 1, 3)
    cells.SetData(
        support.numpy_to_vtkIdTypeArray(ends, deep=True),
        support.numpy_to_vtkIdTypeArray(np.ascontiguousarray(mesh.triangles, np.int64).ravel(), deep=True),
    )
    out = _vtk("vtkPolyData")
    out.SetPoints(points)
    out.SetPolys(cells)
    return out


def from_vtk(data: Any) -> Mesh:
    """The triangles of vtkPolyData, without its unused points."""
    support = need("vtkmodules.util.numpy_support")
    if data.GetNumberOfPolys() == 0:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    points = support.vtk_to_numpy(data.GetPoints().GetData()).astype(float)
    triangles = support.vtk_to_numpy(data.GetPolys().GetConnectivityArray()).astype(np.int64).reshape(-1, 3)
    used, index = np.unique(triangles, return_inverse=True)
    return Mesh(points[used], index.reshape(-1, 3))


def _run(filter_name: str, data: Any, **settings: Any) -> Any:
    step = _vtk(filter_name)
    step.SetInputData(data)
    for name, value in settings.items():
        getattr(step, name)(*([] if value is None else [value]))
    step.Update()
    return step.GetOutput()


def isosurface(picture: npt.NDArray[Any], level: float, affine: npt.NDArray[np.float64], first: Any = (0, 0, 0)) -> Mesh:
    """Surface of `picture` at a level, closed flat at the border, in all its parts.

    picture: shape (slices, rows, columns); affine and `first` (column, row, slice) give its place.
    """
    bordered = np.pad(picture, 1)  # with 0, which must lie below the level
    size = bordered.shape
    image = _vtk("vtkImageData")
    image.SetDimensions(*size[::-1])
    values = need("vtkmodules.util.numpy_support").numpy_to_vtk(bordered.ravel(), deep=False)
    image.GetPointData().SetScalars(values)
    mesh = from_vtk(_edges(image, level))
    if not len(mesh.triangles):
        raise Error("the lumen has no surface; give a seed in a wider vessel")
    # The border lies half a voxel outside of the last voxel, where the scan ends.
    index = np.clip(mesh.points - 1, -0.5, np.array(size[::-1]) - 2 - 0.5) + np.asarray(first)
    mesh.points = index @ affine[:3, :3].T + affine[:3, 3]
    if mesh.volume_mm3() < 0:
        mesh.triangles = mesh.triangles[:, ::-1].copy()
    return mesh


def in_order(mesh: Mesh) -> Mesh:
    """The mesh with triangles and points in an order that depends on their places alone, not on that of a file."""
    corners = mesh.corners()
    # Each triangle begins with its lowest corner, so its orientation stays.
    keys = np.round(corners, 3) @ [1.0, np.sqrt(2.0), np.sqrt(3.0)]
    first = keys.argmin(axis=1)
    turned = np.take_along_axis(mesh.triangles, (first[:, None] + np.arange(3)) % 3, axis=1)
    places = mesh.points[turned]
    turned = turned[np.lexsort(np.round(np.column_stack([places[:, 1], places.mean(axis=1)]), 3).T)]
    used, at, index = np.unique(turned, return_index=True, return_inverse=True)
    rank = np.empty(len(used), np.int64)
    rank[np.argsort(at)] = np.arange(len(used))
    return Mesh(mesh.points[used[np.argsort(at)]], rank[index.reshape(-1, 3)])


def parts(mesh: Mesh) -> List[Mesh]:
    """Parts that share no point, and enclose a volume, by this volume; cavities within them are left out."""
    sparse = need("scipy.sparse")
    edges = mesh.triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
    joined = sparse.coo_matrix((np.ones(len(edges), bool), edges.T), (len(mesh.points),) * 2)
    count, part = need("scipy.sparse.csgraph").connected_components(joined, directed=False)
    if count == 1:
        return [mesh]
    number = part[mesh.triangles[:, 0]]
    a, b, c = (mesh.corners() - mesh.points.mean(axis=0)).transpose(1, 0, 2)
    volumes = np.bincount(number, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6, count)
    order = np.argsort(number, kind="stable")
    split = np.split(mesh.triangles[order], np.cumsum(np.bincount(number, minlength=count))[:-1])
    found = []
    for k in np.argsort(-volumes, kind="stable"):
        if volumes[k] > 0:
            used, index = np.unique(split[k], return_inverse=True)
            found.append(Mesh(mesh.points[used], index.reshape(-1, 3)))
    return found


def part_at(found: Sequence[Mesh], place_mm: Any) -> int:
    """Number of the part whose surface is nearest to a place."""
    return int(np.argmin([np.linalg.norm(one.points - place_mm, axis=1).min() for one in found]))


def wanted(mesh: Mesh, roots_mm: Sequence[Any] = (), near_mm: Sequence[Any] = ()) -> Tuple[Mesh, List[str]]:
    """The parts that become the vessel, as one mesh, and sentences about the others.

    They are those nearest to the roots. Without roots, they are all that are no fragments, and those nearest to `near_mm`.
    """
    found = parts(mesh)
    if not found:
        raise Error("the surface encloses no lumen; check that it is closed, and its normals")
    kept = {part_at(found, place) for place in roots_mm}
    if not kept:
        least = _FRAGMENT_SHARE * found[0].volume_mm3()
        kept = {k for k, one in enumerate(found) if one.volume_mm3() >= least} | {part_at(found, place) for place in near_mm}
    facts = []
    if len(kept) > 1:
        listed = _named([found[k] for k in sorted(kept)])
        facts = [f"Parts: {len(kept)} without connection, each with its own inlet of the blood: {listed}. --root takes single ones."]
    vessels = [one for k, one in enumerate(found) if k not in kept and one.volume_mm3() >= 1000 * _SPECK_ML]
    if vessels:
        count = f"{len(vessels)} part{'s' if len(vessels) > 1 else ''}"
        ml = sum(found[k].volume_mm3() for k in kept) / 1000
        facts.append(
            f"Left out: {count} without connection to the vessel of {ml:.2f} mL: {_named(vessels)}. "
            "Give --root at an end of each part that you want, or connect the parts in 3D Slicer."
        )
    return joined([found[k] for k in sorted(kept)]), facts


def _named(found: Sequence[Mesh]) -> str:
    """Volumes and places of the largest parts, and the volume of the others."""
    named = [f"{one.volume_mm3() / 1000:.2f} mL at {as_text(_within(one))} mm" for one in found[:_MOST_NAMED]]
    more = found[_MOST_NAMED:]
    rest = f", and {len(more)} more with {sum(one.volume_mm3() for one in more) / 1000:.2f} mL" if more else ""
    return ", ".join(named) + rest


def joined(found: Sequence[Mesh]) -> Mesh:
    """All parts in one mesh."""
    if len(found) == 1:
        return found[0]
    starts = np.cumsum([0, *(len(one.points) for one in found)])
    triangles = [one.triangles + start for one, start in zip(found, starts)]
    return Mesh(np.vstack([one.points for one in found]), np.vstack(triangles))


def _within(mesh: Mesh) -> Any:
    """A point of the mesh near its middle."""
    return mesh.points[np.linalg.norm(mesh.points - mesh.points.mean(axis=0), axis=1).argmin()]


def _edges(image: Any, level: float) -> Any:
    step = _vtk("vtkFlyingEdges3D")
    step.SetInputData(image)
    step.SetValue(0, level)
    step.ComputeNormalsOff()
    step.ComputeScalarsOff()
    step.Update()
    return step.GetOutput()


def smooth(mesh: Mesh) -> Mesh:
    """Windowed sinc (Taubin), and back to the volume before by a step along the normals."""
    data = _run(
        "vtkWindowedSincPolyDataFilter", to_vtk(mesh), SetNumberOfIterations=_ROUNDS, SetPassBand=_PASS_BAND,
        NormalizeCoordinatesOn=None, FeatureEdgeSmoothingOff=None, NonManifoldSmoothingOn=None,
    )
    out = from_vtk(data)
    vectors = out.area_vectors()
    area = float(np.linalg.norm(vectors, axis=1).sum())
    step_mm = (mesh.volume_mm3() - out.volume_mm3()) / area
    normals = np.zeros_like(out.points)
    for corner in range(3):
        np.add.at(normals, out.triangles[:, corner], vectors)
    normals /= np.maximum(1e-12, np.linalg.norm(normals, axis=1))[:, None]
    return Mesh(out.points + step_mm * normals, out.triangles)


def decimate(mesh: Mesh, most: int = MOST_TRIANGLES) -> Mesh:
    """The mesh with at most about `most` triangles, by quadric errors, with its volume kept."""
    if len(mesh.triangles) <= most:
        return mesh
    moved = mesh.points + _JITTER_MM * np.random.default_rng(1).standard_normal(mesh.points.shape)
    data = _run(
        "vtkQuadricDecimation", to_vtk(Mesh(moved, mesh.triangles)), SetTargetReduction=1 - most / len(mesh.triangles),
        VolumePreservationOn=None,
    )
    return from_vtk(data)


def write_stl(path: Union[str, "os.PathLike[str]"], mesh: Mesh) -> None:
    """Binary STL whose header says that it is in LPS and mm, as 3D Slicer does."""
    rows = np.zeros(len(mesh.triangles), _STL_ROW)
    vectors = mesh.area_vectors()
    rows["normal"] = vectors / np.maximum(1e-30, np.linalg.norm(vectors, axis=1))[:, None]
    rows["corners"] = mesh.corners()
    with open(path, "wb") as file:
        file.write(b"torquer-import, mm, SPACE=LPS".ljust(80) + struct.pack("<I", len(rows)))
        file.write(rows.tobytes())


def from_stl(path: Union[str, "os.PathLike[str]"]) -> Mesh:
    """The triangles that `write_stl` wrote, without shared points."""
    with open(path, "rb") as file:
        rows = np.frombuffer(file.read()[84:], _STL_ROW)
    points = rows["corners"].astype(float).reshape(-1, 3)
    return Mesh(points, np.arange(len(points)).reshape(-1, 3))
