"""Reads the files of torquer-simulator --states into arrays of numpy."""

from __future__ import annotations

import os
import struct
from typing import Any, Dict, Iterator, List, Mapping, Union

import numpy as np
import numpy.typing as npt

from . import _torquer
from ._names import UnknownName, did_you_mean, shown
from ._user_file import load_json, open_file

Error = _torquer.Error
Array = npt.NDArray[Any]
Path = Union[str, "os.PathLike[str]"]

MAGIC = b"TQSTATES"
_VERSION = 2
_MOST_HEADER_BYTES = 1 << 20
_MOST_NODES = 100_000
_SHAPES = {(): 0, ("nodes",): 1, ("nodes", 3): 3}
_AGAIN = "write the file again with torquer-simulator --states"
# Until the event has happened, their time is NaN. Earlier builds wrote -1.
_EVENT_TIMES = ("target_reached_s", "wall_force_event_s", "left_model_event_s", "injection_start_s", "mask_lost_s")


class States(Mapping[str, Union[Array, List[Array]]]):
    """The states of a run, field by field.

    states["time_s"] has the shape (rows,). A field of the wire's nodes is a list with an array for each row, because
    their number changes. So `states["nodes_mm"][k]` has the shape (nodes, 3), `states["tension_mN"][k]` the shape
    (nodes,).
    """

    def __init__(self, fields: Dict[str, Union[Array, List[Array]]], units: Dict[str, str], rows: int) -> None:
        self._fields = fields
        self.units = units
        """Unit of each field, as "mm" or "mN/mm"; "1": no unit. A file of JSON has none, so they are those of the names."""
        self.rows = rows

    def __getitem__(self, name: str) -> Union[Array, List[Array]]:
        if name not in self._fields:
            near = did_you_mean(name, self._fields)
            raise UnknownName(f"there is no field {shown(name)}; {near}there are: {', '.join(self._fields)}")
        return self._fields[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def __repr__(self) -> str:
        return f"<torquer.States: {self.rows} rows of {', '.join(self._fields)}>"


def _header(path: str, data: bytes) -> Any:
    if len(data) < 16:
        raise Error(f"{path}: has {len(data)} bytes, no header; {_AGAIN}")
    version, size = struct.unpack_from("<II", data, 8)
    if version != _VERSION:
        raise Error(f"{path}: states of version {version}; this Torquer reads version {_VERSION}: {_AGAIN}")
    if size % 8 or size > _MOST_HEADER_BYTES or 16 + size > len(data):
        raise Error(f"{path}: a header of {size} bytes in a file of {len(data)}; {_AGAIN}")
    try:
        fields = load_json(data[16 : 16 + size])["fields"]
        names = [field["name"] for field in fields]
        known = all(
            isinstance(field["name"], str)
            and isinstance(field["unit"], str)
            and field["type"] in ("f8", "i8", "u8")
            and tuple(field["shape"]) in _SHAPES
            and (not field["shape"] or field["type"] == "f8")
            for field in fields
        )
        known = known and 0 < len(set(names)) == len(names)
    except (ValueError, KeyError, TypeError):
        known = False
    if not known:
        raise Error(f"{path}: its header does not name fields with unit, type and shape; {_AGAIN}")
    return 16 + size, fields


def _forget_negative_times(fields: Dict[str, Union[Array, List[Array]]]) -> None:
    for name in _EVENT_TIMES:
        times = fields.get(name)
        if isinstance(times, np.ndarray) and (times < 0).any():
            fields[name] = np.where(times < 0, np.nan, times)


def _read_binary(path: str, data: bytes) -> States:
    at, fields = _header(path, data)
    single = [field for field in fields if not field["shape"]]
    of_nodes = [field for field in fields if field["shape"]]
    columns = [_SHAPES[tuple(field["shape"])] for field in of_nodes]
    words: List[Array] = []
    arrays: Dict[str, List[Array]] = {field["name"]: [] for field in of_nodes}
    while at < len(data):
        left = len(data) - at
        size = 8 * (len(columns) + len(single))
        counts = struct.unpack_from(f"<{len(columns)}Q", data, at) if size <= left else ()
        if counts and max(counts) > _MOST_NODES:
            raise Error(f"{path}: row {len(words) + 1} has {max(counts)} nodes, not up to {_MOST_NODES}; {_AGAIN}")
        size += 8 * sum(nodes * count for nodes, count in zip(counts, columns))
        if size > left:
            raise Error(f"{path}: row {len(words) + 1} ends after {left} of {size} bytes; {_AGAIN}")
        begin = at + 8 * len(columns)
        words.append(np.frombuffer(data, "<u8", len(single), begin))
        begin += 8 * len(single)
        for field, nodes, count in zip(of_nodes, counts, columns):
            values = np.frombuffer(data, "<f8", nodes * count, begin)
            arrays[field["name"]].append(values.reshape(nodes, 3) if count == 3 else values)
            begin += 8 * nodes * count
        at += size
    table = np.array(words, "<u8").reshape(len(words), len(single))
    found: Dict[str, Union[Array, List[Array]]] = {}
    for field in fields:
        if field["shape"]:
            found[field["name"]] = arrays[field["name"]]
        else:
            column = np.ascontiguousarray(table[:, single.index(field)])
            found[field["name"]] = column.view("<" + field["type"])
    _forget_negative_times(found)
    return States(found, {field["name"]: field["unit"] for field in fields}, len(words))


def _column(path: str, name: str, values: List[Any]) -> Union[Array, List[Array]]:
    try:
        if isinstance(values[0], list):
            arrays = [np.array(value, float) for value in values]
            if all(array.ndim == 1 or array.shape[1:] == (3,) for array in arrays):
                return arrays
        elif isinstance(values[0], str):
            return np.array([int(value) for value in values], np.uint64)
        elif all(type(value) is int for value in values):
            return np.array(values, np.int64)
        else:
            # NaN is null in the file.
            return np.array([np.nan if value is None else value + 0.0 for value in values])
    except (ValueError, TypeError, OverflowError):
        pass
    raise Error(f"{path}: field {name} does not hold the same kind of numbers in all lines; {_AGAIN}")


def _read_json(path: str, data: bytes) -> States:
    rows: List[Any] = []
    for number, line in enumerate(data.splitlines(), 1):
        try:
            row = load_json(line)
        except ValueError as error:
            raise Error(f"{path}:{number}: not valid JSON ({error}); {_AGAIN}") from None
        if not isinstance(row, dict) or rows and row.keys() != rows[0].keys():
            raise Error(f"{path}:{number}: not an object with the fields of the line before; {_AGAIN}")
        rows.append(row)
    names = list(rows[0]) if rows else []
    found = {name: _column(path, name, [row[name] for row in rows]) for name in names}
    _forget_negative_times(found)
    return States(found, {name: _torquer.unit_of(name) for name in names}, len(rows))


def read_states(path: Path) -> States:
    """Reads a file of torquer-simulator --states, JSON or binary (.bin), or a .partial of either.

    Arrays of nodes share the memory of a binary file, and cannot be written to. Other fields are copied.
    """
    path = os.fspath(path)
    try:
        with open_file(path) as file:
            data = file.read()
    except OSError as error:
        raise Error(f"{path}: cannot be read ({error.strerror}); check the disk") from None
    return _read_binary(path, data) if data.startswith(MAGIC) else _read_json(path, data)
