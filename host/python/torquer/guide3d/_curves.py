"""Curves in space from the points that were clicked in two pictures."""

from __future__ import annotations

import dataclasses
from typing import Any, Tuple

import numpy as np

from .._polyline import arcs_of, at_arcs, rms
from ._annotations import Frame
from ._base import Array, need
from ._cameras import Pair

_SAMPLES = 150
# A row that one picture goes on while the other rests costs as much as this offset, px.
_REST_PX = 0.5
_KNOT_MM, _MOST_KNOTS = 6.0, 60
# Weight of the third differences of the spline's coefficients, px per mm.
_ROUGHNESS = 0.6
_ROUNDS, _POINTS_PER_KNOT = 10, 4
# Share of a step along the curve that each round takes back, so that no part of it slides off.
_ANCHOR = 0.05
STEP_MM = 2.0


@dataclasses.dataclass(frozen=True)
class Reconstructed:
    """A wire in the frame of the cameras, from its far end to its tip, 2 mm apart."""

    points: Array
    reprojection_px: float
    """RMS distance from the clicked curves."""


def smooth(clicks: Array, count: int = _SAMPLES) -> Array:
    """Points at equal steps along a cubic through clicks."""
    arcs = arcs_of(clicks)
    fine = need("scipy.interpolate").CubicSpline(arcs, clicks)(np.linspace(0, arcs[-1], 4 * count))
    return at_arcs(fine, np.linspace(0, arcs_of(fine)[-1], count))


def _matched(pair: Pair, first: Array, second: Array) -> Tuple[Any, Any]:
    """Numbers of matching samples, from the tips to where one picture ends.

    Least sum of squared offsets over all ways on which neither picture goes back. This is dynamic time warping (Sakoe
    and Chiba, IEEE Trans ASSP 1978;26:43).
    """
    slope = float(np.median(np.abs(pair.per_row(0, first))))
    apart = (pair.angles(0, first)[:, None] - pair.angles(1, second)[None, :]) / slope
    cost = apart**2
    rows, columns = cost.shape
    total = np.full((rows + 1, columns + 1), np.inf)
    total[0, 0] = 0
    for k in range(rows + columns - 1):
        i = np.arange(max(0, k - columns + 1), min(rows, k + 1))
        j = k - i
        best = np.minimum(total[i, j], np.minimum(total[i, j + 1], total[i + 1, j]) + _REST_PX**2)
        total[i + 1, j + 1] = cost[i, j] + best
    ends = [(i, columns - 1) for i in range(rows)] + [(rows - 1, j) for j in range(columns)]
    ends = [end for end in ends if min(end) > min(rows, columns) // 2]
    a, b = min(ends, key=lambda at: float(total[at[0] + 1, at[1] + 1]) / (at[0] + at[1]))
    way = [(a, b)]
    while a > 0 or b > 0:
        choices = [(total[a, b], a - 1, b - 1), (total[a, b + 1] + _REST_PX**2, a - 1, b), (total[a + 1, b] + _REST_PX**2, a, b - 1)]
        _, a, b = min(choice for choice in choices if choice[1] >= 0 and choice[2] >= 0)
        way.append((a, b))
    numbers = np.array(way[::-1])
    return numbers[:, 0], numbers[:, 1]


def _feet(points: Array, line: Array) -> Tuple[Array, Array]:
    """Nearest points on a plane polyline, and the normals there."""
    way = np.diff(line, axis=0)
    off = points[:, None, :] - line[None, :-1, :]
    share = np.clip(np.einsum("pij,ij->pi", off, way) / np.einsum("ij,ij->i", way, way), 0, 1)
    places = line[None, :-1, :] + share[:, :, None] * way
    best = ((points[:, None, :] - places) ** 2).sum(axis=2).argmin(axis=1)
    ways = way[best] / np.linalg.norm(way[best], axis=1)[:, None]
    return places[np.arange(len(points)), best], np.column_stack([-ways[:, 1], ways[:, 0]])


def reconstruct(pair: Pair, first: Array, second: Array) -> Reconstructed:
    """Smooth curve whose pictures lie on the curves through the clicks of both pictures."""
    lines = (smooth(first), smooth(second))
    matched = _matched(pair, *lines)
    ended = 0 if matched[0][-1] == len(lines[0]) - 1 else 1
    lines = (lines[0][: matched[0][-1] + 1], lines[1][: matched[1][-1] + 1])
    rough = pair.points(lines[0][matched[0]], lines[1][matched[1]])
    length = float(arcs_of(at_arcs(rough, np.linspace(0, arcs_of(rough)[-1], 30)))[-1])
    knots = int(np.clip(round(length / _KNOT_MM), 8, _MOST_KNOTS))
    count = _POINTS_PER_KNOT * knots
    design = need("scipy.interpolate").BSpline.design_matrix
    vector = np.concatenate([np.zeros(3), np.linspace(0, 1, knots - 2), np.ones(3)])
    basis = design(np.linspace(0, 1, count), vector, 3).toarray()
    at_rough = design(np.linspace(0, 1, len(rough)), vector, 3).toarray()
    third = np.diff(np.eye(knots), 3, axis=0)
    # Along planes through both centers the match is loose, so the first curve is a stiff one.
    begin = np.linalg.solve(at_rough.T @ at_rough + 10 * third.T @ third, at_rough.T @ rough)
    coefficients: Array = _refined(pair, lines, ended, basis, third, begin)
    points = basis @ coefficients
    error = rms([_distances(camera.pixels(points), line) for camera, line in zip(pair.cameras, lines)])
    fine = design(np.linspace(0, 1, 20 * knots), vector, 3).toarray() @ coefficients
    arcs = np.arange(0, arcs_of(fine)[-1], STEP_MM)
    return Reconstructed(at_arcs(fine, arcs)[::-1], error)


def _distances(points: Array, line: Array) -> Array:
    feet, normals = _feet(points, line)
    out: Array = np.einsum("ij,ij->i", points - feet, normals)
    return out


def _refined(pair: Pair, lines: Tuple[Array, Array], ended: int, basis: Array, third: Array, begin: Array) -> Array:
    """Coefficients of least squared distances between the curve's pictures and the lines (Gauss-Newton)."""
    knots = basis.shape[1]
    coefficients = begin
    for _ in range(_ROUNDS):
        points = basis @ coefficients
        tangents = np.gradient(points, axis=0)
        tangents /= np.maximum(np.linalg.norm(tangents, axis=1), 1e-9)[:, None]
        matrix = np.zeros((3 * knots, 3 * knots))
        side = np.zeros(3 * knots)

        def add(weights: Array, rows: Array, residuals: Array) -> None:
            """Equations: for each row, weights of the coefficients times a vector of space."""
            nonlocal matrix, side
            jacobian = (rows[:, :, None] * weights[:, None, :]).reshape(len(rows), -1)
            matrix += jacobian.T @ jacobian
            side -= jacobian.T @ residuals

        for number, (camera, line) in enumerate(zip(pair.cameras, lines)):
            pixels, slopes = camera.pixels(points), camera.slopes(points)
            feet, normals = _feet(pixels, line)
            add(basis, np.einsum("ij,ijk->ik", normals, slopes), np.einsum("ij,ij->i", pixels - feet, normals))
            # The tips are the same point; so is the end of the picture that ends first.
            for at, end in ((0, line[0]), (-1, line[-1])) if number == ended else ((0, line[0]),):
                for axis in range(2):
                    add(2 * basis[[at]], slopes[[at], axis], 2 * (pixels[[at], axis] - end[axis]))
        size = float(np.abs(np.diag(matrix)).mean())
        add(np.sqrt(_ANCHOR * size / len(points)) * basis, tangents, np.zeros(len(points)))
        stiff = _ROUGHNESS**2 * third.T @ third
        matrix += np.kron(np.eye(3), stiff)
        side -= (stiff @ coefficients).T.ravel()
        coefficients = coefficients + np.linalg.solve(matrix + 1e-9 * size * np.eye(3 * knots), side).reshape(3, knots).T
    return coefficients


def noise_of(pair: Pair, frame: Frame, click_px: float, draws: int, random: Any) -> Tuple[float, float]:
    """RMS displacement of the curve across itself, and of its tip, if each click has noise, mm."""
    clean = reconstruct(pair, frame.first, frame.second).points[::-1]
    along, tips = [], []
    for _ in range(draws):
        moved = [clicks + random.normal(0, click_px, clicks.shape) for clicks in (frame.first, frame.second)]
        noisy = reconstruct(pair, moved[0], moved[1]).points[::-1]
        common = min(arcs_of(clean)[-1], arcs_of(noisy)[-1])
        at = np.arange(0, common, STEP_MM)
        ways = np.gradient(at_arcs(clean, at), axis=0)
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        off = at_arcs(noisy, at) - at_arcs(clean, at)
        off -= np.einsum("ij,ij->i", off, ways)[:, None] * ways
        along.append(rms(np.linalg.norm(off, axis=1)))
        tips.append(float(np.linalg.norm(noisy[0] - clean[0])))
    return rms(along), rms(tips)
