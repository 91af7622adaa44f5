"""Rigid registration of wires with the lumen of a surface, and the minima that compete."""

from __future__ import annotations

import dataclasses
from typing import Any, List, Sequence, Tuple

import numpy as np

from .. import Scene, Surface
from .._polyline import rms
from ._base import Array, Error, need

STARTS, LARGEST_TURN_DEG, SHIFT_MM = 40, 30.0, 10.0
ALIKE = 1.25
"""Ratio of RMS violations within which minima compete."""
_SAME_DEG, _SAME_MM = 3.0, 3.0
_ROBUST_MM, _MOST_ROUNDS = 1.0, 60
# A degree and a half and a millimeter move the ends of a wire of 80 mm alike.
_SCALES = np.array([0.025] * 3 + [1.0] * 3)
_INWARD_MM, _TRIES = 1.5, 40


@dataclasses.dataclass(frozen=True)
class Minimum:
    """A place of the wires in the frame of the surface."""

    turn_deg: Tuple[float, float, float]
    """Rotation vector about `center_mm`."""
    shift_mm: Tuple[float, float, float]
    center_mm: Tuple[float, float, float]
    violation_mm: float
    """RMS distance by which points lack room, over all points."""
    outside_percent: float
    found: int
    """Number of starts that led here."""

    def moved(self, points: Array) -> Array:
        out: Array = _moved(points, np.radians(self.turn_deg), np.array(self.shift_mm), np.array(self.center_mm))
        return out


def _moved(points: Array, turn: Any, shift: Any, center: Any) -> Any:
    rotation = need("scipy.spatial.transform").Rotation.from_rotvec(turn)
    return rotation.apply(points - center) + center + shift


def lumen_of(path: str, unit: str) -> Scene:
    """A scene with the lumen of a surface file, for its distances from the wall."""
    surface = Surface(path, unit)
    corners = surface.points_mm[surface.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(normals, axis=1)
    said = ""
    # A place next to a large triangle is in the lumen, if the surface is one.
    for k in np.argsort(-sizes)[:_TRIES]:
        inward = -normals[k] / sizes[k]
        text = (
            f'name = "guide3d"\n[vessel]\nkind = "surface"\nfile = {_quoted(path)}\nmesh_unit = "{unit}"\nvoxel_mm = 0.5\n'
            f"wall_stiffness_N_mm2 = 1\n[entry]\npoint_mm = {_list(corners[k].mean(axis=0) + _INWARD_MM * inward)}\n"
            f"direction = {_list(inward)}\n[[instrument]]\nmax_length_mm = 10\nradius_mm = 0.05\nrigidity_N_mm2 = 1\n"
        )
        try:
            return Scene.from_text(text)
        except Error as error:
            said = str(error)
    raise Error(f"{path}: no place in its lumen was found ({said[:200]}); give the surface of the lumen")


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _list(values: Any) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"


def register(lumen: Scene, wires: Sequence[Array], room_mm: float, seed: int = 1) -> List[Minimum]:
    """Minima that compete, the best first.

    Each point of the wires lacks room_mm less its depth. The sum of their squares (beyond 1 mm of
    their lengths) is least. It starts at the given frame, and at random places about it.
    """
    points = np.vstack(wires)
    center = points.mean(axis=0)
    random = np.random.default_rng(seed)
    least_squares = need("scipy.optimize").least_squares

    def lacking(values: Array) -> Array:
        depth = lumen.clearance_mm(_moved(points, values[:3], values[3:], center))
        out: Array = np.maximum(room_mm - depth, 0)
        return out

    def slopes(values: Array) -> Array:
        here = lacking(values)
        steps = np.diag(1e-3 * _SCALES)
        return np.stack([(lacking(values + step) - here) / step.sum() for step in steps], axis=1)

    found: List[Tuple[float, Array, int]] = []
    for start in range(STARTS):
        values = np.zeros(6)
        if start > 0:
            axis = random.normal(size=3)
            values[:3] = np.radians(random.uniform(0, LARGEST_TURN_DEG)) * axis / np.linalg.norm(axis)
            values[3:] = random.normal(0, SHIFT_MM, 3)
        done = least_squares(lacking, values, slopes, x_scale=_SCALES, loss="soft_l1", f_scale=_ROBUST_MM, max_nfev=_MOST_ROUNDS)
        found.append((float(done.cost), done.x, 1))
    found.sort(key=lambda one: one[0])
    minima: List[Tuple[float, Array, int]] = []
    for cost, values, _ in found:
        for k, (other_cost, other, count) in enumerate(minima):
            if angle_deg(values[:3], other[:3]) < _SAME_DEG and np.linalg.norm(values[3:] - other[3:]) < _SAME_MM:
                minima[k] = (other_cost, other, count + 1)
                break
        else:
            minima.append((cost, values, 1))
    out = []
    for _, values, count in minima:
        violation = lacking(values)
        depth = lumen.clearance_mm(_moved(points, values[:3], values[3:], center))
        out.append(
            Minimum(
                _three(np.degrees(values[:3])), _three(values[3:]), _three(center), rms(violation), 100 * float((depth < 0).mean()), count,
            )
        )
    return [one for one in out if one.violation_mm <= ALIKE * out[0].violation_mm + 1e-3]


def _three(values: Any) -> Tuple[float, float, float]:
    x, y, z = map(float, values)
    return x, y, z


def angle_deg(one: Any, other: Any) -> float:
    """Angle between two rotation vectors in rad."""
    rotation = need("scipy.spatial.transform").Rotation
    return float(np.degrees((rotation.from_rotvec(one) * rotation.from_rotvec(other).inv()).magnitude()))
