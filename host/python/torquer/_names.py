"""Names that a user gives, out of a list."""

from __future__ import annotations

from typing import Any, Iterable

from ._torquer import nearest_name


def did_you_mean(given: Any, known: Iterable[str]) -> str:
    """Proposes the nearest name for a message, as "did you mean sion_blue? ". "" if none is near."""
    near = nearest_name(given, list(known)) if isinstance(given, str) else ""
    return f"did you mean {near}? " if near else ""


def first_unknown(given: Iterable[Any], known: Iterable[str]) -> Any:
    """First element that is not among the known names, or None."""
    names = list(known)
    return next((one for one in given if one not in names), None)
