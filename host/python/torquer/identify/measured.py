"""Measured values: a table of hand motions with readings, and the shapes of the wire at some of its rows."""

from __future__ import annotations

import dataclasses
import os
from typing import Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from .. import Error, Scene
from .._cells import Cells, cell_number
from ..validate import shapes as measured_shapes

Array = npt.NDArray[np.float64]
HANDS = ("insertion_mm", "rotation_rad")
TIPS = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
_MOST_ROWS = 100_000
# R writes NA.
_NOT_MEASURED = ("", "NA")


@dataclasses.dataclass(frozen=True)
class Row:
    """Hands at a time, and what was measured there."""

    line: int
    time_s: float
    hands: Array
    """Shape (instruments, 2): insertion, mm, and rotation, rad."""
    readings: Dict[str, float]
    """Measured values by the names of their columns."""
    shape: Optional[Array]
    """Points of the innermost instrument, shape (n, 3), mm."""


@dataclasses.dataclass(frozen=True)
class Table:
    """Rows in the order of time."""

    path: str
    rows: List[Row]
    columns: List[str]
    """Names of the measured readings."""

    def values(self) -> int:
        """Number of independent measured values. A point of a shape has two: it is free along the wire."""
        return sum(len(row.readings) + (0 if row.shape is None else 2 * len(row.shape)) for row in self.rows)


def _hand_columns(where: str, names: Sequence[str], instruments: Sequence[str]) -> Dict[str, Tuple[int, int]]:
    """Instrument and component of each column that moves a hand."""
    out = {}
    for k, instrument in enumerate(instruments):
        for component, what in enumerate(HANDS):
            for name in (f"{instrument}.{what}", what) if k == 0 else (f"{instrument}.{what}",):
                if name in names:
                    out[name] = (k, component)
    if not out:
        raise Error(f"{where}: no column moves an instrument; give {instruments[0]}.insertion_mm or {instruments[0]}.rotation_rad")
    if len(set(out.values())) < len(out):
        raise Error(f"{where}: a hand has two columns; keep insertion_mm or {instruments[0]}.insertion_mm, and one rotation")
    return out


def read(scene: Scene, path: Union[str, "os.PathLike[str]"], shapes_path: Optional[str] = None) -> Table:
    """Reads a table, and the shapes that its column `shape` names.

    Raises Error naming file, line, column, value and remedy.
    """
    path = os.fspath(path)
    shapes = {}
    if shapes_path is not None:
        shapes = {shape.name: shape.points for shape in measured_shapes.read(shapes_path)[0]}
    cells = Cells(path)
    names = cells.names
    if "time_s" not in names:
        raise Error(f"{path}:{cells.line}: the column time_s is missing; give the time of each row, in s")
    if "" in names:
        place = names.index("") + 1
        raise Error(f"{path}:{cells.line}: column {place} has no name; name it or remove it (in R: row.names = FALSE)")
    moving = _hand_columns(f"{path}:{cells.line}", names, [one.name for one in scene.instruments])
    columns = [name for name in names if name not in ("time_s", "shape", *moving)]
    rows: List[Row] = []
    hands = np.zeros((len(scene.instruments), 2))
    for line, row in cells.rows():
        where = f"{path}:{line}"
        if len(rows) == _MOST_ROWS:
            raise Error(f"{where}: more than {_MOST_ROWS} rows; give fewer")
        time_s = cell_number(where, "time_s", row["time_s"])
        if rows and not time_s > rows[-1].time_s:
            raise Error(f"{where}: time_s is {time_s:g}, after {rows[-1].time_s:g}; order the rows by time")
        if not rows and time_s < 0:
            raise Error(f"{where}: time_s is {time_s:g}; begin at 0 or later")
        hands = hands.copy()
        for name, at in moving.items():
            hands[at] = cell_number(where, name, row[name])
        readings = {name: cell_number(where, name, row[name]) for name in columns if row[name] not in _NOT_MEASURED}
        shape = row.get("shape", "")
        if shape in _NOT_MEASURED:
            shape = ""
        elif shape not in shapes:
            raise Error(f"{where}: there is no shape {shape[:40]!r}; give it in the file of --shapes")
        rows.append(Row(line, time_s, hands, readings, shapes[shape] if shape else None))
    table = Table(path, rows, columns)
    if table.values() == 0:
        raise Error(f"{path}: nothing was measured; add a column for each reading, or one named shape")
    return table
