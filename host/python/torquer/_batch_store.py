"""The folder in which torquer-batch keeps what it has found.

    readings.jsonl   a line for each case: its key, what it is called, its readings; only added to
    shapes/KEY.zip   zarr of each case: "series" (rows, columns), and nodes of the wire
    failures.jsonl   of the last run: a line for each case that failed
    readings.csv, report.html   made of these

A case is stored when its line is: its shapes are on the disk by then. What a run that was killed
left half-written is not stored, and is written again.
"""

from __future__ import annotations

import fcntl
import json
import os
import pathlib
import types
from typing import Any, Dict, Iterable, List, Optional, Set, Type

import numpy as np

from . import Error
from ._batch_case import Result
from ._batch_study import Case, need


class Stopped(Error):
    """A run that cannot go on; what was done is stored."""


def write_whole(path: pathlib.Path, text: str) -> None:
    """Writes a file that is the old one or the new one at any moment."""
    part = path.with_name(f"{path.name}.part")
    with part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)
    _sync(path.parent)


def _sync(path: pathlib.Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class Store:
    """Open for one run at a time."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self.readings: Dict[str, Dict[str, Any]] = {}
        """By the key of the case."""
        self._zarr = need("zarr", "python3-zarr")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = (folder / "lock").open("w", encoding="utf-8")
        except OSError as error:
            raise Error(f"{folder}: {error.strerror}; choose another folder with --out") from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise Error(f"{folder}: another torquer-batch writes there; wait for it, or choose another folder with --out") from None
        try:
            self._open()
        except OSError as error:
            raise Error(f"{folder}: {error.strerror}") from None

    def __enter__(self) -> "Store":
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[types.TracebackType],
    ) -> None:
        self._lines.close()
        self._lock.close()

    def _open(self) -> None:
        path = self.folder / "readings.jsonl"
        whole = 0
        if path.exists():
            with path.open("rb") as file:
                for number, line in enumerate(file, 1):
                    if not line.endswith(b"\n"):
                        break  # cut off by a kill or a full disk
                    try:
                        record = json.loads(line)
                        self.readings[record["key"]] = record["readings"]
                    except (ValueError, KeyError, TypeError):
                        raise Error(
                            f"{path}:{number}: is not a line of torquer-batch; remove the line, and its case is run again"
                        ) from None
                    whole += len(line)
        self._lines = path.open("ab")
        self._lines.truncate(whole)
        self._shapes = self.folder / "shapes"
        self._shapes.mkdir(exist_ok=True)
        # What a run that was killed was about to store.
        for left in self._shapes.iterdir():
            if left.suffix == ".part" or (left.suffix == ".zip" and left.stem not in self.readings):
                left.unlink()

    def keep(self, case: Case, result: Result) -> None:
        """Stores a case, on the disk when this returns. Raises Error where the disk does not take it."""
        arrays: Dict[str, Any] = {"series": result.series}
        if result.shapes:
            # One after the other; row k has the nodes from first_node[k] to first_node[k + 1].
            arrays["nodes_mm"] = np.concatenate(result.shapes)
            arrays["first_node"] = np.cumsum([0, *(len(shape) for shape in result.shapes)])
        path = self._shapes / f"{case.key}.zip"
        part = path.with_suffix(".part")
        try:
            with self._zarr.ZipStore(str(part), mode="w") as zipped:
                group = self._zarr.group(zipped)
                group.attrs.update({"case": case.labels, "columns": result.columns})
                for name, values in arrays.items():
                    group.create_dataset(name, data=values, chunks=False)
            _sync(part)
            part.replace(path)
            _sync(self._shapes)
            record = {"key": case.key, "case": case.labels, "readings": result.readings}
            self._lines.write(json.dumps(record).encode() + b"\n")
            self._lines.flush()
            os.fsync(self._lines.fileno())
        except OSError as error:
            raise Stopped(f"{self.folder}: {error.strerror}; what was stored before is kept, run the command again") from None
        self.readings[case.key] = result.readings

    def finish(self, rows: List[Dict[str, Any]], failures: Iterable[Dict[str, Any]], page: str) -> None:
        """Writes the table of the study's cases, its failures, and its page."""
        names: List[str] = []
        seen: Set[str] = set()
        for row in rows:
            for name in row:
                if name not in seen:
                    seen.add(name)
                    names.append(name)
        lines = [",".join(map(_cell, names))]
        lines += [",".join(_cell(row.get(name, "")) for name in names) for row in rows]
        try:
            write_whole(self.folder / "readings.csv", "\n".join(lines) + "\n")
            write_whole(self.folder / "failures.jsonl", "".join(json.dumps(failure) + "\n" for failure in failures))
            write_whole(self.folder / "report.html", page)
        except OSError as error:
            raise Stopped(f"{self.folder}: {error.strerror}; the cases are stored, run the command again") from None


def _cell(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n') else text
