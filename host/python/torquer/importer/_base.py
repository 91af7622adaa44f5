"""Parts that every step of the importer uses: optional packages, progress, points and vectors."""

from __future__ import annotations

import time
from typing import Any, Optional, TextIO

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


class Progress:
    """Progress of an import: the name of each step, and its time when the next one begins."""

    def __init__(self, out: Optional[TextIO] = None) -> None:
        self._out = out
        self._began: Optional[float] = None
        self._terminal = out is not None and out.isatty()

    def step(self, name: str) -> None:
        self.end()
        self._began = time.monotonic()
        self._write(f"{name} .." + ("" if self._terminal else "\n"))

    def end(self) -> None:
        if self._began is not None and self._terminal:
            self._write(f" {time.monotonic() - self._began:.0f} s\n")
        self._began = None

    def _write(self, text: str) -> None:
        if self._out is not None:
            self._out.write(text)
            self._out.flush()


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


__all__ = ["Error", "Points", "Progress", "as_text", "moved", "need", "unit"]
