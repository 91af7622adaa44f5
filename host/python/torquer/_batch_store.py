"""Folder with the results of torquer-batch.

    torquer-batch.jsonl  mark and lock of a folder of torquer-batch, and record of the files
                     that are written there; only added to
    readings.jsonl   a line for each case: its key, its labels, its readings; only added to
    shapes/KEY.zip   zarr of each case: "series" (rows, columns), and nodes of the wire
    failures.jsonl   a line for each case that failed in the last run
    readings.csv, report.html   made from these
    shares/K-of-N/   the same for a share of the cases, which another job works on

A case is stored once its line is written: its shapes are on the disk by then. A case that a killed
run left half-written is not stored, and is run again.

The mark is written only into an empty folder. A file is removed or overwritten only if the record has it. Shapes are
recorded by their keys, the last three files by the hashes of their bytes. Symbolic links are not followed: every name
is opened in its folder's descriptor. Each store has its own lock, so that the jobs of several shares never wait.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import io
import json
import os
import pathlib
import re
import stat
import types
from typing import Any, BinaryIO, Callable, Collection, Dict, Iterable, Iterator, List, Optional, Set, Tuple, Type

import numpy as np

from . import Error
from ._batch_case import Result
from ._batch_study import Case, need
from ._user_file import load_json

_MARK = "torquer-batch.jsonl"
_VERSION = 1
# Keys of the entries of a mark, below its first line.
_ENTRIES = (("shape",), ("file", "hash"), ("study", "build"))
_SHARES = "shares"
_SHARE = re.compile(r"\d+-of-\d+")
_LINES = "readings.jsonl"
_FAILURES = "failures.jsonl"
_FINISHED = ("readings.csv", _FAILURES, "report.html")
_PART = ".torquer-batch.part"
_FOLDER_FLAGS = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
_FILE_FLAGS = os.O_NOFOLLOW | os.O_CLOEXEC


class Stopped(Error):
    """A run that cannot continue; completed cases are stored."""


class _Folder:
    """Folder with a descriptor. Its files are opened and replaced without following links."""

    def __init__(self, path: pathlib.Path, at: Optional[int] = None) -> None:
        self.path = path
        try:
            self.descriptor = os.open(path if at is None else path.name, _FOLDER_FLAGS, dir_fd=at)
        except OSError as error:
            if error.errno in (errno.ELOOP, errno.ENOTDIR):
                raise Error(f"{path}: is not a folder, or a symbolic link to one; give the folder itself, as --out") from None
            raise

    def folder(self, name: str) -> "_Folder":
        """Opens a folder in this one, and makes it before if it is missing."""
        try:
            os.mkdir(name, dir_fd=self.descriptor)
        except FileExistsError:
            pass
        return _Folder(self.path / name, self.descriptor)

    def require_own(self) -> None:
        """Raises Error if files of others are here, but not the mark."""
        others = sorted(set(os.listdir(self.descriptor)) - {_MARK, _SHARES})
        if others and not self.has(_MARK):
            raise Error(
                f"{self.path}: contains {others[0]}, but no mark of torquer-batch ({_MARK}); choose an empty or a new folder with --out"
            )

    def has(self, name: str) -> bool:
        """True if the file exists. Raises Error if the name is a link or no plain file."""
        try:
            mode = os.stat(name, dir_fd=self.descriptor, follow_symlinks=False).st_mode
        except FileNotFoundError:
            return False
        if not stat.S_ISREG(mode):
            kind = "a symbolic link" if stat.S_ISLNK(mode) else "no plain file"
            raise Error(f"{self.path / name}: is {kind}, where torquer-batch writes a file; move it away")
        return True

    def append(self, name: str) -> Any:
        """Opens a file for reading and appending."""
        self.has(name)
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | _FILE_FLAGS
        return os.fdopen(os.open(name, flags, 0o666, dir_fd=self.descriptor), "r+b")

    def read(self, name: str) -> bytes:
        self.has(name)
        with os.fdopen(os.open(name, os.O_RDONLY | _FILE_FLAGS, dir_fd=self.descriptor), "rb") as file:
            return file.read()

    def remove(self, name: str) -> None:
        if self.has(name):
            os.unlink(name, dir_fd=self.descriptor)

    def create(self, name: str) -> Any:
        """Creates a file for writing."""
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | _FILE_FLAGS
        return os.fdopen(os.open(name, flags, 0o666, dir_fd=self.descriptor), "w+b")

    def rename(self, old: str, new: str) -> None:
        os.rename(old, new, src_dir_fd=self.descriptor, dst_dir_fd=self.descriptor)
        os.fsync(self.descriptor)

    def close(self) -> None:
        os.close(self.descriptor)


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _records(path: pathlib.Path, lines: Iterable[bytes]) -> Iterator[Tuple[Dict[str, Any], bytes]]:
    """Stored cases with their lines, without a last line that a kill or a full disk cut off."""
    begin = b'{"key": "'
    for number, line in enumerate(lines, 1):
        try:
            record = load_json(line)
            _ = record["key"], record["readings"]
        except (ValueError, KeyError, TypeError):
            if not line.endswith(b"\n") and line[: len(begin)] == begin[: len(line)]:
                return
            raise Error(f"{path}:{number}: is not a line of torquer-batch; remove the line, and its case is run again") from None
        yield record, line


def _entries(path: pathlib.Path, lines: Iterable[bytes]) -> Iterator[Tuple[Dict[str, Any], bytes]]:
    """Entries of a mark with their lines, without a last line that a kill or a full disk cut off."""
    for number, line in enumerate(lines, 1):
        if not line.endswith(b"\n"):
            return
        try:
            entry = load_json(line)
            known = entry["torquer-batch"] == _VERSION if number == 1 else any(set(keys) <= set(entry) for keys in _ENTRIES)
        except (ValueError, KeyError, TypeError):
            known = False
        if not known:
            raise Error(f"{path}:{number}: is not a line of this torquer-batch; choose another folder with --out")
        yield entry, line


class _Record:
    """Mark of a folder, which records the files that torquer-batch has written there."""

    def __init__(self, folder: _Folder) -> None:
        path = folder.path
        folder.require_own()
        self._file = folder.append(_MARK)
        self.shapes: Set[str] = set()
        """Keys of cases whose shapes were written, or are about to be written."""
        self.finished: Set[Tuple[str, str]] = set()
        """Names of files that are overwritten, with the hashes of all their contents so far."""
        self._study: Optional[Dict[str, str]] = None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise Error(f"{path}: another torquer-batch writes there; wait for it, or choose another folder with --out") from None
        whole = 0
        try:
            for entry, line in _entries(path / _MARK, self._file):
                self._take(entry)
                whole += len(line)
        except Error:
            self._file.close()
            raise
        self._file.truncate(whole)
        if whole == 0:
            self._add({"torquer-batch": _VERSION})

    def _take(self, entry: Dict[str, Any]) -> None:
        if "shape" in entry:
            self.shapes.add(entry["shape"])
        elif "file" in entry:
            self.finished.add((entry["file"], entry["hash"]))
        elif "study" in entry:
            self._study = entry

    def _add(self, entry: Dict[str, Any]) -> None:
        self._file.write(json.dumps(entry).encode() + b"\n")
        self._file.flush()

    def add_shape(self, key: str) -> None:
        if key not in self.shapes:
            self._add({"shape": key})
            self.shapes.add(key)

    def add_study(self, study: Dict[str, str]) -> None:
        """Records the study and the build that the cases of a share are of."""
        if study != self._study:
            self._add(study)
            self._study = study

    def add_finished(self, name: str, data: bytes) -> None:
        if (name, _hash(data)) not in self.finished:
            self._add({"file": name, "hash": _hash(data)})
            self.finished.add((name, _hash(data)))

    def close(self) -> None:
        self._file.close()


def _contents(folder: _Folder, name: str) -> BinaryIO:
    """A file that another process may be adding to; empty if it is missing."""
    return io.BytesIO(folder.read(name) if folder.has(name) else b"")


def _is_of(study: Dict[str, str], share: _Folder) -> bool:
    """False for a share without cases. Raises Error for one of another study or build."""
    found = [entry for entry, _ in _entries(share.path / _MARK, _contents(share, _MARK)) if "study" in entry]
    if not found:
        return False
    remedy = "run this share again, or move its folder away"
    if found[-1]["build"] != study["build"]:
        raise Error(f"{share.path}: its cases are of the build {found[-1]['build']} of Torquer, but this is {study['build']}; {remedy}")
    if found[-1] != study:
        raise Error(f"{share.path}: its cases are of another study; {remedy}")
    return True


def _failures(share: _Folder) -> Dict[str, str]:
    """Messages of the failed cases of a share, by their labels as JSON."""
    try:
        found = map(load_json, _contents(share, _FAILURES))
        return {json.dumps(failure["case"]): failure["message"] for failure in found}
    except (ValueError, KeyError, TypeError):
        raise Error(f"{share.path / _FAILURES}: was changed since torquer-batch wrote it; remove it") from None


class Store:
    """Stored results, open for one run at a time."""

    def __init__(self, folder: pathlib.Path, share: str = "", study: Optional[Dict[str, str]] = None) -> None:
        """share: name of a share, whose own store is opened. study: its study, and the build."""
        self.folder = folder / _SHARES / share if share else folder
        self.readings: Dict[str, Dict[str, Any]] = {}
        """Readings by the key of the case."""
        self._gathered: Set[str] = set()  # keys of cases in the folder that a share belongs to
        self._open_ones: List[Any] = []
        try:
            folder.mkdir(parents=True, exist_ok=True)
            whole = self._opened(_Folder(folder))
            self._own = self._opened(self._share(whole, share)) if share else whole
            self._open()
            if study:
                self._record.add_study(study)
        except OSError as error:
            self._close()
            raise Error(f"{folder}: {error.strerror}; choose another folder with --out") from None
        except BaseException:
            self._close()
            raise

    def __enter__(self) -> "Store":
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[types.TracebackType],
    ) -> None:
        self._close()

    def _close(self) -> None:
        while self._open_ones:
            self._open_ones.pop().close()

    def _opened(self, one: Any) -> Any:
        self._open_ones.append(one)
        return one

    def _share(self, whole: _Folder, name: str) -> _Folder:
        whole.require_own()
        lines = _records(whole.path / _LINES, _contents(whole, _LINES))
        self._gathered = {record["key"] for record, _ in lines}
        with contextlib.closing(whole.folder(_SHARES)) as shares:
            return shares.folder(name)

    def _open(self) -> None:
        self._record = self._opened(_Record(self._own))
        self._lines = self._opened(self._own.append(_LINES))
        self._read_lines()
        for name in _FINISHED:
            self._require_recorded(name)
        self._shapes = self._opened(self._own.folder("shapes"))
        # A killed run may have left these half-written.
        self._own.remove(_PART)
        self._shapes.remove(_PART)
        for key in self._record.shapes - self.readings.keys():
            self._shapes.remove(f"{key}.zip")

    def _read_lines(self) -> None:
        whole = 0
        for record, line in _records(self.folder / _LINES, self._lines):
            self.readings[record["key"]] = record["readings"]
            whole += len(line)
            if not line.endswith(b"\n"):
                self._lines.write(b"\n")
                self._lines.flush()
                return
        self._lines.truncate(whole)

    def _require_recorded(self, name: str) -> None:
        if self._own.has(name) and (name, _hash(self._own.read(name))) not in self._record.finished:
            raise Error(f"{self.folder / name}: was changed since torquer-batch wrote it; move it away, and torquer-batch writes it again")

    def has(self, key: str) -> bool:
        """True if a case is stored, here or in the folder that this share belongs to."""
        return key in self.readings or key in self._gathered

    def gather(self, wanted: Collection[str], study: Dict[str, str]) -> Dict[str, str]:
        """Stores the wanted cases of all shares. Raises Error for a share of another study or build.

        Returns messages of cases that failed in their share, by the labels as JSON.
        """
        if _SHARES not in os.listdir(self._own.descriptor):
            return {}
        shares = self._opened(_Folder(self.folder / _SHARES, self._own.descriptor))
        names = sorted(filter(_SHARE.fullmatch, os.listdir(shares.descriptor)))
        failed: Dict[str, str] = {}
        # All are checked before the first one is taken in.
        for takes in (False, True):
            for name in names:
                with contextlib.closing(_Folder(shares.path / name, shares.descriptor)) as share:
                    if _is_of(study, share) and takes:
                        self._gather_share(share, wanted)
                        failed.update(_failures(share))
        return failed

    def _gather_share(self, share: _Folder, wanted: Collection[str]) -> None:
        for record, _ in _records(share.path / _LINES, _contents(share, _LINES)):
            if record["key"] not in wanted or record["key"] in self.readings:
                continue
            name = f"{record['key']}.zip"
            try:
                with contextlib.closing(_Folder(share.path / "shapes", share.descriptor)) as shapes:
                    data = shapes.read(name)
            except OSError as error:
                raise Error(
                    f"{share.path / 'shapes' / name}: {error.strerror}; remove its line from {share.path / _LINES}, and run that share again"
                ) from None
            self._keep(record, lambda part: part.write(data))

    def keep(self, case: Case, result: Result) -> None:
        """Stores a case; it is on the disk when this returns. Raises Error if the disk fails."""
        arrays: Dict[str, Any] = {"series": result.series}
        if result.shapes:
            # Concatenated: row k has the nodes from first_node[k] to first_node[k + 1].
            arrays["nodes_mm"] = np.concatenate(result.shapes)
            arrays["first_node"] = np.cumsum([0, *(len(shape) for shape in result.shapes)])
        zarr = need("zarr", "python3-zarr")

        def write(part: BinaryIO) -> None:
            # Opened by the descriptor, because another process may link the name elsewhere.
            with zarr.ZipStore(f"/proc/self/fd/{part.fileno()}", mode="w") as zipped:
                group = zarr.group(zipped)
                group.attrs.update({"case": case.labels, "columns": result.columns})
                for array, values in arrays.items():
                    group.create_dataset(array, data=values, chunks=False)

        self._keep({"key": case.key, "case": case.labels, "readings": result.readings}, write)

    def _keep(self, record: Dict[str, Any], write: Callable[[BinaryIO], object]) -> None:
        """Stores a case, whose shapes `write` writes."""
        key = record["key"]
        name = f"{key}.zip"
        try:
            if self._shapes.has(name) and key not in self._record.shapes:
                raise Stopped(f"{self._shapes.path / name}: exists, but torquer-batch did not write it; move it away, and run the command again")
            with self._shapes.create(_PART) as part:
                write(part)
                part.flush()
                os.fsync(part.fileno())
            self._record.add_shape(key)
            self._shapes.rename(_PART, name)
            self._lines.write(json.dumps(record).encode() + b"\n")
            self._lines.flush()
            os.fsync(self._lines.fileno())
        except OSError as error:
            raise Stopped(f"{self.folder}: {error.strerror}; the cases stored before are kept; run the command again") from None
        self.readings[key] = record["readings"]

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
        texts = ("\n".join(lines) + "\n", "".join(json.dumps(failure) + "\n" for failure in failures), page)
        try:
            for name, text in zip(_FINISHED, texts):
                self._write_whole(name, text.encode())
        except OSError as error:
            raise Stopped(f"{self.folder}: {error.strerror}; the cases are stored; run the command again") from None

    def _write_whole(self, name: str, data: bytes) -> None:
        """Replaces a file, which is the old one or the new one at any moment."""
        self._require_recorded(name)
        with self._own.create(_PART) as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        self._record.add_finished(name, data)
        self._own.rename(_PART, name)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    text = value if isinstance(value, str) else json.dumps(value)
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n') else text
