"""Wires of a scene that may have given a measured shape, and the choice among them."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from .. import Scene, Simulation
from .._polyline import arcs_of, at_arcs, rms, to_nearest
from ._base import Error, Points, Values, as_tuple
from .paths import Lumen
from .shapes import Curve, Shape

METHODS = {
    "wire_pushed": "wire, tip free: pushed in from the entry at one rotation",
    "wire_laid": "wire, tip in the measured branch: laid along the middle of the lumen to the measured tip, then free",
    "wire_held": "wire, tip given: laid in the same way, its tip held at the measured tip by a spring",
    "middle": "baseline: middle of the lumen to the measured tip",
    "shortest": "baseline: shortest way in the lumen to the measured tip",
}
ROTATIONS = 12
REFINED_DEG = (-10.0, 10.0)
LONGER = (0.0, 0.01, 0.02, 0.03)
"""Excesses of the inserted length over the measured one, as shares of it."""
HOLD_N_MM = 0.5
APART_MM = 1.0
ALIKE = 1.1
"""Ratio of RMS distances within which another shape fits alike."""
_LEAST_MM = 10.0
_ROOM_MM, _STAYS_MM, _DIRECTION_MM = 0.2, 2.0, 10.0
_PUSH_MM, _TURN_RAD, _STEP_S, _MORE_STEPS = 1.0, math.radians(30), 0.1, 5
_COMPARED_MM = 0.5
# Another branch: its tip is farther through the lumen than this, and than this many radii of it.
_BRANCH_MM, _BRANCH_RADII = 5.0, 4.0


@dataclasses.dataclass(frozen=True)
class Measured:
    """Part of a shape from its entry to its tip, with the lengths at its points."""

    shape: Shape
    noise_mm: float
    entry_mm: Tuple[float, float, float]
    direction: Tuple[float, float, float]
    left_out_mm: float
    """Length before the entry."""
    length_mm: float
    shares: Values
    """Place of each point of the shape as a share of the length; negative before the entry."""

    def some(self, numbers: Any) -> Any:
        """Those of the points that lie behind the entry."""
        return numbers[self.shares[numbers] >= 0]

    @property
    def tip(self) -> Tuple[float, float, float]:
        return as_tuple(self.shape.points[-1])

    @property
    def slack_mm(self) -> float:
        """Uncertainty of the length by the noise at both ends, at most a hundredth of it."""
        return min(math.sqrt(2) * self.noise_mm, 0.01 * self.length_mm)


@dataclasses.dataclass(frozen=True)
class Run:
    """End of a run of the wire."""

    method: str
    rotation_deg: float
    length_mm: float
    nodes: Points
    refused: str
    """Reason why this is no fit; empty for a fit."""


@dataclasses.dataclass
class Row:
    """A line of the table: a shape by a method. Values that are not known are None."""

    shape: str
    method: str
    refused: str = ""
    rotation_deg: Optional[float] = None
    wire_mm: Optional[float] = None
    measured_mm: Optional[float] = None
    compared_mm: Optional[float] = None
    left_out_mm: Optional[float] = None
    points: Optional[int] = None
    outside_percent: Optional[float] = None
    mean_mm: Optional[float] = None
    rms_mm: Optional[float] = None
    largest_mm: Optional[float] = None
    nearest_rms_mm: Optional[float] = None
    tip_mm: Optional[float] = None
    choosing_rms_mm: Optional[float] = None
    noise_mm: Optional[float] = None
    hold_mN: Optional[float] = None
    runs: Optional[int] = None
    refused_runs: Optional[int] = None
    apart_runs: Optional[int] = None
    other_branch_runs: Optional[int] = None
    alike_runs: Optional[int] = None
    equilibria: Optional[int] = None


@dataclasses.dataclass(frozen=True)
class Fit:
    """All about one shape: its rows, and the curves of the picture by their methods."""

    shape: Shape
    rows: List[Row]
    curves: Dict[str, Points]
    entry_mm: Optional[Tuple[float, float, float]]


def wire_of(scene: Scene) -> Any:
    """The lone wire of a scene. Raises Error for scenes that cannot be compared with a shape."""
    if len(scene.instruments) != 1:
        names = ", ".join(one.name for one in scene.instruments)
        raise Error(f"{scene.path}: has the instruments {names}; keep the one that was measured")
    for effect, why in (
        ("heartbeat", "moves the vessel"), ("breathing", "moves the vessel"), ("point_load", "acts on the tip, as the fit does"),
    ):
        if effect in scene.effects:
            raise Error(f"{scene.path}: effects.{effect} {why}; remove it")
    return scene.instruments[0]


def with_name(scene: Scene) -> Scene:
    """The scene with the name of its wire written out, by which keys of the wire can be changed."""
    if "name" in tomllib.loads(scene.text)["instrument"][0]:
        return scene
    text = scene.text.replace("[[instrument]]\n", f'[[instrument]]\nname = "{scene.instruments[0].name}"\n', 1)
    return Scene.from_text(text, scene.folder, scene.path)


def measure(shape: Shape, lumen: Lumen) -> Measured:
    """Entry, direction and length by the choosing points and the tip alone.

    The entry is the first place with 0.2 mm of room for the wire, also over the next 2 mm. Its direction is that over
    the next 10 mm.
    """
    curve = Curve(shape)
    room = lumen.depth_mm(curve.points) >= lumen.radius_mm + _ROOM_MM
    bad = np.flatnonzero(~room)
    after = np.append(bad, len(room))[np.searchsorted(bad, np.arange(len(room)))]  # the next place without room
    ends = np.append(curve.arcs, math.inf)[after]
    first = np.flatnonzero(room & (ends - curve.arcs >= _STAYS_MM))
    length = float(curve.arcs[-1] - curve.arcs[first[0]]) if len(first) else 0.0
    if length < _LEAST_MM:
        raise Error(f"{length:.1f} mm of the shape lie behind a place where the wire enters the lumen; {_LEAST_MM:g} mm are needed")
    k = int(first[0])
    begin = float(curve.arcs[k])
    way = at_arcs(curve.points, [begin + _DIRECTION_MM])[0] - curve.points[k]
    measured = Measured(
        shape, curve.noise_mm, as_tuple(curve.points[k]), as_tuple(way / np.linalg.norm(way)), begin, length,
        (curve.of_points - begin) / length,
    )
    if min(len(measured.some(numbers)) for numbers in (shape.choosing(), shape.reported())) < 3:
        raise Error("fewer than 3 points of a half lie behind the entry; measure more points")
    return measured


def distances_mm(measured: Measured, line: Points, numbers: Any) -> Values:
    """Distances between points of the shape and those of a line at the same share of its length."""
    there = at_arcs(line, measured.shares[numbers] * arcs_of(line)[-1])
    out: Values = np.linalg.norm(measured.shape.points[numbers] - there, axis=1)
    return out


def largest_apart_mm(one: Points, other: Points) -> float:
    """Largest distance between the same lengths of two wires, as far as both reach."""
    common = min(float(arcs_of(one)[-1]), float(arcs_of(other)[-1]))
    at = np.arange(0, common, _COMPARED_MM)
    return float(np.linalg.norm(at_arcs(one, at) - at_arcs(other, at), axis=1).max())


class Search:
    """Runs of the wire for one shape."""

    def __init__(self, scene: Scene, lumen: Lumen, measured: Measured) -> None:
        self._scene, self._lumen, self._measured = scene, lumen, measured
        wire = wire_of(scene)
        longest = measured.length_mm * (1 + LONGER[-1])
        if wire.max_length_mm < longest:
            raise Error(
                f"the wire is shorter than the shape: instrument.{wire.name}.max_length_mm is {wire.max_length_mm:g}, "
                f"and up to {longest:.1f} mm are inserted; raise it"
            )
        self._start_key = f"instrument.{wire.name}.inserted_at_start_mm"
        self.held_at = lumen.moved_inside(measured.tip)
        self.middle = lumen.way(measured.entry_mm, self.held_at, True)
        self.shortest = lumen.way(measured.entry_mm, self.held_at, False)

    def __repr__(self) -> str:
        return f"Search(scene={self._scene.name!r}, shape={self._measured.shape.name!r})"

    def _scene_of(self, method: str) -> Scene:
        values: Dict[str, Any] = {f"entry.{key}": None for key in ("centerline", "at_mm", "towards", "towards_at_mm", "offset_mm")}
        values |= {"entry.point_mm": self._measured.entry_mm, "entry.direction": self._measured.direction}
        if method == "wire_pushed":
            return self._scene.with_values({**values, "entry.path_mm": None, self._start_key: None})
        values["entry.path_mm"] = [tuple(point) for point in self.middle[1:]]
        values[self._start_key] = min(self._measured.length_mm, float(arcs_of(self.middle)[-1]))
        if method == "wire_held":
            values |= {"effects.point_load.clamp_N_mm": HOLD_N_MM, "effects.point_load.clamp_point_mm": self.held_at}
        return self._scene.with_values(values)

    def runs(self, method: str) -> List[Run]:
        """Runs at each rotation of a grid and next to the best of them, with each length."""
        start = Simulation(self._scene_of(method))
        found: List[Run] = []
        for k in range(ROTATIONS):
            found += self._turned(start, method, 360.0 / ROTATIONS * k)
        best = self.best(found)
        if best is not None:
            for more in REFINED_DEG:
                found += self._turned(start, method, best.rotation_deg + more)
        return found

    def _turned(self, start: Simulation, method: str, rotation_deg: float) -> List[Run]:
        """Turns a copy of a start, and pushes it to each length."""
        simulation = start.copy()
        hands = simulation.hands
        turn = math.remainder(math.radians(rotation_deg), 2 * math.pi)
        report = None
        steps = max(1, math.ceil(abs(turn) / _TURN_RAD - 1e-9))
        for k in range(1, steps + 1):
            hands[0, 1] = turn * k / steps
            report = simulation.step(simulation.time_s + _STEP_S, hands)
        found = []
        for longer in LONGER:
            length = self._measured.length_mm * (1 + longer)
            while hands[0, 0] < length:
                hands[0, 0] = min(length, hands[0, 0] + _PUSH_MM)
                report = simulation.step(simulation.time_s + _STEP_S, hands)
            for _ in range(_MORE_STEPS):
                if report is not None and report.converged:
                    break
                report = simulation.step(simulation.time_s + _STEP_S, hands)
            refused = self._fault(simulation, report is not None and report.converged)
            found.append(Run(method, math.degrees(turn), float(simulation.places[0, 0]), simulation.nodes_mm.copy(), refused))
        return found

    def _fault(self, simulation: Simulation, converged: bool) -> str:
        lacking = self._measured.length_mm - float(arcs_of(simulation.nodes_mm)[-1])
        if lacking > self._measured.slack_mm + 1e-6:
            return f"the wire is {lacking:.2f} mm shorter than the shape"
        if simulation.outside_lumen:
            return "the wire is outside the lumen"
        return "" if converged else "the wire did not converge"

    def choosing_rms(self, line: Points) -> float:
        return rms(distances_mm(self._measured, line, self._measured.some(self._measured.shape.choosing())))

    def best(self, runs: Sequence[Run]) -> Optional[Run]:
        """The run of the least RMS distance from the choosing points, among those that are not refused."""
        good = [run for run in runs if not run.refused]
        return min(good, key=lambda run: self.choosing_rms(run.nodes)) if good else None

    def row(self, method: str, line: Points) -> Row:
        """Figures of a line, by the reported points."""
        measured, lumen = self._measured, self._lumen
        points = measured.shape.points
        numbers = measured.some(measured.shape.reported())
        distances = distances_mm(measured, line, numbers)
        every = points[measured.shares >= 0]
        return Row(
            measured.shape.name, method, wire_mm=float(arcs_of(line)[-1]), measured_mm=measured.length_mm,
            compared_mm=float(measured.length_mm * np.ptp(measured.shares[numbers])), left_out_mm=measured.left_out_mm,
            points=len(numbers), outside_percent=100 * float((lumen.depth_mm(every) < 0).mean()), mean_mm=float(distances.mean()),
            rms_mm=rms(distances), largest_mm=float(distances.max()), nearest_rms_mm=rms(np.linalg.norm(to_nearest(points[numbers], line), axis=1)),
            tip_mm=float(np.linalg.norm(line[-1] - measured.tip)), choosing_rms_mm=self.choosing_rms(line),
            noise_mm=measured.noise_mm,
        )

    def count_others(self, row: Row, best: Run, runs: Sequence[Run]) -> None:
        """Counts the runs of the same inserted length that end elsewhere."""
        near = [run for run in runs if abs(run.length_mm - best.length_mm) < 1e-6 and not run.refused]
        apart = [run for run in near if largest_apart_mm(run.nodes, best.nodes) > APART_MM]
        depth = float(self._lumen.depth_mm(self.middle[-10:]).max())
        reach = max(_BRANCH_MM, _BRANCH_RADII * depth)
        kinds = [best]
        for run in apart:
            if all(largest_apart_mm(run.nodes, kind.nodes) > APART_MM for kind in kinds):
                kinds.append(run)
        row.runs, row.apart_runs, row.equilibria = len(near), len(apart), len(kinds)
        row.other_branch_runs = sum(self._lumen.length_mm(self.held_at, run.nodes[-1]) > reach for run in near)
        row.alike_runs = sum(self.choosing_rms(run.nodes) <= ALIKE * self.choosing_rms(best.nodes) for run in apart)


def fit(scene: Scene, lumen: Lumen, shape: Shape) -> Fit:
    """Rows and curves of a shape. A shape or method that gives no figures has a reason in `refused`."""
    try:
        measured = measure(shape, lumen)
        search = Search(scene, lumen, measured)
    except Error as error:
        return Fit(shape, [Row(shape.name, method, refused=str(error)) for method in METHODS], {}, None)
    curves: Dict[str, Points] = {"middle": search.middle, "shortest": search.shortest}
    rows = {method: search.row(method, line) for method, line in curves.items()}
    runs: Dict[str, List[Run]] = {}
    for method in ("wire_pushed", "wire_laid", "wire_held"):
        try:
            runs[method] = search.runs(method)
        except Error as error:
            rows[method] = Row(shape.name, method, refused=str(error))
    free = runs.get("wire_pushed", []) + runs.get("wire_laid", [])
    for method, own in runs.items():
        best = search.best(own)
        if best is None:
            rows[method] = Row(shape.name, method, refused=own[0].refused, refused_runs=len(own))
            continue
        row = rows[method] = search.row(method, best.nodes)
        row.rotation_deg = best.rotation_deg
        row.refused_runs = sum(bool(run.refused) for run in own)
        search.count_others(row, best, own if method == "wire_held" else free)
        if method == "wire_held":
            row.hold_mN = 1000 * HOLD_N_MM * float(np.linalg.norm(best.nodes[-1] - search.held_at))
        curves[method] = best.nodes
    return Fit(shape, [rows[method] for method in METHODS], curves, measured.entry_mm)
