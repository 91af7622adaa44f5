"""Parts that the steps of the conversion share."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .. import Error, _command

Array = npt.NDArray[np.float64]


def need(module: str) -> Any:
    """Imports a module of scipy, which the conversion needs."""
    return _command.need("torquer convert guide3d", module, "python3-scipy")


def rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.asarray(values, float) ** 2)))


def arcs_of(points: Array) -> Array:
    """Length of a polyline up to each of its points, in the plane or in space."""
    out: Array = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return out


def at_arcs(points: Array, arcs: Any) -> Array:
    """Points at lengths along a polyline."""
    along = arcs_of(points)
    return np.stack([np.interp(arcs, along, points[:, axis]) for axis in range(points.shape[1])], axis=1)


__all__ = ["Array", "Error", "arcs_of", "at_arcs", "need", "rms"]
