"""Scene of an imported vessel: entry, instrument, flow, contrast, X-ray, target and a picture."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any, List, Optional, Tuple

import numpy as np

from .._polyline import arcs_of, at_arcs, resampled
from . import views
from ._base import Error, need, unit
from .centerlines import LEVEL_MM, Curve, lowest
from .surface import Mesh

# The entry lies this many radii behind the tip. Its direction is that over the same length.
_BEHIND_RADII = 2.5
# The least lumen that a wire enters, in its radii.
_ROOM = 2.0
ANTERIOR, LEFT = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
"""Directions of the patient, in LPS."""
# The aorta's mean flow, mL/s, in a root of this radius, mm, and Murray's cube for others.
_AORTA_ML_S, _AORTA_MM = 80.0, 12.0
_TIP_MM, _TIP_DEG = 15.0, 45.0
# Radius of a 0.014-inch wire, and of a 0.035-inch one.
_THIN_MM, _THICK_MM = 0.178, 0.4445
# The simulator joins an end of a curve to another curve that is nearer than 0.5 mm.
_JOINED_MM = 0.6
# Limits of the scene's keys.
_LEAST_ML_S, _MOST_TARGET_MM = 0.001, 50.0
# Larger radii over half of a curve are not those of an artery. An aorta has less, and an aneurysm is shorter.
_WIDEST_MM = 25.0


@dataclasses.dataclass(frozen=True)
class Entry:
    """Place where an instrument can enter, at a tip of a curve."""

    name: str
    point_mm: Any
    direction: Any
    """Unit, into the vessel."""
    radius_mm: float
    is_inlet: bool = False
    """True where the blood enters."""

    @property
    def curve_name(self) -> str:
        return self.name.split()[0]


def entry_of(curve: Curve, at_start: bool) -> Entry:
    """Entry behind the tip at an end of a curve."""
    points = curve.points if at_start else curve.points[::-1]
    radii = curve.radii if at_start else curve.radii[::-1]
    arcs = arcs_of(points)
    radius = float(np.median(radii[arcs <= max(5.0, 2 * float(radii[0]))]))
    behind = min(_BEHIND_RADII * radius, 0.4 * float(arcs[-1]))
    ahead = min(2 * behind, float(arcs[-1]))
    place, onward = at_arcs(points, [behind, ahead])
    # Means over the length: single points of a curve turn near its tip.
    return Entry(f"{curve.name} {'start' if at_start else 'end'}", place, unit(onward - place), radius)


@dataclasses.dataclass(frozen=True)
class Part:
    """Curves that are connected."""

    curves: List[int]
    """Their numbers. The first has the root."""
    free: List[Tuple[int, bool]]
    """Ends on no other curve, as the number of the curve and True for its start. The blood enters at the first.

    That is the root if it is free, or the widest one. The root is not free in a ring, and where given curves begin at a
    branch.
    """


def parts_of(curves: List[Curve]) -> List[Part]:
    """Connected parts of the curves, in the order of their first curves."""
    tree = need("scipy.spatial").cKDTree
    fine = [resampled(curve.points, _JOINED_MM / 4) for curve in curves]
    every = tree(np.vstack(fine))
    owner = np.repeat(np.arange(len(curves)), [len(points) for points in fine])
    number = np.arange(len(curves))
    free = []
    for k, curve in enumerate(curves):
        for at_start, end in ((True, curve.points[0]), (False, curve.points[-1])):
            met = np.unique(owner[every.query_ball_point(end, _JOINED_MM)])
            if len(met) == 1:
                free.append((k, at_start))
            same = number[met]
            number[np.isin(number, same)] = same.min()
    out = []
    for first in np.unique(number):
        ends = [end for end in free if number[end[0]] == first]
        if (first, True) not in ends:
            ends.sort(key=lambda end: -entry_of(curves[end[0]], end[1]).radius_mm)
        out.append(Part([int(k) for k in np.flatnonzero(number == first)], ends))
    return out


def entries_of(curves: List[Curve]) -> List[Entry]:
    """Entries at all free ends; in each part that of the blood comes first."""
    found = []
    for part in parts_of(curves):
        for k, (number, at_start) in enumerate(part.free or [(part.curves[0], True)]):
            found.append(dataclasses.replace(entry_of(curves[number], at_start), is_inlet=k == 0))
    return found


def _part_at(curves: List[Curve], entry: Entry) -> Part:
    """The part that an entry lies in."""
    return next(part for part in parts_of(curves) if entry.curve_name in [curves[k].name for k in part.curves])


def size_facts(curves: List[Curve]) -> List[str]:
    """A sentence if the vessel is too wide for an artery."""
    widest = max(float(np.median(curve.radii)) for curve in curves)
    if widest <= _WIDEST_MM:
        return []
    return [f"Half of a centerline has a radius above {widest:.1f} mm, more than an aorta; check the unit of the file."]


def first_entry(entries: List[Entry], notes: Optional[List[str]] = None) -> Entry:
    """The lowest tip other than the roots with room for a 0.035-inch wire, or the widest. Raises Error if no wire fits.

    `notes` gets a sentence if the choice was close.
    """
    wide = [entry for entry in entries if not entry.is_inlet and entry.radius_mm > _ROOM * _THICK_MM]
    if not wide:
        widest = max(entries, key=lambda entry: entry.radius_mm)
        if widest.radius_mm < _ROOM * _THIN_MM:
            raise Error(
                f"the widest end of the vessel has a radius of {widest.radius_mm:.2f} mm, and the thinnest wire needs "
                f"{_ROOM * _THIN_MM:.2f} mm; check the unit of the file"
            )
        return widest
    best = wide[lowest(np.array([entry.point_mm for entry in wide]))]
    level = [one for one in wide if float(one.point_mm[2] - best.point_mm[2]) <= LEVEL_MM]
    if len(level) > 1 and notes is not None:
        notes.append(
            f"Entry: {len(level)} ends are equally low, within {LEVEL_MM:g} mm: {', '.join(one.name for one in level)}. The "
            f"rightmost was taken, {best.name}; --entry chooses another one."
        )
    return best


def entry_at(entries: List[Entry], place: Any) -> Entry:
    """The entry nearest to a place. Raises Error if no wire fits there."""
    nearest = min(entries, key=lambda entry: float(np.linalg.norm(entry.point_mm - place)))
    if nearest.radius_mm < _ROOM * _THIN_MM:
        raise Error(
            f"--entry={','.join(f'{value:g}' for value in place)}: the nearest tip, {nearest.name}, has a radius of "
            f"{nearest.radius_mm:.2f} mm, less than {_ROOM * _THIN_MM:.2f} mm for the thinnest wire; give a place at a wider one"
        )
    return nearest


def bend_of_tip(direction: Any, anterior: Any = ANTERIOR, left: Any = LEFT) -> Tuple[float, float]:
    """Rest curvatures, 1/mm, by which the tip points to the patient's front at a rotation of 0.

    anterior, left: the patient's directions in the frame of the vessel's file.

    The simulator's first normal is the file's axis that is most across the direction. It jumps between axes as the
    direction changes, so it cannot be the zero of a rotation.
    """
    axis = np.eye(3)[int(np.abs(direction).argmin())]
    first = unit(axis - axis @ direction * direction)
    front = anterior if abs(anterior @ direction) < 0.9 else left
    across = unit(front - front @ direction * direction)
    size = np.radians(_TIP_DEG) / _TIP_MM
    return float(size * (across @ first)), float(size * (across @ np.cross(direction, first)))


def _text(value: Any, digits: int) -> str:
    """A number with so many digits, and 0 without a sign."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def _list(values: Any, digits: int = 2) -> str:
    return "[" + ", ".join(_text(value, digits) for value in values) + "]"


def _target(curves: List[Curve], entry: Entry) -> Optional[Tuple[Curve, float]]:
    """Middle of the tip's half of the longest branch, in the entry's part, that is not the entry's curve."""
    branches = [curves[k] for k in _part_at(curves, entry).curves[1:]]
    others = [curve for curve in branches if entry.curve_name != curve.name]
    if not others:
        return None
    longest = max(others, key=lambda curve: float(curve.lengths_mm()[-1]))
    return longest, 0.75 * float(longest.lengths_mm()[-1])


def is_thick(entry: Entry) -> bool:
    """True if a 0.035-inch wire fits an entry."""
    return entry.radius_mm > _ROOM * _THICK_MM * 1.5


def wire_text(thick: bool, direction: Any, length_mm: float, anterior: Any = ANTERIOR, left: Any = LEFT) -> str:
    """Table of the wire, which enters in a direction of the vessel's file."""
    radius, rigidity = (_THICK_MM, "1, 1, 1, 100, 300") if thick else (_THIN_MM, "0.2, 0.2, 0.2, 3, 30")
    one, two = bend_of_tip(direction, anterior, left)
    return f"""# {'A 0.035-inch' if thick else 'A 0.014-inch'} wire, which fits the entry. Rigidity: as in the scene {'neuro_arch' if thick else 'coronary'}.
[[instrument]]
name = "guidewire"
# All centerlines together, at most 1800 mm.
max_length_mm = {min(1800, max(50, round(length_mm)))}
radius_mm = {radius}
from_tip_mm = [0, {_TIP_MM:g}, {_TIP_MM:g}, 80, 150]
rigidity_N_mm2 = [{rigidity}]
# A tip of {_TIP_MM:g} mm, bent by {_TIP_DEG:g} degrees; at a rotation of 0 it points to the patient's front.
curvature_1_per_mm = [{_text(one, 6)}, {_text(one, 6)}, 0, 0, 0]
curvature_2_per_mm = [{_text(two, 6)}, {_text(two, 6)}, 0, 0, 0]
"""


def _inlet_text(curves: List[Curve], part: Part, is_first: bool) -> Tuple[str, float]:
    """Keys of the inlet of a part, and its flow, mL/s."""
    number, at_start = part.free[0]
    curve = curves[number]
    root = float(np.median((curve.radii if at_start else curve.radii[::-1])[:10]))
    flow = min(_AORTA_ML_S, max(_LEAST_ML_S, _AORTA_ML_S * (root / _AORTA_MM) ** 3))
    line, end, of = ("inlet", "inlet_end", "inlet_mL_s") if is_first else ("centerline", "end", "mL_s")
    side = "" if at_start else f'{end} = "end"\n'
    if part.free[0] != (part.curves[0], True):
        side = f"# The widest free end; the start of {curves[part.curves[0]].name} is joined to other curves.\n{side}"
    return f"""{line} = "{curve.name}"
{side}# {_AORTA_ML_S:g} mL/s at a radius of {_AORTA_MM:g} mm, scaled by the cube of the radius. The median over the first 10
# mm is {root:.2f} mm.
{of} = {flow:.3f}
""", flow


def _flow_text(curves: List[Curve], entry: Entry) -> str:
    """Tables of the blood flow and the contrast agent."""
    found = parts_of(curves)
    if any(len(part.free) < 2 for part in found):
        return ""
    inlets = [_inlet_text(curves, part, k == 0) for k, part in enumerate(found)]
    more = "".join(
        f"# A part of the vessel without connection to the others.\n[[effects.flow.other_inlet]]\n{text}" for text, _ in inlets[1:]
    )
    _, flow = inlets[found.index(_part_at(curves, entry))]
    return f"""# Outlets by Murray's law at all free ends but the inlets.
[effects.flow]
{inlets[0][0]}{more}
[effects.contrast]
# A quarter of the flow, at least 1 mL/s.
rate_mL_s = {max(1.0, flow / 4):.2f}
at = "tip"
"""


def scene_text(name: str, origin: str, curves: List[Curve], entry: Entry, body: str = "") -> str:
    """The scene as TOML, in which each number has its origin as a comment. `body`: keys of the X-ray picture's body."""
    thinnest = min(float(curve.radii.min()) for curve in curves)
    length = sum(float(curve.lengths_mm()[-1]) for curve in curves)
    middle = np.vstack([curve.points for curve in curves])
    center = (middle.min(axis=0) + middle.max(axis=0)) / 2
    others = "".join(
        f"#   {one_.name}: point_mm = {_list(one_.point_mm)}, direction = {_list(one_.direction, 4)}, radius {one_.radius_mm:.2f} mm\n"
        for one_ in entries_of(curves)
    )
    angles = "".join(f"#   {view}\n" for view in views.find(curves))
    if angles:
        angles = "# C-arm angles at which the first 30 mm of a branch and its parent span the largest area:\n" + angles
    text = f"""# A patient's vessels, made by torquer-import from {origin}. Frame: LPS in mm.
name = "{name}"

[vessel]
kind = "surface"
file = "surface.stl"
mesh_unit = "mm"
# Half of the smallest radius of a centerline, {thinnest:.2f} mm, within 0.15 to 0.5 mm.
voxel_mm = {min(0.5, max(0.15, thinnest / 2)):.2f}
centerlines = "centerlines"
# A nearly rigid wall; a scan does not show its stiffness.
wall_stiffness_N_mm2 = 10

# The frame of the file is LPS.
[patient_axes]
left = "+x"
posterior = "+y"
superior = "+z"

# {entry.name}: {_BEHIND_RADII:g} radii ({entry.radius_mm:.2f} mm) behind the tip, in the direction over the same length.
# All places where an instrument can enter:
{others}[entry]
point_mm = {_list(entry.point_mm)}
direction = {_list(entry.direction, 4)}

{wire_text(is_thick(entry), entry.direction, length)}
# Usual for a coated wire; the scan does not show it.
[effects.friction]
coefficient = 0.08

# A wire that reaches the end of the vessel leaves the model there.
[effects.outlets]

{_flow_text(curves, entry)}
[effects.fluoroscopy]
# Middle of the centerlines.
isocenter_mm = {_list(center)}
{body}{angles}"""
    target = _target(curves, entry)
    if target is not None:
        text += f"""
[effects.wall_force]
threshold_mN = 150

# Three quarters along the longest branch.
[effects.assessment]
target_centerline = "{target[0].name}"
target_at_mm = {target[1]:.1f}
# Half more than the radius there, within 1 to {_MOST_TARGET_MM:g} mm.
target_radius_mm = {min(_MOST_TARGET_MM, max(1.0, 1.5 * float(np.interp(target[1], target[0].lengths_mm(), target[0].radii)))):.2f}
force_limit_mN = 300
"""
    return text


def draw(path: pathlib.Path, mesh: Mesh, curves: List[Curve], entries: List[Entry]) -> None:
    """Picture of the surface, the curves with their names and the entries, from front and left."""
    need("matplotlib").use("Agg")
    figure = need("matplotlib.figure").Figure(figsize=(12, 8), dpi=100)
    for k, (across, label) in enumerate(((0, "left of the patient, mm"), (1, "posterior, mm")), 1):
        axes = figure.add_subplot(1, 2, k, aspect="equal")
        axes.plot(mesh.points[:, across], mesh.points[:, 2], ",", color="0.75")
        for curve in curves:
            axes.plot(curve.points[:, across], curve.points[:, 2], linewidth=1)
            axes.annotate(curve.name, (curve.points[-1][across], curve.points[-1][2]), fontsize=8)
        for entry in entries:
            axes.plot(entry.point_mm[across], entry.point_mm[2], "k^", markersize=4)
        axes.set_xlabel(label)
        axes.set_ylabel("superior, mm")
    figure.savefig(path)
