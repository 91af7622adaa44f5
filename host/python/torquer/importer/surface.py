"""Surface of the lumen: isosurface, smoothing that keeps the volume, decimation, files."""

from __future__ import annotations

import dataclasses
import os
import struct
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from ._base import Error, Points, need

# Windowed sinc filter. A vessel has a radius of 1.5 mm and voxels of 0.4 to 0.7 mm. A pass band of 0.1 in 20 rounds
# changes its radius by less than 0.05 mm. A pass band of 0.03 or less destroys it.
_PASS_BAND, _ROUNDS = 0.1, 20
MOST_TRIANGLES = 60_000
"""Triangles after the decimation: the simulator loads them in 10 s, and five times as many in 34 s."""

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
        "vtkQuadricDecimation": "vtkFiltersCore", "vtkPolyDataConnectivityFilter": "vtkFiltersCore",
        "vtkCleanPolyData": "vtkFiltersCore", "vtkTriangleFilter": "vtkFiltersCore",
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
    """Largest part of the surface of `picture` at a level, closed flat at the border.

    picture: shape (slices, rows, columns); affine and `first` (column, row, slice) give its place.
    """
    bordered = np.pad(picture, 1)  # with 0, which must lie below the level
    size = bordered.shape
    image = _vtk("vtkImageData")
    image.SetDimensions(*size[::-1])
    values = need("vtkmodules.util.numpy_support").numpy_to_vtk(bordered.ravel(), deep=False)
    image.GetPointData().SetScalars(values)
    surface = _edges(image, level)
    surface = _run("vtkPolyDataConnectivityFilter", surface, SetExtractionModeToLargestRegion=None)
    mesh = from_vtk(surface)
    if not len(mesh.triangles):
        raise Error("the lumen has no surface; give a seed in a wider vessel")
    # The border lies half a voxel outside of the last voxel, where the scan ends.
    index = np.clip(mesh.points - 1, -0.5, np.array(size[::-1]) - 2 - 0.5) + np.asarray(first)
    mesh.points = index @ affine[:3, :3].T + affine[:3, 3]
    if mesh.volume_mm3() < 0:
        mesh.triangles = mesh.triangles[:, ::-1].copy()
    return mesh


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
    data = _run(
        "vtkQuadricDecimation", to_vtk(mesh), SetTargetReduction=1 - most / len(mesh.triangles),
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
