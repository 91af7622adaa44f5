"""Parts that the steps of torquer-validate share: packages, polylines and distances."""

from __future__ import annotations

from typing import Any, Tuple

import numpy as np
import numpy.typing as npt

from .. import Error, _command

Points = npt.NDArray[np.float64]
"""Shape (n, 3), in mm."""
Values = npt.NDArray[np.float64]
"""Shape (n,)."""

_PACKAGES = {"scipy": "python3-scipy", "matplotlib": "python3-matplotlib"}


def need(module: str) -> Any:
    """Imports a module of a Debian package that the command needs."""
    return _command.need("torquer-validate", module, _PACKAGES[module.split(".")[0]])


def arcs_of(points: Points) -> Values:
    """Length of a polyline up to each of its points."""
    out: Values = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return out


def at_arcs(points: Points, arcs_mm: Any) -> Points:
    """Points at lengths along a polyline; its ends for lengths beyond them."""
    arcs = arcs_of(points)
    return np.stack([np.interp(arcs_mm, arcs, points[:, axis]) for axis in range(3)], axis=1)


def resampled(points: Points, step_mm: float) -> Points:
    """Points at about equal steps along a polyline, with both of its ends."""
    length = float(arcs_of(points)[-1])
    return at_arcs(points, np.linspace(0, length, max(3, int(np.ceil(length / step_mm)) + 1)))


def nearest_mm(points: Points, line: Points) -> Values:
    """Distance of each point from a polyline."""
    way = np.diff(line, axis=0)
    squared = np.maximum(np.einsum("ij,ij->i", way, way), 1e-30)
    off = points[:, None, :] - line[None, :-1, :]
    share = np.clip(np.einsum("pij,ij->pi", off, way) / squared, 0, 1)
    out: Values = np.linalg.norm(off - share[:, :, None] * way, axis=2).min(axis=1)
    return out


def as_tuple(vector: Any) -> Tuple[float, float, float]:
    x, y, z = map(float, vector)
    return x, y, z


def as_text(point: Any) -> str:
    """A point for a message."""
    return "(" + ", ".join(f"{value:.1f}" for value in point) + ") mm"


__all__ = ["Error", "Points", "Values", "arcs_of", "as_text", "as_tuple", "at_arcs", "nearest_mm", "need", "resampled"]
