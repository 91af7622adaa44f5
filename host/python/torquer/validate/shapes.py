"""Measured shapes: a CSV file of points, and a smooth curve through one half of each."""

from __future__ import annotations

import dataclasses
import math
import os
from typing import Any, Dict, List, Tuple, Union

import numpy as np

from .._cells import Cells, cell_number
from ..centerlines import MM, UNITS
from .._polyline import arcs_of
from ._base import Error, Points, Values, need

FEWEST_POINTS = 12
_MOST_POINTS = 2000
_MOST_ROWS = 1_000_000
_LARGEST_MM = 1e5
_LONGEST_NAME = 100
_SAMPLE_MM = 0.25
# Weights of the roughness among which generalized cross-validation chooses, in steps between points.
_WEIGHTS = np.concatenate([[0.0], np.logspace(-3, 6, 37)])


@dataclasses.dataclass(frozen=True)
class Shape:
    """A measured wire, from the side of its entry to its tip."""

    name: str
    points: Points

    def choosing(self) -> Any:
        """Numbers of the points that choose the fit: the even ones, without the tip."""
        return np.arange(0, len(self.points) - 1, 2)

    def reported(self) -> Any:
        """Numbers of the points on which the fit is reported: the odd ones, without the tip."""
        return np.arange(1, len(self.points) - 1, 2)


def _unit(table: Cells) -> Tuple[str, List[str]]:
    """The unit of the coordinates, and the names of columns that are not used."""
    names = table.names
    units = [unit for unit in UNITS if all(f"{axis}_{unit}" in names for axis in "xyz")]
    missing = [name for name in ("shape", "point") if name not in names]
    if len(units) != 1 or missing:
        absent = missing[0] if missing else "x_mm, y_mm, z_mm"
        raise Error(
            f"{table.path}:{table.line}: the columns are {', '.join(names)[:200]}; {absent} is missing or ambiguous: "
            "give shape, point, x_mm, y_mm, z_mm, or another unit of " + ", ".join(UNITS) + " at all three"
        )
    used = ["shape", "point", *(f"{axis}_{units[0]}" for axis in "xyz")]
    return units[0], [name for name in names if name and name not in used]


def _whole(where: str, text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise Error(f"{where}: point is {text[:40]!r}; give the number of the point: 0, 1, 2, .. from the entry to the tip")
    return int(text)


def _check(path: str, name: str, lines: List[int], points: Points) -> None:
    where = f"{path}:{lines[0]}"
    if not FEWEST_POINTS <= len(points) <= _MOST_POINTS:
        raise Error(f"{where}: shape {name} has {len(points)} points; give {FEWEST_POINTS} to {_MOST_POINTS}")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not steps.min() > 0:
        k = int(steps.argmin())
        raise Error(f"{path}:{lines[k + 1]}: shape {name} repeats the point of line {lines[k]}; remove one of them")


def read(path: Union[str, "os.PathLike[str]"]) -> Tuple[List[Shape], List[str]]:
    """Shapes of a CSV file, in mm, and the names of columns that are not used.

    Raises Error naming file, line, column, value and remedy.
    """
    path = os.fspath(path)
    table = Cells(path)
    unit, others = _unit(table)
    found: Dict[str, Tuple[List[int], List[int], List[List[float]]]] = {}
    last = ""
    for line, cells in table.rows():
        where = f"{path}:{line}"
        if line > _MOST_ROWS:
            raise Error(f"{where}: more than {_MOST_ROWS} lines; give fewer shapes")
        name = cells["shape"]
        if not name or len(name) > _LONGEST_NAME or not name.isprintable():
            raise Error(f"{where}: shape is {name[:40]!r}; give a name of 1 to {_LONGEST_NAME} characters")
        if name != last and name in found:
            raise Error(f"{where}: shape {name} goes on after another shape; keep its points together")
        lines, numbers, points = found.setdefault(name, ([], [], []))
        number = _whole(where, cells["point"])
        if numbers and number <= numbers[-1]:
            raise Error(f"{where}: point is {number}, after {numbers[-1]}; order the points from the entry to the tip")
        point = [MM[unit] * cell_number(where, f"{axis}_{unit}", cells[f"{axis}_{unit}"]) for axis in "xyz"]
        farthest = max(point, key=abs)
        if abs(farthest) > _LARGEST_MM:
            raise Error(f"{where}: a coordinate is {farthest:g} mm; give at most {_LARGEST_MM:g}, and check the unit")
        lines.append(line)
        numbers.append(number)
        points.append(point)
        last = name
    if not found:
        raise Error(f"{path}: holds no shape; give a line for each point")
    shapes = []
    for name, (lines, _, points) in found.items():
        shapes.append(Shape(name, np.array(points, float)))
        _check(path, name, lines, shapes[-1].points)
    return shapes, others


def _smoothed(arcs: Values, points: Points) -> Tuple[Points, float]:
    """Points of least roughness, and the standard deviation of their noise in each coordinate.

    The arcs come from the same points, so they follow the noise along the curve. So the residuals
    have the noise of the two coordinates across it.

    Whittaker's smoother with third divided differences (Eilers, Anal Chem 2003;75:3631). The weight
    is that of the least generalized cross-validation (Craven and Wahba, Numer Math 1979;31:377).
    """
    count = len(points)
    spacing = float(np.median(np.diff(arcs)))
    rough = np.eye(count)
    for order in (1, 2, 3):
        reach = (arcs[order:] - arcs[:-order]) / (order * spacing)
        rough = np.diff(rough, axis=0) / np.maximum(reach, 0.1)[:, None]
    values, vectors = np.linalg.eigh(rough.T @ rough)
    values = np.maximum(values, 0)
    parts = vectors.T @ points
    best, noise, keep = math.inf, 0.0, np.ones(count)
    for weight in _WEIGHTS:
        kept = 1 / (1 + weight * values)
        free = float((1 - kept).sum())
        if weight > 0 and free <= 0.05 * count:
            continue
        squares = float((((1 - kept)[:, None] * parts) ** 2).sum())
        score = count * squares / free**2 if weight > 0 else math.inf
        if score < best:
            best, noise, keep = score, math.sqrt(squares / (2 * free)), kept
    return vectors @ (keep[:, None] * parts), noise


class Curve:
    """Smooth curve through the choosing points of a shape and its tip, sampled finely.

    Its parameter is the length of the polyline through these points. A point between two of them
    divides it as its distances from both.
    """

    def __init__(self, shape: Shape) -> None:
        some = np.append(shape.choosing(), len(shape.points) - 1)
        knots = arcs_of(shape.points[some])
        smooth, self.noise_mm = _smoothed(knots, shape.points[some])
        spline = need("scipy.interpolate").CubicSpline(knots, smooth)
        samples = np.linspace(0, knots[-1], int(math.ceil(knots[-1] / _SAMPLE_MM)) + 1)
        steps = np.linalg.norm(np.diff(shape.points, axis=0), axis=1)
        chords = np.interp(np.arange(len(shape.points)), some, knots)
        for k in set(range(len(shape.points))) - set(some.tolist()):
            chords[k] = chords[k - 1] + (chords[k + 1] - chords[k - 1]) * steps[k - 1] / (steps[k - 1] + steps[k])
        self.points: Points = spline(samples)
        self.arcs = arcs_of(self.points)
        self.of_points: Values = np.interp(chords, samples, self.arcs)
        """Length along the curve to each point of the shape."""

    def __repr__(self) -> str:
        return f"Curve(points={len(self.points)}, length_mm={self.arcs[-1]:.1f}, noise_mm={self.noise_mm:.3g})"
