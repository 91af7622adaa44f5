"""The scan as the body in the X-ray picture: its file, its blur and the keys of the scene.

    found = torquer.importer.body.write(folder, scan, mesh, levels)
    found.text, found.facts
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import List

import numpy as np

from ._base import need
from .lumen import Levels
from .scan import Scan, write_meta
from .surface import Mesh

FILE = "scan.mha"
MOST_VOXELS = 1 << 28
"""The simulator reads no more."""
# Soft tissue has these values if they are Hounsfield units.
_TISSUE_HU = (-50, 150)
# Points of the wall at which the profile is measured, and its half length, mm.
_POINTS, _HALF_MM, _STEP_MM = 4000, 3.0, 0.1
_LEAST_BLUR_MM, _MOST_BLUR_MM = 0.2, 1.5


@dataclasses.dataclass(frozen=True)
class Body:
    """Keys of [effects.fluoroscopy], and sentences about them."""

    text: str
    facts: List[str]


def blur_mm(scan: Scan, mesh: Mesh, levels: Levels) -> float:
    """Standard deviation of the scan's point spread besides its voxels, by the profile across the wall.

    The median over the wall leaves out bone and other vessels beside it.
    """
    vectors = mesh.area_vectors()
    sizes = np.linalg.norm(vectors, axis=1)
    chosen = np.random.default_rng(1).choice(len(sizes), _POINTS, p=sizes / sizes.sum())
    normals = vectors[chosen] / sizes[chosen, None]
    along = np.arange(-_HALF_MM, _HALF_MM + _STEP_MM / 2, _STEP_MM)
    points = mesh.corners()[chosen].mean(axis=1)[:, None] + along[None, :, None] * normals[:, None]
    index = scan.indices(points.reshape(-1, 3))[:, ::-1].T
    values = need("scipy.ndimage").map_coordinates(scan.values, index, np.float32, order=1, mode="nearest")
    profile = np.median(values.reshape(len(chosen), -1), axis=0)
    shares = np.clip((profile - levels.tissue) / (levels.lumen - levels.tissue), 0, 1)
    # The profile of an edge with a blur s has the integral s / sqrt(pi) of share (1 - share).
    whole = float(np.sqrt(np.pi) * (shares * (1 - shares)).sum() * _STEP_MM)
    # A voxel is a mean over its box, and the values between voxels are linear.
    voxel = float((scan.spacing_mm**2).mean()) * (1 / 12 + 1 / 6)
    return float(np.clip(np.sqrt(max(0.0, whole**2 - voxel)), _LEAST_BLUR_MM, _MOST_BLUR_MM))


def write(folder: pathlib.Path, scan: Scan, mesh: Mesh, levels: Levels) -> Body:
    """Writes the scan for the X-ray pictures, if its values are Hounsfield units."""
    low, high = _TISSUE_HU
    if not low <= levels.tissue <= high:
        why = f"its soft tissue has {levels.tissue:.0f}, so its values are no Hounsfield units ({low} to {high})"
    elif scan.values.size > MOST_VOXELS:
        why = f"it has {scan.values.size} voxels, more than {MOST_VOXELS}"
    else:
        write_meta(folder / FILE, scan)
        blur = blur_mm(scan, mesh, levels)
        text = f"""# The scan, with blood in place of the contrast agent in the vessels.
body = "ct"
ct_file = "{FILE}"
# By the profile of the scan across the vessel's wall.
ct_blur_mm = {blur:.2f}
"""
        return Body(text, [f"X-ray pictures show the scan ({FILE}), whose blur is {blur:.2f} mm."])
    return Body("", [f"X-ray pictures show a model of a body instead of the scan: {why}."])
