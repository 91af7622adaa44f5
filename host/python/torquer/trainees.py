"""The command "torquer-trainees", or python3 -m torquer.trainees: sessions of trainees in a local store.

    torquer-trainees add build/demo/keyboard/cases
    torquer-trainees list
    torquer-trainees curve "Ann Smith" --picture ann.svg
    torquer-trainees export sessions.csv

The store is a file of SQLite. Python has SQLite in it, so neither a program nor a library has to be added.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import io
import os
import pathlib
import sqlite3
import sys
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple

from . import Error, __version__, _command
from ._trainee_store import FIGURES, VERDICTS, Store
from ._user_file import load_json, open_file

_SUMMARY_VERSION = 2
_ENDING = ".session.json"
_MOST_BYTES = 16384
_MOST_FILES = 100_000
_LARGEST = 1e12
_LATEST_US = 4_102_444_800_000_000  # year 2100

_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # first characters of a formula, or skipped before one
# Figures of a learning curve, with their titles.
_CURVE = {
    "target_s": "Time to the target (s)",
    "wall_force_mN": "Largest force on the wall (mN)",
    "fluoroscopy_s": "Fluoroscopy time (s)",
    "blind_mm": "Motion without X-ray (mm)",
}


def default_store() -> pathlib.Path:
    base = os.environ.get("XDG_DATA_HOME") or os.path.expanduser("~/.local/share")
    return pathlib.Path(base) / "torquer" / "trainees.sqlite"


def _number(path: str, session: Dict[str, Any], name: str, most: float = _LARGEST) -> Optional[float]:
    value = session.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= most:
        raise Error(f"{path}: {name} = {value!r} is no figure of a session; make the report again")
    return float(value)


def _verdict(path: str, session: Dict[str, Any], name: str) -> Optional[bool]:
    value = session.get(name)
    if value is not None and not isinstance(value, bool):
        raise Error(f"{path}: {name} = {value!r} is neither true, false nor null; make the report again")
    return value


def _text(path: str, session: Dict[str, Any], name: str) -> str:
    value = session.get(name, "")
    if not isinstance(value, str):
        raise Error(f"{path}: {name} = {value!r} is no text; make the report again")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise Error(f"{path}: {name} = {value!a} is no text in Unicode; make the report again") from None
    return value


def read_session(path: str) -> Dict[str, Any]:
    """Figures of a file that torquer-report wrote. Raises Error naming the file and its defect."""
    with open_file(path) as file:
        text = file.read(_MOST_BYTES + 1)
    try:
        session = load_json(text) if len(text) <= _MOST_BYTES else None
    except ValueError:
        session = None
    if not isinstance(session, dict) or session.get("session_summary") != _SUMMARY_VERSION:
        raise Error(f"{path}: is not a summary of a session of this release; make the report again")
    found: Dict[str, Any] = {name: _text(path, session, name) for name in ("scene", "trainee", "group")}
    started_us = _number(path, session, "started_us", _LATEST_US)
    found["started_us"] = int(started_us) if started_us else None  # 0 in earlier files: not known
    found.update({name: _verdict(path, session, name) for name in VERDICTS})
    found.update({name: _number(path, session, name) for name in FIGURES})
    marks = session.get("marks", [])
    if not isinstance(marks, list) or not all(isinstance(mark, dict) for mark in marks):
        raise Error(f"{path}: marks is no list of tables; make the report again")
    found["marks"] = [
        {
            "name": _text(path, mark, "name"),
            "value": _number(path, mark, "value"),
            "passed": _verdict(path, mark, "passed"),
        }
        for mark in marks
    ]
    if not found["scene"]:
        raise Error(f"{path}: scene is missing; make the report again")
    return found


def _summaries(folder: str) -> Iterator[str]:
    """Summaries below a folder, or the named one. Links are not followed, so that none counts twice."""
    if folder.endswith(_ENDING):
        yield folder
        return
    if not os.path.isdir(folder):
        raise Error(f"{folder}: there is no such folder; give a folder of sessions, or a file *{_ENDING}")
    count = 0
    for place, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            if name.endswith(_ENDING) and not os.path.islink(os.path.join(place, name)):
                count += 1
                if count > _MOST_FILES:
                    raise Error(f"{folder}: more than {_MOST_FILES} sessions; add its folders one by one")
                yield os.path.join(place, name)


def add(store: Store, paths: Sequence[str], trainee: str, group: str) -> Tuple[str, List[str]]:
    """Adds sessions by their summaries. Returns a description, and a message for each one that was left out."""
    counts = {True: 0, False: 0}
    nameless = 0
    left_out: List[str] = []
    for path in paths:
        try:
            session = read_session(path)
        except Error as error:
            left_out.append(str(error))
            continue
        name = session["trainee"] or trainee
        if not name:
            nameless += 1
            continue
        of_group = session["group"] if session["trainee"] else group
        counts[store.add(session, name, of_group, os.path.abspath(path))] += 1
    if nameless:
        left_out.append(f"{nameless} sessions name no trainee; give the name by --trainee NAME")
    return f"{counts[True]} sessions added, {counts[False]} replaced", left_out


def _date(started_us: Optional[int]) -> str:
    if started_us is None:
        return "-"
    return datetime.datetime.fromtimestamp(started_us / 1e6, datetime.timezone.utc).strftime("%Y-%m-%d %H:%M")


def _shown(value: Optional[float]) -> str:
    return "-" if value is None else f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"


def _printable(text: str) -> str:
    """Text for a terminal: escapes stand in place of control characters."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def _result(session: Dict[str, Any]) -> str:
    if not session["gradable"]:
        return "not gradable"
    if session["target_reached"] is None:
        return "not assessed"
    if not session["target_reached"]:
        return "not reached"
    return "reached" if session["safe"] is None else "safe" if session["safe"] else "unsafe"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [[_printable(cell) for cell in row] for row in (heads, *rows)]
    widths = [max(len(cell) for cell in column) for column in zip(*lines)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in lines)


def overview(store: Store, group: Optional[str]) -> str:
    """A row for each trainee and case."""
    cases: Dict[Tuple[str, str], List[Dict[str, Any]]] = {}
    for session in store.sessions(group=group):
        cases.setdefault((session["trainee"], session["scene"]), []).append(session)
    rows = []
    for (trainee, scene), sessions in sorted(cases.items()):
        examinations = [session for session in sessions if session["examination"]]
        rows.append(
            [
                trainee,
                sessions[-1]["group"] or "-",
                scene,
                str(len(sessions)),
                str(sum(session["passed"] == 1 for session in sessions)),
                f"{sum(session['passed'] == 1 for session in examinations)} of {len(examinations)}",
                _date(sessions[-1]["started_us"]),
            ]
        )
    return _table(["trainee", "group", "case", "sessions", "passed", "examinations passed", "last, UTC"], rows)


def curve(sessions: Sequence[Dict[str, Any]]) -> str:
    """A row for each session of a trainee in a case."""
    rows = []
    counts: Dict[str, int] = {}
    for session in sorted(sessions, key=lambda one: (one["scene"], one["started_us"] or 0)):
        counts[session["scene"]] = counts.get(session["scene"], 0) + 1
        rows.append(
            [
                session["scene"],
                str(counts[session["scene"]]),
                _date(session["started_us"]),
                "examination" if session["examination"] else "practice",
                _result(session),
                "-" if session["passed"] is None else "passed" if session["passed"] else "failed",
                *(_shown(session[name]) for name in (*_CURVE, "contrast_mL", "retractions")),
            ]
        )
    heads = ["case", "no.", "began, UTC", "kind", "result", "pass marks", *_CURVE, "contrast_mL", "retractions"]
    return _table(heads, rows)


def _drawn(text: str) -> str:
    """Text for matplotlib, which would read what stands between two dollars as a formula."""
    return _printable(text).replace("$", "\\$")


def draw(sessions: Sequence[Dict[str, Any]], title: str) -> bytes:
    """Learning curves as SVG: a panel for each figure, a line for each case."""
    _command.need("torquer-trainees --picture", "matplotlib", "python3-matplotlib").use("Agg")
    figure = _command.need("torquer-trainees --picture", "matplotlib.figure", "python3-matplotlib").Figure(figsize=(9, 7))
    cases: Dict[str, List[Dict[str, Any]]] = {}
    for session in sessions:
        cases.setdefault(session["scene"], []).append(session)
    for k, (name, label) in enumerate(_CURVE.items(), 1):
        axes = figure.add_subplot(2, 2, k, title=label, xlabel="session in order of time")
        for scene, of_case in sorted(cases.items()):
            points = [(number, one[name]) for number, one in enumerate(of_case, 1) if one[name] is not None]
            if points:
                axes.plot(*zip(*points), "o-", label=_drawn(scene))
        axes.set_ylim(bottom=0)
        axes.xaxis.get_major_locator().set_params(integer=True)
        if axes.lines:
            axes.legend(fontsize=8)
    figure.suptitle(_drawn(title))
    figure.tight_layout()
    out = io.BytesIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue()


def _cell(value: Any) -> Any:
    """A cell that a spreadsheet takes as it is. Text that would be a formula there gets an apostrophe."""
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def as_csv(sessions: Sequence[Dict[str, Any]]) -> str:
    """A row for each session. A value that is not known is empty."""
    out = io.StringIO()
    names = ["trainee", "group", "scene", "started_us", *VERDICTS, *FIGURES, "file"]
    writer = csv.DictWriter(out, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in session.items()} for session in sessions)
    return out.getvalue()


def _write_new(path: str, data: bytes) -> None:
    made = False
    try:
        with open(path, "xb") as file:
            made = True
            file.write(data)
    except FileExistsError:
        raise Error(f"{path}: exists already; remove it, or give another name") from None
    except OSError as error:
        if made:
            pathlib.Path(path).unlink(missing_ok=True)
        raise Error(f"{path}: cannot be written ({error.strerror}); check the folder and its space") from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="torquer-trainees", description="Keeps the sessions of trainees in a local store, and shows their progress."
    )
    parser.add_argument("--version", action="version", version=f"torquer-trainees {__version__}")
    parser.add_argument("--store", metavar="FILE", type=pathlib.Path, help="file of the store (default: ~/.local/share/torquer/trainees.sqlite)")
    parser.add_argument("--completion", choices=["bash"], action=_command.Completion, help="print a completion script for bash")
    commands = parser.add_subparsers(dest="command", required=True)
    adding = commands.add_parser("add", help=f"add the sessions of folders, from their files *{_ENDING}")
    adding.add_argument("folders", metavar="FOLDER", nargs="+", help="folder with sessions, such as build/demo/keyboard/cases")
    adding.add_argument("--trainee", metavar="NAME", default="", help="trainee of the sessions that name none")
    adding.add_argument("--group", metavar="NAME", default="", help="group of that trainee, such as a course")
    listing = commands.add_parser("list", help="list trainees, cases, and numbers of sessions")
    listing.add_argument("--group", metavar="NAME", help="only this group")
    curves = commands.add_parser("curve", help="show the sessions of a trainee in order of time")
    curves.add_argument("trainee", metavar="TRAINEE", help="name of the trainee")
    curves.add_argument("--case", metavar="NAME", help="only this case")
    curves.add_argument("--picture", metavar="FILE.svg", help="new file for a picture of the learning curves")
    export = commands.add_parser("export", help="write all sessions as a table")
    export.add_argument("file", metavar="FILE.csv", help="new file for the table")
    return parser


def _curve(store: Store, arguments: argparse.Namespace) -> str:
    sessions = store.sessions(arguments.trainee, arguments.case)
    if not sessions:
        known = sorted({session["trainee"] for session in store.sessions()})
        of_case = f" in {arguments.case}" if arguments.case else ""
        names = _printable(", ".join(known) or "none")
        raise Error(f"{_printable(arguments.trainee)}: has no session{of_case} in {store.path}; trainees: {names}")
    if arguments.picture:
        if not arguments.picture.endswith(".svg"):
            raise Error(f"--picture {arguments.picture}: give a file that ends in .svg")
        if os.path.lexists(arguments.picture):
            raise Error(f"{arguments.picture}: exists already; remove it, or give another name")
        _write_new(arguments.picture, draw(sessions, arguments.trainee))
    return curve(sessions)


def run(arguments: argparse.Namespace) -> int:
    adds = arguments.command == "add"
    if adds and arguments.group and not arguments.trainee:
        raise Error(f"--group {arguments.group}: name the trainee by --trainee")
    paths = [path for folder in arguments.folders for path in _summaries(folder)] if adds else []
    store = Store(arguments.store or default_store(), make=adds)
    try:
        if adds:
            done, left_out = add(store, paths, arguments.trainee, arguments.group)
            for message in left_out:
                print(f"torquer-trainees: left out: {message}", file=sys.stderr)
            print(f"{store.path}: {done}")
            return 1 if left_out else 0
        if arguments.command == "list":
            print(overview(store, arguments.group))
        elif arguments.command == "curve":
            print(_curve(store, arguments))
        else:
            sessions = store.sessions()
            _write_new(arguments.file, as_csv(sessions).encode())
            print(f"{arguments.file}: {len(sessions)} sessions")
    except sqlite3.Error as error:
        raise Error(f"{store.path}: the store cannot be used ({error}); check the disk, or restore a copy") from None
    finally:
        store.close()
    return 0


def main() -> int:
    try:
        return run(_parser().parse_args())
    except Error as error:
        print(f"torquer-trainees: {error}", file=sys.stderr)
        return 2


def command() -> int:
    """The command torquer-trainees: its exit status."""
    return _command.run("torquer-trainees", main)


if __name__ == "__main__":
    sys.exit(command())
