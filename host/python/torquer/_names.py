"""Names that a user gives, out of a list."""

from __future__ import annotations

from typing import Any, Dict, Iterable

from ._torquer import Error, nearest_name, printable


def shown(value: Any) -> str:
    """A value that a user gave, for a message. A long one is cut and ends with ".."."""
    return printable(repr(value), 200)


def did_you_mean(given: Any, known: Iterable[str]) -> str:
    """Proposes the nearest name for a message, as "did you mean sion_blue? ". "" if none is near."""
    near = nearest_name(given, list(known)) if isinstance(given, str) else ""
    return f"did you mean {near}? " if near else ""


def first_unknown(given: Iterable[Any], known: Iterable[str]) -> Any:
    """First element that is not among the known names, or None."""
    names = list(known)
    return next((one for one in given if not isinstance(one, str) or one not in names), None)


class UnknownName(Error, KeyError):
    """A mapping has no such name."""

    __str__ = Exception.__str__  # KeyError would quote the message


class Readings(Dict[str, float]):
    """Readings by name."""

    def __missing__(self, name: str) -> float:
        there = f"there are: {', '.join(self)}" if self else "the scene has none"
        raise UnknownName(f"there is no reading {shown(name)}; {did_you_mean(name, self)}{there}")
