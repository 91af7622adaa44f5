"""Reads a scan, or a label map of a segmentation, with its place in the patient.

    scan = torquer.importer.scan.read("CT_FOLDER", series=2)
    scan.values[k, j, i], scan.point_mm(i, j, k)
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
from typing import Any, List, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from ._base import Error, Points, moved, need

Path = Union[str, "os.PathLike[str]"]

# 2 GiB of 16-bit values; more does not fit into the memory that the import may use.
MOST_VOXELS = 1 << 30
# Voxels within these spacings, mm, can show arteries.
_FINEST_MM, _COARSEST_MM = 0.02, 5.0
# Vessels thinner than about three voxels are incomplete.
_COARSE_MM = 1.0

ENDINGS = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd")
"""Ends of the names of images, besides folders of DICOM files."""


@dataclasses.dataclass
class Scan:
    """A scan in the patient's frame: LPS, +x left, +y posterior, +z superior, in mm."""

    values: npt.NDArray[Any]
    """Shape (slices, rows, columns). int16 for a scan, after the rescale; integers for a label map."""
    affine: npt.NDArray[np.float64]
    """Shape (4, 4): from (column, row, slice) to LPS, mm. Tilted slices make it oblique."""
    facts: List[str]
    """Sentences that describe the read data and the checks."""
    path: str

    @property
    def spacing_mm(self) -> npt.NDArray[np.float64]:
        """Steps between columns, rows and slices."""
        return np.asarray(np.linalg.norm(self.affine[:3, :3], axis=0))

    def points_mm(self, indices: Any) -> Points:
        """Places of (column, row, slice)."""
        return moved(self.affine, indices)

    def indices(self, points_mm: Any) -> Points:
        """(column, row, slice) of points, not rounded."""
        return moved(np.linalg.inv(self.affine), points_mm)

    def inside(self, index: Any) -> bool:
        size = np.array(self.values.shape[::-1])
        return bool((np.asarray(index) >= -0.5).all() and (np.asarray(index) <= size - 0.5).all())

    def bounds_mm(self) -> Tuple[Points, Points]:
        size = np.array(self.values.shape[::-1])
        corners = np.array(np.meshgrid(*([0, n - 1] for n in size))).reshape(3, -1).T
        points = self.points_mm(corners)
        return points.min(axis=0), points.max(axis=0)


def is_image(path: Path) -> bool:
    """True for a folder, and for a file with the name of an image."""
    return os.path.isdir(path) or os.fspath(path).lower().endswith((*ENDINGS, ".dcm", ".ima"))


def read(path: Path, series: Optional[int] = None) -> Scan:
    """Reads a folder of DICOM files, or a NIfTI, NRRD or MetaImage file.

    series: number of the series in a folder with several, from 1. The order is that of the message that lists them.
    Raises Error naming the file, the defect and the remedy.
    """
    path = os.fspath(path)
    if not os.path.lexists(path):
        raise Error(f"{path}: does not exist; check the path")
    name = path.lower()
    if os.path.isdir(path) or name.endswith((".dcm", ".ima")):
        from ._dicom import read_series

        return checked(read_series(pathlib.Path(path), series))
    if series is not None:
        raise Error(f"--series {series} is for a folder of DICOM files, but {path} is one file; leave it out")
    if name.endswith((".nii", ".nii.gz")):
        return checked(_read_nifti(path))
    if name.endswith((".nrrd", ".nhdr", ".mha", ".mhd")):
        from ._images import read_meta, read_nrrd

        return checked(read_nrrd(path) if name.endswith((".nrrd", ".nhdr")) else read_meta(path))
    raise Error(
        f"{path}: no known kind of scan; give a folder of DICOM files or one of: {', '.join(ENDINGS)}"
    )


def checked(scan: Scan) -> Scan:
    """The scan, after checks of its size, spacing and axes."""
    shape, spacing = scan.values.shape, scan.spacing_mm
    if len(shape) != 3 or min(shape) < 3:
        raise Error(f"{scan.path}: has {' x '.join(map(str, shape[::-1]))} voxels, which is not a volume; give a volume")
    if scan.values.size > MOST_VOXELS:
        raise Error(f"{scan.path}: has {scan.values.size} voxels, more than {MOST_VOXELS}; crop it in 3D Slicer")
    if not np.isfinite(scan.affine).all() or abs(np.linalg.det(scan.affine[:3, :3])) < 1e-9:
        raise Error(f"{scan.path}: the directions of its axes span no volume; export it again")
    if spacing.min() < _FINEST_MM or spacing.max() > _COARSEST_MM:
        raise Error(
            f"{scan.path}: voxels of {_by(spacing)} mm; a scan of arteries has {_FINEST_MM} to {_COARSEST_MM} mm: "
            "check the unit of its header (mm), or take the series with thin slices"
        )
    low, high = scan.bounds_mm()
    scan.facts.insert(
        0,
        f"{' x '.join(map(str, shape[::-1]))} voxels of {_by(spacing)} mm; {_by(high - low, 0)} mm from right to left, "
        "front to back, foot to head.",
    )
    if spacing.max() > _COARSE_MM:
        scan.facts.append(
            f"Steps of {spacing.max():.2f} mm: vessels with a radius below {1.5 * spacing.max():.1f} mm will be incomplete."
        )
    return scan


def _by(values: Any, digits: int = 3) -> str:
    return " x ".join(f"{value:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{value:.0f}" for value in values)


def as_int16(path: str, values: npt.NDArray[Any], slope: float, intercept: float) -> npt.NDArray[np.int16]:
    """slope * values + intercept in the 16 bits that the import computes with."""
    if values.dtype.kind not in "iuf":
        raise Error(f"{path}: holds {values.dtype}, not one number in each voxel; export it as 16-bit gray values")
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise Error(f"{path}: holds values that are not finite; repair the voxels, or export the scan again")
    if not (np.isfinite(slope) and np.isfinite(intercept)) or slope == 0:
        raise Error(f"{path}: has the rescale slope {slope} and intercept {intercept}; export it again")
    low, high = sorted((float(values.min()) * slope + intercept, float(values.max()) * slope + intercept))
    if low < -32768 or high > 32767:
        raise Error(
            f"{path}: has values from {low:.4g} to {high:.4g}, beyond 16 bits; Hounsfield units are -1024 to 3071: "
            "check the rescale slope, or convert it"
        )
    if slope == 1 and intercept == 0 and values.dtype.kind != "f":
        return values.astype(np.int16, copy=False)
    out = np.empty(values.shape, np.int16)
    for k in range(len(values)):  # slice by slice, for the memory
        out[k] = np.rint(values[k] * slope + intercept)
    return out


def _read_nifti(path: str) -> Scan:
    nibabel = need("nibabel")
    try:
        image = nibabel.load(path)
        header = image.header
        shape = tuple(n for n in image.shape)
        if header.get_data_dtype().names or (len(shape) == 5 and shape[4] > 1):
            raise Error(f"{path}: is a color or vector image (RGB); export the gray values of the CT")
        if len(shape) > 3 and int(np.prod(shape[3:])) != 1:
            raise Error(f"{path}: has {int(np.prod(shape[3:]))} volumes; export one of them, in the arterial phase")
        if int(np.prod(shape)) > MOST_VOXELS:
            raise Error(f"{path}: has {int(np.prod(shape))} voxels, more than {MOST_VOXELS}; crop it in 3D Slicer")
        raw = np.asarray(image.dataobj.get_unscaled()).reshape(shape[:3])
        slope, intercept = (1.0 if value is None else float(value) for value in (image.dataobj.slope, image.dataobj.inter))
        affine = np.asarray(image.affine, float)
        unit = header.get_xyzt_units()[0] if hasattr(header, "get_xyzt_units") else "mm"
    except Error:
        raise
    except MemoryError:
        raise Error(f"{path}: does not fit into memory; crop it in 3D Slicer") from None
    except Exception as error:  # nibabel raises many kinds for damaged files
        raise Error(f"{path}: cannot be read as NIfTI ({str(error)[:200]}); export it again") from None
    factor = {"meter": 1000.0, "micron": 0.001}.get(unit, 1.0)
    facts = [f"NIfTI; rescale slope {slope:g}, intercept {intercept:g}; unit {unit}."]
    # NIfTI is right-anterior-superior.
    affine[:3] *= factor
    affine[:2] *= -1
    if int(image.header["qform_code"]) == 0 and int(image.header["sform_code"]) == 0:
        facts.append("The file does not say how the patient lies (qform and sform code 0): left, back and head are assumed.")
    return Scan(np.ascontiguousarray(as_int16(path, raw.T, slope, intercept)), affine, facts, path)


def write_nifti(path: Path, values: npt.NDArray[Any], affine: npt.NDArray[np.float64]) -> None:
    """Writes a label map for 3D Slicer; `values` and `affine` as in Scan."""
    nibabel = need("nibabel")
    ras = affine.copy()
    ras[:2] *= -1
    image = nibabel.Nifti1Image(values.T, ras)
    image.header.set_xyzt_units("mm")
    nibabel.save(image, os.fspath(path))


def write_meta(path: Path, scan: Scan) -> None:
    """Writes an uncompressed MetaImage, as the simulator reads it: 16-bit values in LPS."""
    spacing = scan.spacing_mm
    directions = (scan.affine[:3, :3] / spacing).T.ravel()
    text = {
        "ObjectType": "Image", "NDims": "3", "BinaryData": "True", "BinaryDataByteOrderMSB": "False", "CompressedData": "False",
        "TransformMatrix": _words(directions), "Offset": _words(scan.affine[:3, 3]), "ElementSpacing": _words(spacing),
        "DimSize": _words(scan.values.shape[::-1]), "ElementType": "MET_SHORT", "ElementDataFile": "LOCAL",
    }
    with open(path, "wb") as file:
        file.write("".join(f"{key} = {value}\n" for key, value in text.items()).encode())
        for plane in scan.values:
            file.write(plane.astype("<i2").tobytes())


def _words(numbers: Any) -> str:
    return " ".join(f"{number:.10g}" for number in numbers)
