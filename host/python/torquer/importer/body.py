"""The scan as the body in the X-ray picture: its file, its blur and the keys of the scene.

    found = torquer.importer.body.write(folder, scan, mesh, levels)
    found.text, found.facts

    levels = torquer.importer.body.levels_at(scan, mesh)  # for a scan that the mesh was not made from
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import List

import numpy as np
import numpy.typing as npt

from ._base import Error, as_text, need
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
_ALONG_MM = np.arange(-_HALF_MM, _HALF_MM + _STEP_MM / 2, _STEP_MM)
_LEAST_BLUR_MM, _MOST_BLUR_MM = 0.2, 1.5
# A lumen with less than this above its surroundings has no contrast agent, by which the blur could be measured.
_LEAST_AGENT_HU = 80
# A scan with less of the wall than the first share is refused. With less than the second, the report gives the share.
_LEAST_SHARE, _WHOLE_SHARE = 0.5, 0.98


@dataclasses.dataclass(frozen=True)
class Body:
    """Keys of [effects.fluoroscopy], and sentences about them."""

    text: str
    facts: List[str]


def _profile(scan: Scan, mesh: Mesh) -> npt.NDArray[np.float64]:
    """Values across the wall at the steps of _ALONG_MM, from the lumen outward.

    The median over the wall leaves out bone and other vessels beside it, and noise.
    """
    vectors = mesh.area_vectors()
    sizes = np.linalg.norm(vectors, axis=1)
    chosen = np.random.default_rng(1).choice(len(sizes), _POINTS, p=sizes / sizes.sum())
    normals = vectors[chosen] / sizes[chosen, None]
    points = mesh.corners()[chosen].mean(axis=1)[:, None] + _ALONG_MM[None, :, None] * normals[:, None]
    index = scan.indices(points.reshape(-1, 3))[:, ::-1].T
    values = need("scipy.ndimage").map_coordinates(scan.values, index, np.float32, order=1, mode="nearest")
    return np.asarray(np.median(values.reshape(len(chosen), -1), axis=0), float)


def levels_at(scan: Scan, mesh: Mesh) -> Levels:
    """Levels on both sides of a wall that comes from elsewhere. Raises Error if the scan has less than half of the wall."""
    inside = _share_inside(scan, mesh)
    if inside < _LEAST_SHARE:
        low, high = scan.bounds_mm()
        corners = mesh.corners().reshape(-1, 3)
        raise Error(
            f"{scan.path}: has {100 * inside:.0f} % of the vessel, which reaches from {as_text(corners.min(axis=0))} to "
            f"{as_text(corners.max(axis=0))} mm; the scan reaches from {as_text(low)} to {as_text(high)} mm. Give the scan in "
            "which the vessel was segmented; for a surface, see --space"
        )
    profile = _profile(scan, mesh)
    half = len(profile) // 2
    return Levels(tissue=float(np.median(profile[-10:])), lumen=float(profile[:half].max()), noise=0.0)


def _share_inside(scan: Scan, mesh: Mesh) -> float:
    index = scan.indices(mesh.corners().mean(axis=1))
    return float(((index >= -0.5) & (index <= np.array(scan.values.shape[::-1]) - 0.5)).all(axis=1).mean())


def blur_mm(scan: Scan, mesh: Mesh, levels: Levels) -> float:
    """Standard deviation of the scan's point spread besides its voxels, by the profile across the wall."""
    profile = _profile(scan, mesh)
    shares = np.clip((profile - levels.tissue) / (levels.lumen - levels.tissue), 0, 1)
    # The profile of an edge with a blur s has the integral s / sqrt(pi) of share (1 - share).
    whole = float(np.sqrt(np.pi) * (shares * (1 - shares)).sum() * _STEP_MM)
    # A voxel is a mean over its box, and the values between voxels are linear.
    voxel = float((scan.spacing_mm**2).mean()) * (1 / 12 + 1 / 6)
    return float(np.clip(np.sqrt(max(0.0, whole**2 - voxel)), _LEAST_BLUR_MM, _MOST_BLUR_MM))


def write(folder: pathlib.Path, scan: Scan, mesh: Mesh, levels: Levels) -> Body:
    """Writes the scan for the X-ray pictures, if its values are Hounsfield units."""
    low, high = _TISSUE_HU
    why = ""
    if not low <= levels.tissue <= high:
        why = f"its soft tissue has {levels.tissue:.0f}, so its values are no Hounsfield units ({low} to {high})"
    elif scan.values.size > MOST_VOXELS:
        why = f"it has {scan.values.size} voxels, more than {MOST_VOXELS}"
    if why:
        return Body("", [f"X-ray pictures show a model of a body instead of the scan: {why}."])
    write_meta(folder / FILE, scan)
    text = f'''# The scan, with blood in place of the contrast agent in the vessels.
body = "ct"
ct_file = "{FILE}"
'''
    facts = []
    inside = _share_inside(scan, mesh)
    if inside < _WHOLE_SHARE:
        facts.append(f"The scan has {100 * inside:.0f} % of the vessel.")
    if levels.lumen - levels.tissue < _LEAST_AGENT_HU:
        # The simulator's default is then as good as any value, since it has no contrast agent to spread.
        facts.append(
            f"X-ray pictures show the scan ({FILE}). It has {levels.lumen:.0f} in the vessel and {levels.tissue:.0f} around it: "
            "it has no contrast agent there, or it has another position than the vessel."
        )
    else:
        blur = blur_mm(scan, mesh, levels)
        text += f"# By the profile of the scan across the vessel's wall.\nct_blur_mm = {blur:.2f}\n"
        facts.append(f"X-ray pictures show the scan ({FILE}), whose blur is {blur:.2f} mm.")
    return Body(text, facts)
