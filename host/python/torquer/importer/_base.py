"""Parts that every step of the importer uses: optional packages, points and vectors."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .. import Error, _command

Points = npt.NDArray[np.float64]
"""Shape (n, 3)."""

# Debian packages of the modules that only the importer needs.
_PACKAGES = {
    "scipy": "python3-scipy",
    "vtkmodules": "python3-vtk9",
    "nibabel": "python3-nibabel",
    "pydicom": "python3-pydicom",
    "gdcm": "python3-gdcm",
    "matplotlib": "python3-matplotlib",
}


def need(module: str) -> Any:
    """Imports a module of a Debian package that only the importer needs."""
    return _command.need("torquer-import", module, _PACKAGES[module.split(".")[0]])


def as_text(point: Any, digits: int = 1) -> str:
    """A point or vector for a message."""
    return "(" + ", ".join(f"{value:.{digits}f}" for value in point) + ")"


def moved(affine: npt.NDArray[np.float64], points: Any) -> Points:
    """Points moved by a 4 x 4 matrix."""
    out: Points = np.asarray(points, float) @ affine[:3, :3].T + affine[:3, 3]
    return out


def unit(vector: Any) -> npt.NDArray[np.float64]:
    """A vector of length 1 in the same direction; the vector must not be 0."""
    out: npt.NDArray[np.float64] = np.asarray(vector, float) / np.linalg.norm(vector)
    return out


__all__ = ["Error", "Points", "as_text", "moved", "need", "unit"]
