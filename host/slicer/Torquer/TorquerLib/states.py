"""Reads wire shapes from a file of torquer-simulator --states."""

import json
import math
import os
from typing import Any, BinaryIO, Dict, List, NamedTuple

from .case import LPS, Points, Refused, turned

_MAGIC = b"TQSTATES"
_NODES = "nodes_mm"
_OWN_NODES = "." + _NODES
_MOST_LINE_BYTES = 64 << 20
_AGAIN = "write the file again with torquer-simulator --states FILE.jsonl"


class Shape(NamedTuple):
    """Shapes of the instruments at a time."""

    time_s: float
    lines_ras: Dict[str, Points]
    """By the instrument's name; "wire" if the file has one curve for all. One that is outside of the vessel has none."""


def chosen(count: int, most: int) -> List[int]:
    """At most `most` numbers of rows from 0 to count - 1, evenly spread, the last one included."""
    if most < 1:
        raise Refused(f"Shapes: {most} is not a number from 1 on; give how many to load")
    if most == 1:
        return [count - 1]
    return sorted({round(k * (count - 1) / (most - 1)) for k in range(most)}) if count > most else list(range(count))


def _points(where: str, field: str, value: Any) -> Points:
    good = isinstance(value, list) and bool(value)
    for row in value if good else []:
        good = good and isinstance(row, list) and len(row) == 3
        good = good and all(type(x) in (int, float) and math.isfinite(x) for x in row)
    if not good:
        raise Refused(f"{where}: field {field} is {str(value)[:40]}, not a list of points [x, y, z]; {_AGAIN}")
    return value


def _shape(where: str, line: bytes, frame: str) -> Shape:
    try:
        fields = json.loads(line)
    except ValueError as error:
        raise Refused(f"{where}: not valid JSON ({error}); {_AGAIN}") from None
    for field in ("time_s", _NODES):
        if not isinstance(fields, dict) or field not in fields:
            raise Refused(f"{where}: field {field} is missing; {_AGAIN}")
    if type(fields["time_s"]) not in (int, float):
        raise Refused(f"{where}: field time_s is {str(fields['time_s'])[:40]}, not a number; {_AGAIN}")
    own = {name[: -len(_OWN_NODES)]: name for name in fields if name.endswith(_OWN_NODES)} or {"wire": _NODES}
    every = {name: _points(where, field, fields[field]) for name, field in own.items()}
    # An instrument that has not entered has one node.
    lines = {name: turned(points) if frame == LPS else points for name, points in every.items() if len(points) > 1}
    return Shape(float(fields["time_s"]), lines)


def _rows(path: str, file: BinaryIO) -> int:
    """Number of rows. Refuses binary files and lines without an end."""
    count = 0
    while True:
        line = file.readline(_MOST_LINE_BYTES + 1)
        if not line:
            return count
        count += 1
        if count == 1 and line.startswith(_MAGIC):
            raise Refused(f"{path}: has binary states; {_AGAIN}")
        if len(line) > _MOST_LINE_BYTES:
            raise Refused(f"{path}:{count}: is longer than {_MOST_LINE_BYTES} bytes; {_AGAIN}")


def read(path: str, frame: str, most: int) -> List[Shape]:
    """At most `most` shapes, evenly spread over the rows, in RAS.

    frame: of the scene, LPS as in a case of torquer-import, or RAS.
    """
    # A pipe would block Slicer.
    if not os.path.isfile(path):
        raise Refused(f"States: {path!r} is no file; choose a file of torquer-simulator --states")
    try:
        with open(path, "rb") as file:
            count = _rows(path, file)
            if count == 0:
                raise Refused(f"{path}: holds no state; {_AGAIN}")
            wanted = set(chosen(count, most))
            file.seek(0)
            return [_shape(f"{path}:{k + 1}", line, frame) for k, line in enumerate(file) if k in wanted]
    except OSError as error:
        raise Refused(f"{path}: cannot be read ({error.strerror}); check the path") from None
