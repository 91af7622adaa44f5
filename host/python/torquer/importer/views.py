"""Angles of the C-arm that show each branch: long, and apart from the vessel that it leaves.

    torquer.importer.views.find(curves)
"""

from __future__ import annotations

import dataclasses
from typing import Any, List

import numpy as np

from .._polyline import arcs_of, at_arcs
from ._base import unit
from .centerlines import Curve

# Angles that a C-arm reaches about a patient on a table, degrees.
_LAO_DEG = np.arange(-60, 61, 5)
_CRA_DEG = np.arange(-30, 31, 5)
# Length of a branch, and of its parent about the ostium, mm.
_LENGTH_MM = 30.0


@dataclasses.dataclass(frozen=True)
class View:
    """Angles of the C-arm for a branch. LAO and CRA are positive, RAO and CAU negative."""

    name: str
    lao_deg: int
    cra_deg: int
    seen: float
    """Share of the branch's first part that is seen, 1 for a branch across the beam."""
    apart_deg: float
    """Angle in the picture between the branch and its parent."""

    def __str__(self) -> str:
        lao = f"{'LAO' if self.lao_deg >= 0 else 'RAO'} {abs(self.lao_deg)}"
        cra = f"{'CRA' if self.cra_deg >= 0 else 'CAU'} {abs(self.cra_deg)}"
        return f"{self.name}: {lao}, {cra}; {100 * self.seen:.0f} % of its length, {self.apart_deg:.0f} degrees from its parent"


def beam_of(lao_deg: float, cra_deg: float) -> Any:
    """Unit direction from the source to the detector in LPS."""
    lao, cra = np.radians([lao_deg, cra_deg])
    return np.array([np.sin(lao) * np.cos(cra), -np.cos(lao) * np.cos(cra), np.sin(cra)])


def _flat(direction: Any, beam: Any) -> Any:
    return direction - direction @ beam * beam


def _view(branch: Curve, parent: Curve) -> View:
    length = min(_LENGTH_MM, float(branch.lengths_mm()[-1]))
    start, end = at_arcs(branch.points, [0.0, length])
    along = unit(end - start)
    arcs = arcs_of(parent.points)
    at = float(arcs[np.linalg.norm(parent.points - branch.points[0], axis=1).argmin()])
    before, after = at_arcs(parent.points, [max(0.0, at - _LENGTH_MM / 2), min(float(arcs[-1]), at + _LENGTH_MM / 2)])
    trunk = unit(after - before)
    views = []
    for lao in _LAO_DEG:
        for cra in _CRA_DEG:
            beam = beam_of(float(lao), float(cra))
            seen, shadow = _flat(along, beam), _flat(trunk, beam)
            across = float(np.linalg.norm(np.cross(seen, shadow)))
            apart = np.degrees(np.arctan2(across, abs(float(seen @ shadow))))
            views.append((across, -abs(int(lao)) - abs(int(cra)), View(branch.name, int(lao), int(cra), float(np.linalg.norm(seen)), float(apart))))
    # The area between branch and parent in the picture; among equals the smallest angles.
    return max(views, key=lambda one: (round(one[0], 3), one[1]))[2]


def find(curves: List[Curve]) -> List[View]:
    """A view for each curve that leaves another one."""
    return [_view(curve, curves[curve.parent]) for curve in curves if curve.parent is not None]
