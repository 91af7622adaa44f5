"""Parts that the steps of the conversion share."""

from __future__ import annotations

from typing import Any

from .. import Error, _command
from .._polyline import Array


def need(module: str) -> Any:
    """Imports a module of scipy, which the conversion needs."""
    return _command.need("torquer convert guide3d", module, "python3-scipy")


__all__ = ["Array", "Error", "need"]
