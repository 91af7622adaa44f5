"""Shares of a study's cases, which jobs work on side by side."""

from __future__ import annotations

import dataclasses
import re
from typing import Mapping, Optional, Sequence

from . import Error

_MOST_SHARES = 1_000_000
_SLURM = "SLURM_ARRAY_TASK_"


@dataclasses.dataclass(frozen=True)
class Share:
    """Every `count`-th case of a study, from case `number` on. Numbers begin with 1."""

    number: int
    count: int

    @property
    def folder(self) -> str:
        """Name of its folder in the folder of the results."""
        return f"{self.number}-of-{self.count}"

    def of(self, keys: Sequence[str]) -> Sequence[str]:
        """The keys of its cases."""
        return keys[self.number - 1 :: self.count]


def read_share(text: str) -> Share:
    """Reads a share from text, as "3/64"."""
    match = re.fullmatch(r"(\d{1,7})/(\d{1,7})", text, re.ASCII)
    share = Share(*map(int, match.groups())) if match else Share(0, 0)
    if not 1 <= share.number <= share.count <= _MOST_SHARES:
        raise Error(f"share {text}: give its number and their number, from 1/1 on, as 3/64")
    return share


def slurm_share(environment: Mapping[str, str]) -> Optional[str]:
    """Share of a task in a job array of Slurm; None elsewhere."""
    if f"{_SLURM}ID" not in environment:
        return None
    try:
        number, first, last, step, count = (int(environment[_SLURM + name]) for name in ("ID", "MIN", "MAX", "STEP", "COUNT"))
        index, rest = divmod(number - first, step)
        if rest == 0 and 0 <= index < count == (last - first) // step + 1:
            return f"{index + 1}/{count}"
    except (KeyError, ValueError, ZeroDivisionError):
        pass
    said = ", ".join(f"{name}={environment[name]}" for name in sorted(environment) if name.startswith(_SLURM))
    raise Error(f"{said}: not one range of numbers with a fixed step; give this task's share by --share, as --share 3/64")
