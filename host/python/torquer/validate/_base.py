"""Parts that the steps of torquer-validate share: packages, points and texts."""

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


def as_tuple(vector: Any) -> Tuple[float, float, float]:
    x, y, z = map(float, vector)
    return x, y, z


def as_text(point: Any) -> str:
    """A point for a message."""
    return "(" + ", ".join(f"{value:.1f}" for value in point) + ") mm"


__all__ = ["Error", "Points", "Values", "as_text", "as_tuple", "need"]
