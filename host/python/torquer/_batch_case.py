"""Runs one case of torquer-batch in a worker, from its first row to its last."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import threading
from typing import Any, Dict, List, Tuple

import numpy as np
import numpy.typing as npt

from . import Error, Scene, Simulation
from ._batch_study import Case, file_hashes

_lock = threading.Lock()


@dataclasses.dataclass(frozen=True)
class Result:
    """Stored results of a case."""

    readings: Dict[str, Any]
    """One row of the table: numbers, true or false, and the hash of the last state as text."""
    columns: List[str]
    """Columns of the series: time_s, places and tips of the instruments, every reading."""
    series: npt.NDArray[np.float64]
    """Shape (rows of the motion, columns)."""
    shapes: List[npt.NDArray[np.float64]]
    """Nodes of the wire, shape (nodes, 3), mm: for no row, the last row, or each row."""


@functools.lru_cache(maxsize=4)
def _load(text: str, folder: str, path: str, _files: Tuple[str, ...]) -> Scene:
    return Scene.from_text(text, folder, path)


def _require_same(folder: str, named: Tuple[str, ...], files: Tuple[str, ...]) -> None:
    if file_hashes(named, {}) != files:
        raise Error(f"{folder}: a file of the scene has changed since the case was made; run the command again")


@functools.lru_cache(maxsize=4)
def _load_with(
    text: str, folder: str, path: str, values: str, named: Tuple[str, ...], files: Tuple[str, ...]
) -> Scene:
    # Equal hashes before and after the loading prove that these files were loaded.
    _require_same(folder, named, files)
    scene = _load(text, folder, path, files).with_values(json.loads(values))
    _require_same(folder, named, files)
    return scene


def _scene(case: Case) -> Scene:
    # Only one of the threads that need a scene loads it.
    with _lock:
        return _load_with(case.text, case.folder, case.path, json.dumps(case.values), case.named, case.files)


def run(case: Case) -> Result:
    """Runs a case. Raises torquer.Error if the simulator refuses it."""
    scene = _scene(case)
    simulation = Simulation(scene)
    names = [info.name for info in scene.instruments]
    rows = scene.parse_script(case.script.text, case.script.path)
    moved: List[npt.NDArray[np.float64]] = []
    readings: Dict[str, List[float]] = {}
    shapes: List[npt.NDArray[np.float64]] = []
    unconverged = ticks = iterations = 0
    penetration_mm = 0.0
    outside = False
    for number, row in enumerate(rows):
        report = simulation.step_row(row)
        unconverged += not report.converged
        ticks += report.ticks
        iterations += report.iterations
        penetration_mm = max(penetration_mm, simulation.max_penetration_mm)
        outside = outside or simulation.outside_lumen
        moved.append(np.concatenate([[row.time_s], *np.hstack([simulation.places, simulation.tips_mm])]))
        for name, value in simulation.readings().items():
            readings.setdefault(name, [math.nan] * number).append(float(value))
        if case.shapes == "rows" or (case.shapes == "last" and number + 1 == len(rows)):
            shapes.append(np.array(simulation.nodes_mm))
    if case.script.named:
        # The same proof for the devices of exchanges.
        _require_same(case.folder, case.named, case.files)

    tip = simulation.tips_mm[0]
    table: Dict[str, Any] = {
        "rows": len(rows),
        "ticks": ticks,
        "iterations": iterations,
        "unconverged_rows": unconverged,
        "solver_error_mm": simulation.solver_error_mm(),
        "largest_penetration_mm": penetration_mm,
        "outside_lumen": outside,
        "energy_mJ": simulation.energy_mJ,
        "tip_x_mm": float(tip[0]),
        "tip_y_mm": float(tip[1]),
        "tip_z_mm": float(tip[2]),
        "state_hash": f"{simulation.state_hash:016x}",
    }
    for name, values in readings.items():
        table[name] = values[-1]
        table[f"largest.{name}"] = max((value for value in values if not math.isnan(value)), default=math.nan)
    # JSON has no NaN; a value that is not known is null there.
    table = {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in table.items()}
    of_instruments = ("insertion_mm", "rotation_rad", "tip_x_mm", "tip_y_mm", "tip_z_mm")
    moves = ["time_s", *(f"{name}.{what}" for name in names for what in of_instruments)]
    series = np.column_stack([np.array(moved), *(np.array(values) for values in readings.values())])
    return Result(table, [*moves, *readings], series, shapes)
