"""Reads a CT series from a folder of DICOM files."""

from __future__ import annotations

import pathlib
from typing import Any, Dict, List, Optional

import numpy as np

from ._base import Error, need
from .scan import MOST_VOXELS, Scan, as_int16

_MOST_FILES = 20_000
# Deviation of a slice from its place in an even stack: share of the step between slices.
_UNEVEN = 0.1
# If more steps than this share are long, each second slice is from another stack, and none is missing.
_MOST_MISSING = 0.25
# Stacks that may be interleaved under one UID, such as the phases of a heart.
_MOST_STACKS = 4
# Deviation of a slice from the line through the others: share of a pixel.
_SHIFTED = 0.5


def _header(path: pathlib.Path) -> Any:
    """Header of a DICOM file with an image; None for other files."""
    pydicom = need("pydicom")
    if not path.is_file():
        return None
    try:
        header = pydicom.dcmread(path, stop_before_pixels=True)
    except (pydicom.errors.InvalidDicomError, OSError, ValueError, KeyError, AttributeError, NotImplementedError):
        return None
    return header if "Rows" in header and "SeriesInstanceUID" in header else None


def _described(files: List[Any]) -> str:
    first = files[0][1]
    text = str(first.get("SeriesDescription", "")).strip() or "without a description"
    return f"{text[:60]} ({first.get('Modality', 'unknown')}, {len(files)} files)"


def _series_of(folder: pathlib.Path) -> List[List[Any]]:
    paths = [folder] if folder.is_file() else sorted(path for path in folder.rglob("*"))
    if len(paths) > _MOST_FILES:
        raise Error(f"{folder}: holds more than {_MOST_FILES} files; give the folder of one study")
    found: Dict[str, List[Any]] = {}
    for path in paths:
        header = _header(path)
        if header is not None:
            found.setdefault(str(header.SeriesInstanceUID), []).append((path, header))
    if not found:
        raise Error(f"{folder}: holds no DICOM image; give the folder with the files of the CT series")
    return sorted(found.values(), key=lambda files: (str(files[0][1].get("SeriesNumber", "")).zfill(12), str(files[0][0])))


def _chosen(folder: pathlib.Path, number: Optional[int]) -> List[Any]:
    series = _series_of(folder)
    listed = "".join(f"\n  --series {k}: {_described(files)}" for k, files in enumerate(series, 1))
    if number is None and len(series) > 1:
        raise Error(f"{folder}: holds {len(series)} series; choose one:{listed}")
    if number is not None and not 1 <= number <= len(series):
        raise Error(f"--series {number}: there is no such series in {folder}; choose one:{listed}")
    return series[(number or 1) - 1]


def _value(path: Any, header: Any, name: str, count: int) -> Any:
    try:
        out = np.array([float(value) for value in header[name].value])
    except (KeyError, TypeError, ValueError):
        out = np.array([])
    if len(out) != count or not np.isfinite(out).all():
        raise Error(f"{path}: {name} is missing or not {count} numbers; export the series again from the archive")
    return out


def _refuse_kinds(files: List[Any]) -> None:
    path, first = files[0]
    if first.get("Modality") != "CT":
        raise Error(
            f"{path}: is of modality {first.get('Modality', 'unknown')}, not CT; its values are no Hounsfield units: segment the "
            "vessels in 3D Slicer, and give the label map with --label"
        )
    for path, header in files:
        if header.get("SamplesPerPixel", 1) != 1:
            raise Error(f"{path}: is a color picture (RGB), as of a report; give the series of the CT itself")
        if int(header.get("NumberOfFrames", 1) or 1) != 1:
            raise Error(f"{path}: holds several frames (enhanced CT); convert it to NIfTI, as with dcm2niix")
        for name in ("RescaleIntercept", "RescaleSlope"):
            if header.get(name) is None:
                raise Error(
                    f"{path}: {name} is missing, so its values are no Hounsfield units; export the series again from the archive"
                )
        for name in ("Rows", "Columns"):
            if header[name].value != first[name].value:
                raise Error(f"{path}: has another size than {files[0][0]}; export the series alone")


def read_series(folder: pathlib.Path, number: Optional[int]) -> Scan:
    """Reads the slices in the order of their places. Raises Error if one is missing or there twice."""
    files = _chosen(folder, number)
    _refuse_kinds(files)
    if len(files) < 3:
        raise Error(f"{folder}: the series has {len(files)} slices, which is not a volume; give the whole series")
    path, first = files[0]
    turn = _value(path, first, "ImageOrientationPatient", 6)
    along = np.cross(turn[:3], turn[3:])
    places = np.array([_value(p, header, "ImagePositionPatient", 3) for p, header in files])
    for p, header in files:
        if np.abs(_value(p, header, "ImageOrientationPatient", 6) - turn).max() > 1e-3:
            raise Error(f"{p}: is turned against {path}; the series holds slices of several directions: give one series")
    order = np.argsort(places @ along, kind="stable")
    places, files = places[order], [files[k] for k in order]
    _refuse_uneven(folder, files, places @ along)
    _refuse_stacks(folder, files)
    spacing = _same_spacing(files)
    _refuse_shifted(files, places - np.outer(places @ along, along), _SHIFTED * float(spacing.min()))
    rows, columns = int(first.Rows), int(first.Columns)
    if rows * columns * len(files) > MOST_VOXELS:
        raise Error(f"{folder}: has {rows * columns * len(files)} voxels, more than {MOST_VOXELS}; crop it in 3D Slicer")
    affine = np.eye(4)
    affine[:3, 0], affine[:3, 1] = turn[:3] * spacing[1], turn[3:] * spacing[0]
    affine[:3, 2] = (places[-1] - places[0]) / (len(files) - 1)
    affine[:3, 3] = places[0]
    values = np.empty((len(files), rows, columns), np.int16)
    for k, (p, header) in enumerate(files):
        values[k] = _pixels(p)
    tilt = float(np.degrees(np.arccos(min(1.0, abs(affine[:3, 2] @ along) / np.linalg.norm(affine[:3, 2])))))
    facts = [
        f"DICOM series: {_described(files)}; rescale slope {first.get('RescaleSlope', 1)}, intercept "
        f"{first.get('RescaleIntercept', 0)}; every slice is there."
    ]
    if tilt > 0.1:
        facts.append(f"Gantry tilt of {tilt:.1f} degrees: voxels are placed by the positions of the slices.")
    return Scan(values, affine, facts, str(folder))


def _refuse_uneven(folder: pathlib.Path, files: List[Any], heights: Any) -> None:
    steps = np.diff(heights)
    usual = float(np.median(steps))
    short, long_ = steps < (1 - _UNEVEN) * usual, steps > (1 + _UNEVEN) * usual
    if usual < 1e-3 or short.any() or long_.mean() > _MOST_MISSING:
        k = int(steps.argmin())
        raise Error(
            f"{folder}: {files[k][0].name} and {files[k + 1][0].name} lie {steps[k]:.3f} mm apart, others {steps.max():.3f} mm: "
            "two series are interleaved, such as two phases; export one of them"
        )
    if long_.any():
        k = int(np.argmax(long_))
        raise Error(
            f"{folder}: between {files[k][0].name} and {files[k + 1][0].name} are {steps[k]:.3f} mm, elsewhere {usual:.3f} mm: a "
            "slice is missing; copy the series again"
        )


def _refuse_stacks(folder: pathlib.Path, files: List[Any]) -> None:
    """Refuses stacks that together have even steps, by the numbers of their slices: each second one counts on."""
    try:
        numbers = np.array([int(header["InstanceNumber"].value) for _, header in files])
    except (KeyError, TypeError, ValueError):
        return
    for stacks in range(2, _MOST_STACKS + 1):
        if len(numbers) < 3 * stacks:
            return
        steps = numbers[stacks:] - numbers[:-stacks]
        # One stack alone counts on by the number of stacks.
        if steps[0] != 0 and (steps == steps[0]).all() and len(np.unique(np.diff(numbers))) > 1:
            raise Error(
                f"{folder}: {files[0][0].name} and {files[1][0].name} lie next to each other, but are slices {numbers[0]} and "
                f"{numbers[1]}: {stacks} series are interleaved, such as two phases; export one of them"
            )


def _same_spacing(files: List[Any]) -> Any:
    """PixelSpacing of all slices."""
    spacing = _value(files[0][0], files[0][1], "PixelSpacing", 2)
    for path, header in files:
        other = _value(path, header, "PixelSpacing", 2)
        if np.abs(other / spacing - 1).max() > 1e-3:
            raise Error(
                f"{path}: has pixels of {other[0]:g} x {other[1]:g} mm (PixelSpacing), and {files[0][0].name} has "
                f"{spacing[0]:g} x {spacing[1]:g} mm; export one series alone"
            )
    return spacing


def _refuse_shifted(files: List[Any], places: Any, most_mm: float) -> None:
    """Refuses a slice beside the line through the others, as from another reconstruction. `places`: within the slices."""
    share = np.linspace(0, 1, len(places))[:, None]
    off = places - places[0] - share * (places[-1] - places[0])
    # The ends of the line may be the shifted ones.
    off = np.linalg.norm(off - np.median(off, axis=0), axis=1)
    k = int(off.argmax())
    if off[k] > most_mm:
        raise Error(
            f"{files[k][0]}: its ImagePositionPatient lies {off[k]:.2f} mm beside the line through the other slices; export "
            "one series alone"
        )


def _pixels(path: pathlib.Path) -> Any:
    try:
        data = need("pydicom").dcmread(path)
        pixels = data.pixel_array
        slope, intercept = float(data.get("RescaleSlope", 1)), float(data.get("RescaleIntercept", 0))
    except Error:
        raise
    except Exception as error:  # pydicom and its decoders raise many kinds for damaged files
        raise Error(
            f"{path}: its pixels cannot be read ({str(error)[:200]}); copy it again, or install python3-gdcm for compressed ones"
        ) from None
    return as_int16(str(path), pixels[None], slope, intercept)[0]
