"""An experiment: a scene whose hands move as the measured ones, and what it predicts for each measured value."""

from __future__ import annotations

import math
import tomllib
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Dict, List, Mapping, Sequence, Tuple

import numpy as np
import numpy.typing as npt

from .. import Error, Scene, Simulation
from .._names import did_you_mean
from .._polyline import to_nearest
from ..validate.fit import with_name
from .measured import TIPS, Row, Table

Array = npt.NDArray[np.float64]
SHAPE = "shape"
# Relaxed so far in every part of the motion that differences of nearby values are smooth.
_TOLERANCE = 1e-8
_LONGEST_FEED_MM, _LONGEST_TURN_RAD = 0.25, 0.2
# Step of the differences, in parts of the value.
_STEP = 2e-3
_THREADS = 2


class Vary:
    """A value of a scene that is varied: a number, or a list of numbers of which all change in proportion."""

    def __init__(self, scene: Scene, key: str, start: Any = None) -> None:
        self.key = key
        self.start = _value(scene, key) if start is None else start
        numbers = self.start if isinstance(self.start, list) else [self.start]
        if not numbers or not all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in numbers):
            raise Error(f"{scene.path}: {key} is {self.start!r}; vary a number, or a list of numbers")
        if not any(numbers):
            raise Error(f"{scene.path}: {key} is 0; give a start, as in {key}=0.1")

    def __repr__(self) -> str:
        return f"Vary(key={self.key!r}, start={self.start!r})"

    def at(self, factor: float) -> Any:
        """The value that is `factor` times the start."""
        if isinstance(self.start, list):
            return [float(factor * one) for one in self.start]
        return float(factor * self.start)


def _value(scene: Scene, key: str) -> Any:
    table: Any = tomllib.loads(scene.text)
    parts = key.split(".")
    if parts[0] == "instrument" and len(parts) > 2 and isinstance(table.get("instrument"), list):
        named = [one.name for one in scene.instruments]
        if parts[1] not in named:
            near = did_you_mean(parts[1], named)
            raise Error(f"{scene.path}: there is no instrument {parts[1]!r}; {near}there are: {', '.join(named)}")
        table, parts = table["instrument"][named.index(parts[1])], parts[2:]
    for part in parts:
        if not isinstance(table, dict) or part not in table:
            raise Error(f"{scene.path}: {key} is not in the scene; add it, or give a start, as in {key}=1")
        table = table[part]
    return table


class Experiment:
    """Predicts the measured values of a table by a scene with other values of its keys.

    `vary`: keys as Scene.with_values takes them, by name or as {key: start}. Raises Error naming file, key or column,
    value and remedy.
    """

    def __init__(self, scene: Scene, table: Table, vary: Sequence[str] | Mapping[str, Any]) -> None:
        starts = vary if isinstance(vary, Mapping) else {key: None for key in vary}
        if not starts:
            raise Error("no key is varied; name one, as in instrument.guidewire.rigidity_N_mm2")
        self.scene, self.table = with_name(scene), table
        self.keys = [Vary(self.scene, key, start) for key, start in starts.items()]
        self.groups = self._groups()
        if len(self.groups) <= len(self.keys):
            raise Error(f"{table.path}: has {table.values()} measured values for {len(self.keys)} keys; measure more, or vary fewer")
        self._check_columns()

    def __repr__(self) -> str:
        return f"Experiment(scene={self.scene.name!r}, measured={str(self.table.path)!r}, keys={self.keys!r})"

    def _groups(self) -> List[str]:
        """Name of the kind of each residual."""
        out: List[str] = []
        for row in self.table.rows:
            out += list(row.readings)
            out += [SHAPE] * (0 if row.shape is None else 3 * len(row.shape))
        return out

    def scene_at(self, factors: npt.ArrayLike) -> Scene:
        """The scene with each varied value at a multiple of its start."""
        return self.scene.with_values({key.key: key.at(factor) for key, factor in zip(self.keys, np.asarray(factors, float))})

    def residuals(self, factors: npt.ArrayLike) -> Array:
        """Predicted minus measured values, in the order of `groups`; those of a shape are vectors, mm.

        A point of a shape is compared with the nearest point of the wire.
        """
        return self.run(factors)[0]

    def run(self, factors: npt.ArrayLike) -> Tuple[Array, List[int]]:
        """The residuals, and the lines of the table on the way to which the wire snapped."""
        simulation = Simulation(self.scene_at(factors).with_values({"relaxation.tolerance": _TOLERANCE}))
        out: List[float] = []
        snaps = []
        for row in self.table.rows:
            if _go(simulation, row, self.table.path):
                snaps.append(row.line)
            out += [_predicted(simulation, name, self.table.path, row.line) - value for name, value in row.readings.items()]
            if row.shape is not None:
                out += to_nearest(row.shape, simulation.instrument_nodes_mm(0)).ravel().tolist()
        return np.array(out), snaps

    def jacobian(self, factors: npt.ArrayLike) -> Array:
        """Derivatives of the residuals by the factors, by central differences of whole runs.

        So they include what friction keeps of the way. They do not exist where the wire snaps.
        """
        at = np.asarray(factors, float)
        moved = []
        for k, factor in enumerate(at):
            for sign in (1, -1):
                other = at.copy()
                other[k] = factor * (1 + sign * _STEP)
                moved.append(other)
        with ThreadPoolExecutor(_THREADS) as pool:
            found = list(pool.map(self.residuals, moved))
        return np.stack([(found[2 * k] - found[2 * k + 1]) / (2 * _STEP * at[k]) for k in range(len(at))], axis=1)

    def sensitivities(self, factors: npt.ArrayLike) -> List[Dict[str, Any]]:
        """Derivative of each reading of each row by each key, in the units of both.

        For a key with a list: by the factor of the list.
        """
        slopes = self.jacobian(factors)
        out = []
        at = 0
        for row in self.table.rows:
            for name in row.readings:
                for k, key in enumerate(self.keys):
                    per = 1.0 if isinstance(key.start, list) else float(key.start)
                    out.append({"line": row.line, "reading": name, "key": key.key, "derivative": float(slopes[at, k]) / per})
                at += 1
            at += 0 if row.shape is None else 3 * len(row.shape)
        return out

    def _check_columns(self) -> None:
        simulation = Simulation(self.scene)
        known = [*TIPS, *(f"{one.name}.{axis}" for one in self.scene.instruments for axis in TIPS), *simulation.readings()]
        for name in self.table.columns:
            if name not in known:
                near = did_you_mean(name[:60], known)
                raise Error(f"{self.table.path}:1: the scene has no reading {name[:60]!r}; {near}it has {', '.join(known)[:600]}")


def _predicted(simulation: Simulation, name: str, path: str, line: int) -> float:
    instrument, _, axis = name.rpartition(".")
    if axis in TIPS:
        names = [one.name for one in simulation.scene.instruments]
        return float(simulation.tips_mm[names.index(instrument) if instrument else 0][TIPS.index(axis)])
    value = simulation.readings().get(name, math.nan)
    if not math.isfinite(value):
        raise Error(f"{path}:{line}: the scene does not know {name} there; leave the cell empty")
    return value


def _go(simulation: Simulation, row: Row, path: str) -> bool:
    """Moves the hands in parts, each of which is relaxed to the tolerance. True if the wire snapped."""
    here = simulation.hands
    way = np.abs(row.hands - here)
    parts = max(1, math.ceil(way[:, 0].max() / _LONGEST_FEED_MM), math.ceil(way[:, 1].max() / _LONGEST_TURN_RAD))
    begin_s = simulation.time_s
    if row.time_s <= begin_s:
        if way.max() > 0:
            raise Error(f"{path}:{row.line}: the hands move by then, and no time has passed; give a later time_s")
        return False
    snapped = False
    for part in range(1, parts + 1):
        report = simulation.step(begin_s + (row.time_s - begin_s) * part / parts, here + (row.hands - here) * part / parts)
        if not report.converged:
            raise Error(f"{path}:{row.line}: the wire did not come to rest on the way to this row; check the scene and the motion")
        snapped = snapped or report.snapped
    return snapped


def split(groups: Sequence[str]) -> Dict[str, Tuple[Any, float]]:
    """For each kind of value: the numbers of its residuals, and how many of them are independent."""
    names = np.array(groups)
    out = {}
    for name in dict.fromkeys(groups):
        at = np.flatnonzero(names == name)
        out[name] = (at, len(at) * (2 / 3 if name == SHAPE else 1))
    return out
