"""Lumen in a scan from seeds, with bone in the way: two competing thresholds.

    levels = torquer.importer.lumen.levels_of(scan, seeds_mm)
    label = torquer.importer.lumen.segment(scan, levels, seeds_mm)

Bone begins above the lumen's level, the lumen above the half level between it and the tissue. Both cores grow
alternately, voxel by voxel, into all voxels above the half level. The rim of bone passes through every level of the
lumen; in this way it stays with the bone. Away from bone thin vessels are followed below the half level, because their
own partial volume never reaches it.
"""

from __future__ import annotations

import dataclasses
from typing import Any, List, Tuple

import numpy as np
import numpy.typing as npt

from ._base import Error, Points, as_text, need
from ._growth import Flat, Grid, compete, flood, grow_once, within
from .scan import Scan

# Radius about a seed in which its level is measured, and half the side of the box for its surroundings.
_SEED_MM, _AROUND_MM = 1.5, 40.0
# Lowest value of soft tissue, HU. Lung, fat and air do not count as surroundings.
_LEAST_TISSUE = -50
# Bone begins this share of the contrast above the lumen: 130 HU of 300.
_BONE_SHARE = 0.43
_LEAST_BONE_MM3 = 12.0
# Distances from bone: of the lumen's core, and of thin vessels that are followed below the half level.
_CORE_FROM_BONE_MM, _THIN_FROM_BONE_MM = 1.3, 2.0
# Lowest level of thin vessels: standard deviations of the noise, and share of the contrast.
_THIN_SIGMAS, _THIN_SHARE = 4.5, 0.25
# Least contrast: standard deviations of the noise, and HU.
_LEAST_SIGMAS, _LEAST_CONTRAST = 4.0, 80.0
_MOST_LUMEN = 900.0
# Metal: above all bone, near the lumen.
_METAL, _METAL_MM, _MOST_METAL_MM3 = 2500, 3.0, 5.0
# A vessel is cut off lengthwise if its section with the border is longer than _CUT_MM and _CUT_RATIO widths.
_CUT_MM, _CUT_RATIO = 30.0, 3.0
# Arteries of the trunk have less than 1 liter.
_MOST_ML = 1500.0

BODY, LUMEN, BONE = 0, 1, 2
"""Values of the label map."""


@dataclasses.dataclass(frozen=True)
class Levels:
    """Levels of a scan, in its unit: Hounsfield units in CT."""

    tissue: float
    lumen: float
    noise: float
    """Standard deviation in the smoothed scan."""

    @property
    def half(self) -> float:
        return (self.tissue + self.lumen) / 2

    @property
    def bone(self) -> float:
        return self.lumen + _BONE_SHARE * (self.lumen - self.tissue)

    @property
    def thin(self) -> float:
        least = max(_THIN_SIGMAS * self.noise, _THIN_SHARE * (self.lumen - self.tissue))
        return min(self.half, self.tissue + least)

    def __str__(self) -> str:
        return (
            f"lumen {self.lumen:.0f}, tissue {self.tissue:.0f}, wall at {self.half:.0f}, thin vessels from {self.thin:.0f}, "
            f"bone above {self.bone:.0f}, noise {self.noise:.1f}"
        )


def smoothed(scan: Scan) -> npt.NDArray[np.int16]:
    """The scan after a Gaussian of half a voxel, or 0.28 mm in finer voxels."""
    sigma = np.maximum(0.5, np.minimum(0.7, 0.28 / scan.spacing_mm))[::-1]
    out: npt.NDArray[np.int16] = need("scipy.ndimage").gaussian_filter(
        scan.values, sigma, output=np.int16, mode="nearest", truncate=2.5
    )
    return out


def _box(scan: Scan, center: Any, half_mm: float) -> npt.NDArray[Any]:
    reach = np.ceil(half_mm / scan.spacing_mm).astype(int)
    low = np.maximum(0, center - reach)
    high = center + reach + 1
    return scan.values[low[2] : high[2], low[1] : high[1], low[0] : high[0]]


def _seed_voxels(scan: Scan, seeds_mm: Points) -> List[npt.NDArray[np.intp]]:
    out = []
    for seed in seeds_mm:
        index = scan.indices(seed)
        if not scan.inside(index):
            low, high = scan.bounds_mm()
            raise Error(
                f"--seed {as_text(seed)}: lies outside the scan, which reaches from {as_text(low)} to {as_text(high)} mm; "
                "give left, posterior, superior in mm (3D Slicer shows R, A, S: change the first two signs)"
            )
        out.append(np.rint(index).astype(np.intp))
    return out


def levels_of(scan: Scan, seeds_mm: Points) -> Levels:
    """Levels about the seeds. Raises Error if a seed has no contrast."""
    found: List[Levels] = []
    for seed, center in zip(seeds_mm, _seed_voxels(scan, seeds_mm)):
        lumen = float(np.median(_box(scan, center, _SEED_MM)))
        around = _box(scan, center, _AROUND_MM)
        # Differences of neighbors: sqrt(2) times the noise, and less after the smoothing.
        steps = np.diff(_box(scan, center, 4 * _SEED_MM).astype(float), axis=2)
        noise = float(np.median(np.abs(steps))) / 0.6745 / np.sqrt(2) * 0.6
        low, high = min(_LEAST_TISSUE, 0.6 * lumen - 50), 0.6 * lumen
        values = around[(around >= low) & (around <= high)]
        if len(values) < 100 or high - low < 10:
            tissue = lumen
        else:
            counts, edges = np.histogram(values, np.arange(np.floor(low), high + 10, 10))
            at = int(counts.argmax())
            tissue = float(values[(values >= edges[at] - 10) & (values <= edges[at] + 20)].mean())
        if lumen > _MOST_LUMEN:
            raise Error(
                f"--seed {as_text(seed)}: the scan has {lumen:.0f} there, which is bone or metal; give a seed in the lumen"
            )
        if lumen - tissue < max(_LEAST_CONTRAST, _LEAST_SIGMAS * noise):
            raise Error(
                f"--seed {as_text(seed)}: the scan has {lumen:.0f} there, and {tissue:.0f} in the tissue around, with noise of "
                f"{noise:.0f}: there is no contrast agent. Give a seed in the lumen, or a series of the arterial phase"
            )
        found.append(Levels(tissue, lumen, noise))
    return Levels(
        float(np.median([one.tissue for one in found])),
        max(one.lumen for one in found),
        float(np.median([one.noise for one in found])),
    )


def _bone_core(scan: Scan, picture: npt.NDArray[np.int16], levels: Levels) -> npt.NDArray[np.bool_]:
    ndimage = need("scipy.ndimage")
    core = picture > levels.bone
    parts, count = ndimage.label(core)
    sizes = np.bincount(parts.ravel(), minlength=count + 1)
    small = sizes * np.prod(scan.spacing_mm) < _LEAST_BONE_MM3
    if small[1:].any():
        core &= ~small[parts]
    return core


def _steps(scan: Scan, mm: float) -> int:
    """Steps of the octagonal ball of this radius; a step has the mean length of 1.1 voxels."""
    return max(1, int(round(mm / (1.1 * float(scan.spacing_mm.mean())))))


def segment(scan: Scan, picture: npt.NDArray[np.int16], levels: Levels, seeds_mm: Points) -> npt.NDArray[np.uint8]:
    """Label map of BODY, LUMEN and BONE. `picture` is the smoothed scan.

    Raises Error if a seed is not in the lumen, or if the lumen is not an artery.
    """
    grid = Grid(scan.values.shape)
    bone = np.flatnonzero(grid.bordered(_bone_core(scan, picture, levels), False, bool))
    above = grid.bordered(picture > levels.half, False, bool)
    free = above.copy()
    free[within(grid, bone, _steps(scan, _CORE_FROM_BONE_MM))] = False
    starts = [grid.at(index) for index in _seed_voxels(scan, seeds_mm)]
    for seed, start in zip(seeds_mm, starts):
        if not free[start]:
            raise Error(
                f"--seed {as_text(seed)}: is not in the lumen ({levels}), or nearer to bone than {_CORE_FROM_BONE_MM} mm; "
                "give a seed in the middle of a wide artery"
            )
    core = flood(np.unique(np.array(starts, np.intp)), grid.by_faces, free)
    del free
    lumen, bone = compete(core, bone, above, grid.by_faces)
    del above
    owner = np.zeros(int(np.prod(grid.shape)), np.uint8)
    owner[bone] = BONE
    owner[lumen] = LUMEN
    owner[_thin_vessels(scan, grid, picture, levels, lumen, bone)] = LUMEN
    label = np.ascontiguousarray(grid.inner(owner))
    del owner
    _check(scan, label)
    return label


def _thin_vessels(
    scan: Scan, grid: Grid, picture: npt.NDArray[np.int16], levels: Levels, lumen: Flat, bone: Flat
) -> Flat:
    """Voxels below the half level that continue the lumen, away from bone."""
    free = grid.bordered(picture > levels.thin, False, bool)
    free[within(grid, bone, _steps(scan, _THIN_FROM_BONE_MM))] = False
    free[lumen] = False
    return flood(grow_once(lumen, grid.by_faces, free), grid.by_faces, free)


def _check(scan: Scan, label: npt.NDArray[np.uint8]) -> None:
    voxel_mm3 = float(np.prod(scan.spacing_mm))
    lumen = label == LUMEN
    ml = np.count_nonzero(lumen) * voxel_mm3 / 1000
    if ml > _MOST_ML:
        raise Error(
            f"{scan.path}: the lumen connected with the seeds has {ml:.0f} mL, more than arteries have; it runs into "
            "bone, a heart chamber or veins: cut them in 3D Slicer, and give the label map"
        )
    metal = np.flatnonzero((scan.values > _METAL).ravel())
    if len(metal) * voxel_mm3 > _MOST_METAL_MM3:
        grid = Grid(label.shape)
        k, j, i = np.unravel_index(metal, label.shape)
        flat = ((k + 1) * grid.shape[1] + j + 1) * grid.shape[2] + i + 1
        near = within(grid, np.asarray(flat, np.intp), _steps(scan, _METAL_MM))
        touched = np.argwhere(grid.inner(near) & lumen)
        if len(touched):
            place = scan.points_mm(touched[len(touched) // 2][::-1])
            raise Error(
                f"{scan.path}: metal (above {_METAL}) lies within {_METAL_MM:g} mm of the lumen at {as_text(place)} mm; its "
                "streaks falsify the wall: draw the vessel there in 3D Slicer, and give the label map"
            )
    _refuse_cut_lengthwise(scan, lumen)


def _refuse_cut_lengthwise(scan: Scan, lumen: npt.NDArray[np.bool_]) -> None:
    """Refuses a vessel that runs along a face of the scan, which then has only a part of it."""
    ndimage = need("scipy.ndimage")
    for axis in range(3):
        across = [n for n in range(3) if n != axis]
        spacing = scan.spacing_mm[::-1][across]
        for end in (0, -1):
            parts, _ = ndimage.label(np.take(lumen, end, axis))
            for number, where in enumerate(ndimage.find_objects(parts), 1):
                at = np.argwhere(parts[where] == number) * spacing
                area = len(at) * float(np.prod(spacing))
                length = float(np.linalg.norm(np.ptp(at, axis=0)))
                # An ellipse of this length and area is this wide.
                if length > _CUT_MM and length > _CUT_RATIO * area / length * 4 / np.pi:
                    index = np.zeros(3)
                    index[axis] = 0 if end == 0 else lumen.shape[axis] - 1
                    index[across] = [part.start for part in where]
                    raise Error(
                        f"{scan.path}: a vessel is cut off lengthwise by the border of the scan, over {length:.0f} mm from "
                        f"{as_text(scan.points_mm(index[::-1]))} mm; give a scan with the whole vessel, or crop this part away"
                    )


def wall_picture(
    scan: Scan, picture: npt.NDArray[np.int16], label: npt.NDArray[np.uint8], levels: Levels
) -> Tuple[npt.NDArray[np.float32], npt.NDArray[np.intp]]:
    """Picture whose level 0.5 is the wall, in the box of the lumen, and the box's first (column, row, slice).

    It is the height above the tissue, divided by the height of the vessel. The vessel's height is the largest one
    nearby, up to the lumen's level. So a thin vessel is cut at half the height that it reaches. Bone and all that is
    not next to the label lie below the level.
    """
    ndimage = need("scipy.ndimage")
    where = ndimage.find_objects((label == LUMEN).view(np.uint8))[0]
    low = np.array([part.start for part in where])
    box = tuple(slice(max(0, part.start - 2), part.stop + 2) for part in where)
    part = picture[box]
    mask = label[box] == LUMEN
    ridge = np.where(mask, part, np.int16(levels.tissue))
    size = np.maximum(3, 2 * np.ceil(1.2 / scan.spacing_mm[::-1]).astype(int) + 1)
    ridge = ndimage.maximum_filter(ridge, size=tuple(size))
    ridge = ndimage.uniform_filter(ridge, size=tuple(size))
    near = ndimage.binary_dilation(mask, ndimage.generate_binary_structure(3, 2))
    out = np.zeros(part.shape, np.float32)
    height = np.clip(ridge[near].astype(np.float32), levels.thin, levels.lumen) - np.float32(levels.tissue)
    out[near] = (part[near] - np.float32(levels.tissue)) / height
    bone = label[box] == BONE
    out[bone] = np.minimum(out[bone], np.float32(0.5 - 0.2))
    return out, np.maximum(0, low - 2)[::-1]


def trim(label: npt.NDArray[np.uint8], values: npt.NDArray[np.float32], first: npt.NDArray[np.intp]) -> None:
    """Takes the rim beyond the wall out of the lumen, so that the label map has the vessel of the surface.

    The rim was found like a thin vessel, below half of the lumen's level. `values` and `first` are those of wall_picture.
    """
    low = first[::-1]
    box = tuple(slice(start, start + size) for start, size in zip(low, values.shape))
    part = label[box]
    part[(part == LUMEN) & (values < 0.5)] = BODY
