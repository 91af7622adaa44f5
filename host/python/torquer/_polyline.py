"""Polylines: lengths along them, and points at such lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def arcs_of(points: Array) -> Array:
    """Length of a polyline up to each of its points, in the plane or in space."""
    out: Array = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return out


def at_arcs(points: Array, arcs: Any) -> Array:
    """Points at lengths along a polyline; its ends for lengths beyond them."""
    along = arcs_of(points)
    return np.stack([np.interp(arcs, along, points[:, axis]) for axis in range(points.shape[1])], axis=1)


def to_nearest(points: Array, line: Array) -> Array:
    """Vector from each point in space to the nearest point of a polyline."""
    way = np.diff(line, axis=0)
    squared = np.maximum(np.einsum("ij,ij->i", way, way), 1e-30)
    off = points[:, None, :] - line[None, :-1, :]
    share = np.clip(np.einsum("pij,ij->pi", off, way) / squared, 0, 1)
    gaps = share[:, :, None] * way - off
    nearest = np.einsum("pij,pij->pi", gaps, gaps).argmin(axis=1)
    out: Array = gaps[np.arange(len(points)), nearest]
    return out


def resampled(points: Array, step: float) -> Array:
    """Points at about equal steps along a polyline, with both of its ends."""
    length = float(arcs_of(points)[-1])
    return at_arcs(points, np.linspace(0, length, max(3, int(np.ceil(length / step)) + 1)))


def rms(values: Any) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.asarray(values, float) ** 2)))
