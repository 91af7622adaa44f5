"""Scans of known truth: the lumen of a scene as a CT angiography with bone, partial volume, blur and noise."""

from __future__ import annotations

import math
import tomllib
from typing import Any, Tuple

import numpy as np
import numpy.typing as npt

from .. import Scene
from ._base import Points, need
from .scan import Scan

TISSUE, LUMEN, BONE, MARROW = 50.0, 350.0, 900.0, 250.0
NOISE = 25.0
"""Standard deviation, HU."""
BLUR_MM = 0.6
# Bone: rods with a shell behind and beside the vessel, that leave this gap to the wall.
_GAP_MM, _SHELL_MM, _ROD_MM = 1.5, 1.5, 10.0
_MARGIN_MM = 8.0
_AXES = {"x": 0, "y": 1, "z": 2}
_CHUNK = 2_000_000


class Truth:
    """Lumen of a scene in the patient's frame, LPS and mm."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        axes = tomllib.loads(scene.text).get("patient_axes", {})
        names = [axes.get("left", "+x"), axes.get("posterior", "+y"), axes.get("superior", "+z")]
        self._turn = np.zeros((3, 3))  # from the scene's frame to LPS
        for row, name in enumerate(names):
            self._turn[row, _AXES[name[-1]]] = -1 if name[0] == "-" else 1
        corners = self.to_lps(scene.bounds_mm)
        self.low, self.high = corners.min(axis=0), corners.max(axis=0)

    def to_lps(self, points: Any) -> Points:
        out: Points = np.asarray(points, float) @ self._turn.T
        return out

    def from_lps(self, points: Any) -> Points:
        out: Points = np.asarray(points, float) @ self._turn
        return out

    def depth_mm(self, points: Any) -> npt.NDArray[np.float64]:
        """Distance from the wall, positive in the lumen; exact within 3 mm of it."""
        return self.scene.clearance_mm(self.from_lps(points))

    def wall_points(self, count: int, seed: int = 1) -> Points:
        """Points on the wall, about evenly spread."""
        random = np.random.default_rng(seed)
        found = np.zeros((0, 3))
        # Points of a layer about the wall, moved to it along the gradient.
        while len(found) < count:
            points = self.low + random.random((200_000, 3)) * (self.high - self.low)
            points = points[np.abs(self.depth_mm(points)) < 1.0]
            for _ in range(2):
                steps = [self.depth_mm(points + 1e-3 * np.eye(3)[k]) - self.depth_mm(points - 1e-3 * np.eye(3)[k]) for k in range(3)]
                slope = np.stack(steps, axis=1) / 2e-3
                slope /= np.maximum(0.1, np.linalg.norm(slope, axis=1))[:, None]
                points = points - self.depth_mm(points)[:, None] * slope
            found = np.vstack([found, points[np.abs(self.depth_mm(points)) < 0.02]])
        return found[:count]


def _rods(points: Points, low: Points, high: Points) -> npt.NDArray[np.float64]:
    """Depth in rods along the head's direction, behind and to the right of the box of the vessel."""
    middle = (low + high) / 2
    out = np.full(len(points), -np.inf)
    for across, along in ((np.array([middle[0], high[1]]), 0), (np.array([low[0], middle[1]]), 1)):
        center = across.copy()
        center[1 - along] += (_ROD_MM / 2) * (1 if along == 0 else -1)
        out = np.maximum(out, _ROD_MM - np.linalg.norm(points[:, :2] - center, axis=1))
    return out


def scan_of(truth: Truth, voxel_mm: float, seed: int = 1) -> Scan:
    """The scan with cubic voxels, and with a margin about the vessel."""
    low = truth.low - _MARGIN_MM
    size = np.ceil((truth.high + _MARGIN_MM - low) / voxel_mm).astype(int) + 1
    affine = np.diag([voxel_mm] * 3 + [1.0])
    affine[:3, 3] = low
    values = np.empty(tuple(size[::-1]), np.float32)
    slices = max(1, _CHUNK // int(size[0] * size[1]))
    for first in range(0, int(size[2]), slices):
        k, j, i = np.meshgrid(np.arange(first, min(first + slices, size[2])), np.arange(size[1]), np.arange(size[0]), indexing="ij")
        points = np.stack([i, j, k], axis=-1).reshape(-1, 3) * voxel_mm + low
        values[first : first + slices] = _hounsfield(truth, points, voxel_mm).reshape(k.shape)
    values = need("scipy.ndimage").gaussian_filter(values, BLUR_MM / voxel_mm)
    values += np.random.default_rng(seed).normal(0, NOISE, values.shape).astype(np.float32)
    return Scan(np.rint(values).astype(np.int16), affine, [], truth.scene.name)


def _hounsfield(truth: Truth, points: Points, voxel_mm: float) -> npt.NDArray[np.float64]:
    depth = truth.depth_mm(points)
    bone = np.minimum(_rods(points, truth.low, truth.high), -depth - _GAP_MM)

    def share(of: Any) -> Any:
        """Part of a voxel on the inner side of a plane at this depth."""
        return np.clip(0.5 + of / voxel_mm, 0, 1)

    out: npt.NDArray[np.float64] = (
        TISSUE + (LUMEN - TISSUE) * share(depth) + (BONE - TISSUE) * share(bone) + (MARROW - BONE) * share(bone - _SHELL_MM)
    )
    return out


def seed_of(truth: Truth) -> Tuple[float, float, float]:
    """The place deepest in the lumen, in LPS."""
    step = float(np.clip(np.cbrt(np.prod(truth.high - truth.low) / 500_000), 0.3, math.inf))
    grids = [np.arange(truth.low[k], truth.high[k], step) for k in range(3)]
    points = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 3)
    best = points[int(truth.depth_mm(points).argmax())]
    return float(best[0]), float(best[1]), float(best[2])
