"""Study files of torquer-batch: their contents, and their cases."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import itertools
import json
import math
import pathlib
from typing import Any, Dict, Iterable, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from . import Error, Scene, __build__, _command, scene_names, scene_path
from ._names import did_you_mean
from ._user_file import parse_toml, read_text, read_toml

SHAPES = ("last", "rows", "none")
PLOTS = ("valid", "all")
_STUDY_KEYS = ("axes", "motion", "plots", "random", "scenes", "seeds", "shapes")
_MOTION_KEYS = ("duration_s", "hands", "name", "row_s", "script", "spread")
_HAND_KEYS = ("speed_mm_s", "turn_rad_s")
_SWITCHES = ("xray", "contrast")
_MOST_CASES = 1_000_000
_MOST_ROWS = 1_000_000
_MOST_KEY_PARTS = 16


@dataclasses.dataclass(frozen=True)
class Case:
    """One run: the input of a worker, and labels for tables."""

    key: str  # hash of all that decides the result; 64 hexadecimal digits
    text: str  # of the scene file
    folder: str  # base of its paths
    path: str  # of the scene file, for messages
    values: Dict[str, Any]  # of the scene's keys, in place of those in the text
    named: Tuple[str, ...]  # files and folders that the scene names
    files: Tuple[str, ...]  # their hashes
    columns: Tuple[str, ...]  # of the rows
    rows: Tuple[Tuple[float, ...], ...]
    shapes: str
    is_generated: bool  # by speeds: a hand that is pulled back stays at the entry
    labels: Dict[str, Any]  # scene, motion, seed, and the value of each axis and random key


@dataclasses.dataclass(frozen=True)
class Study:
    """A study file, read and checked."""

    path: pathlib.Path
    scenes: List[str]
    axes: Dict[str, List[Any]]
    random: Dict[str, Tuple[float, float]]
    seeds: List[int]
    motions: List[Dict[str, Any]]
    shapes: str
    plots: str = "valid"

    def count(self) -> int:
        """Number of cases."""
        combinations = math.prod(len(values) for values in self.axes.values())
        return len(self.scenes) * combinations * len(self.motions) * len(self.seeds)


def _refuse_others(where: str, table: Dict[str, Any], known: Sequence[str]) -> None:
    for key in table:
        if key not in known:
            raise Error(f"{where}: there is no key {key}; {did_you_mean(key, known)}there are: {', '.join(known)}")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _number(where: str, table: Dict[str, Any], key: str, lowest: float, highest: float, default: Optional[float]) -> float:
    value = table.get(key, default)
    if value is None:
        raise Error(f"{where}: {key} is missing; give a number from {lowest:g} to {highest:g}")
    if not _is_number(value) or not lowest <= value <= highest:
        raise Error(f"{where}: {key} is {value!r}; give a number from {lowest:g} to {highest:g}")
    return float(value)


def _list(where: str, value: Any, of: str) -> List[Any]:
    if not isinstance(value, list) or not value:
        raise Error(f"{where} is {value!r}; give a list of {of}, as [{'1, 2' if of == 'numbers' else '..'}]")
    return value


def _read_motion(path: pathlib.Path, index: int, motion: Any) -> Dict[str, Any]:
    where = f"{path}: motion {index + 1}"
    if not isinstance(motion, dict):
        raise Error(f"{where} is {motion!r}; write it as a table, [[motion]]")
    _refuse_others(where, motion, _MOTION_KEYS)
    name = motion.get("name")
    if not isinstance(name, str) or not name:
        raise Error(f'{where}: name is {name!r}; name it, as name = "push"')
    where = f"{path}: motion {name}"
    if "script" in motion:
        for key in motion:
            if key not in ("name", "script"):
                raise Error(f"{where}: {key} and script exclude each other; remove one of them")
        if not isinstance(motion["script"], str):
            raise Error(f"{where}: script is {motion['script']!r}; name a file of rows, as for torquer-simulator --script")
        return {"name": name, "script": path.parent / motion["script"]}
    hands = motion.get("hands", {})
    if not isinstance(hands, dict) or not hands:
        raise Error(
            f"{where}: it has neither script nor hands; name a script file, or give the motion of an instrument, as "
            "hands.guidewire = { speed_mm_s = 10 }"
        )
    for instrument, hand in hands.items():
        here = f"{where}, hands.{instrument}"
        if not isinstance(hand, dict):
            raise Error(f"{here} is {hand!r}; give speeds, as {{ speed_mm_s = 10, turn_rad_s = 0.5 }}")
        _refuse_others(here, hand, _HAND_KEYS)
        for key in _HAND_KEYS:
            _number(here, hand, key, -1000, 1000, 0)
    duration_s = _number(where, motion, "duration_s", 1e-3, 1e5, None)
    row_s = _number(where, motion, "row_s", 1e-3, 1e3, 0.1)
    if duration_s / row_s > _MOST_ROWS:
        raise Error(f"{where}: it has more than {_MOST_ROWS} rows; lower duration_s or raise row_s")
    return {
        "name": name,
        "duration_s": duration_s,
        "row_s": row_s,
        "spread": _number(where, motion, "spread", 0, 10, 0),
        "hands": hands,
    }


def _check_key(where: str, key: str) -> None:
    # Each part is a table inside the one before.
    if key.count(".") >= _MOST_KEY_PARTS:
        raise Error(f"{where}: {key[:40]}.. has more than {_MOST_KEY_PARTS} parts; name a key that a scene can have")


def _scene_files(file: pathlib.Path, names: List[Any]) -> List[str]:
    # Listed once, because a study can name many scenes.
    shipped = {name: scene_path(name) for name in scene_names()}
    found = []
    for name in names:
        if not isinstance(name, str):
            raise Error(f"{file}: scenes has {name!r}; name scenes or their files")
        own = file.parent / name
        try:
            path = str(own) if own.is_file() else shipped.get(name)
        except OSError as error:
            raise Error(f"{file}: scenes has {name[:40]!r}..: {error.strerror}; name scenes or their files") from None
        if path is None:
            raise Error(
                f"{file}: scenes: there is neither a file {own} nor a shipped scene {name!r}; "
                f"shipped scenes: {', '.join(shipped)}"
            )
        found.append(path)
    return found


def read_study(path: str) -> Study:
    """Reads a study file. Raises Error that names the file, the key, its value and the remedy."""
    file = pathlib.Path(path)
    table = read_toml(file)
    _refuse_others(str(file), table, _STUDY_KEYS)

    scenes = _scene_files(file, _list(f"{file}: scenes", table.get("scenes"), "names of scenes or of their files"))

    axes = table.get("axes", {})
    if not isinstance(axes, dict):
        raise Error(f'{file}: axes is {axes!r}; write it as a table, as [axes] "effects.friction.coefficient" = [0, 0.1]')
    for key, values in axes.items():
        _check_key(f"{file}: axes", key)
        if isinstance(values, dict):
            raise Error(f'{file}: axes.{key} is a table; put the whole key into quotes, as "{key}.{next(iter(values), "..")}"')
        if len({json.dumps(value) for value in _list(f"{file}: axes.{key}", values, "values")}) < len(values):
            raise Error(f"{file}: axes.{key} has a value twice; remove one")

    random: Dict[str, Tuple[float, float]] = {}
    drawn = table.get("random", {})
    if not isinstance(drawn, dict):
        raise Error(f"{file}: random is {drawn!r}; write it as a table of ranges")
    for key, limits in drawn.items():
        _check_key(f"{file}: random", key)
        good = isinstance(limits, list) and len(limits) == 2 and all(map(_is_number, limits)) and limits[0] < limits[1]
        if not good:
            raise Error(f"{file}: random.{key} is {limits!r}; give the lowest and the highest value, as [0.02, 0.1]")
        if key in axes:
            raise Error(f"{file}: {key} is in axes and in random; remove it from one")
        random[key] = (float(limits[0]), float(limits[1]))

    seeds = _list(f"{file}: seeds", table.get("seeds", [1]), "numbers")
    for seed in seeds:
        if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 2**63:
            raise Error(f"{file}: seeds has {seed!r}; give whole numbers from 0")
    if len(set(seeds)) < len(seeds):
        raise Error(f"{file}: seeds has a number twice; remove one")

    listed = table.get("motion", [])
    if not isinstance(listed, list) or not listed:
        raise Error(f"{file}: there is no motion; add one as a table, [[motion]]")
    motions = [_read_motion(file, index, motion) for index, motion in enumerate(listed)]
    names = [motion["name"] for motion in motions]
    if len(set(names)) < len(names):
        raise Error(f"{file}: two motions have the same name; give each its own")
    if len(seeds) > 1 and not random and not any(motion.get("spread") for motion in motions):
        raise Error(
            f"{file}: seeds has {len(seeds)} numbers, but the study draws no random value; add a range to [random], "
            "or spread to a motion"
        )

    shapes = table.get("shapes", "last")
    if shapes not in SHAPES:
        raise Error(f"{file}: shapes is {shapes!r}; {did_you_mean(shapes, SHAPES)}give one of {', '.join(SHAPES)}")
    plots = table.get("plots", "valid")
    if plots not in PLOTS:
        raise Error(f"{file}: plots is {plots!r}; {did_you_mean(plots, PLOTS)}give one of {', '.join(PLOTS)}")
    study = Study(file, scenes, axes, random, seeds, motions, shapes, plots)
    if study.count() > _MOST_CASES:
        raise Error(f"{file}: the study has {study.count()} cases, but at most {_MOST_CASES} are allowed; vary fewer values")
    return study


def _strings(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for inner in value.values():
            yield from _strings(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _strings(inner)


def _bytes_hash(path: pathlib.Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _named_files(scene: Scene) -> Tuple[str, ...]:
    """Paths of the files and folders that a scene's vessel names, and of its devices of Torquer."""
    table = parse_toml(scene.path, scene.text)
    devices = pathlib.Path(scene_path(scene_names()[0])).parents[1] / "devices"
    texts = sorted({text for text in _strings(table.get("vessel")) if text and "\0" not in text and len(text) < 1000})
    paths = [pathlib.Path(scene.folder) / text for text in texts]
    paths += [devices / f"{text}.toml" for text in sorted(set(_strings(table.get("instrument")))) if "\0" not in text]
    return tuple(str(path) for path in paths)


def file_hashes(named: Sequence[str], known: Dict[pathlib.Path, str]) -> Tuple[str, ...]:
    """Hashes of files, and of the files in folders, in order.

    known: hashes of files read before, which the caller takes as unchanged.
    """
    found = []
    for path in map(pathlib.Path, named):
        try:
            for file in sorted(path.iterdir()) if path.is_dir() else [path]:
                if not file.is_file():
                    continue
                if file not in known:
                    known[file] = _bytes_hash(file)
                found.append(known[file])
        except OSError:
            continue  # the simulator refuses files that cannot be read
    return tuple(found)


def _script_rows(path: pathlib.Path, scene: Scene) -> Tuple[Tuple[str, ...], List[Tuple[float, ...]]]:
    """Reads columns and rows of a script for torquer-simulator --script."""
    instruments = [f"{info.name}.{what}" for info in scene.instruments for what in ("insertion_mm", "rotation_rad")]
    known = ["time_s", *instruments, "lao_deg", "cra_deg", *_SWITCHES, "table_left_mm", "table_head_mm", "table_height_mm"]
    text = read_text(path).replace("\r\n", "\n")
    if "\r" in text:
        raise Error(f"{path}:1: carriage returns alone end the lines; save the file with line feeds (in Excel: CSV UTF-8)")
    # Spreadsheets add rows of empty cells, and Excel a line that names the separator.
    numbered = enumerate(text.split("\n"), 1)
    lines = [(number, line) for number, line in numbered if line.strip(' \t,"') and not line.startswith("#")]
    if lines and len(lines[0][1]) == len("sep=,") and lines[0][1].startswith("sep="):
        lines = lines[1:]
    if not lines:
        raise Error(f"{path}: the file is empty; the first line must name the columns")
    try:
        rows = list(csv.reader(line for _, line in lines))
    except csv.Error as error:
        raise Error(f"{path}: {error}; give rows of numbers, separated by commas") from None
    columns = tuple(cell.strip() for cell in rows[0])
    for separator, plural in ((";", "semicolons"), ("\t", "tabs")):
        if len(columns) == 1 and separator in columns[0]:
            raise Error(f"{path}:{lines[0][0]}: {plural} separate the columns; save the file with commas between columns and decimal points in numbers")
    for place, column in enumerate(columns, 1):
        if not column:
            raise Error(f"{path}:{lines[0][0]}: column {place} has no name; name it or remove it (in R: row.names = FALSE)")
        if column not in known or columns.count(column) > 1:
            near = "" if column in known else did_you_mean(column, known)
            raise Error(f"{path}:{lines[0][0]}: column {column!r} is unknown or given twice; {near}known columns: {', '.join(known)}")
    if "time_s" not in columns:
        raise Error(f"{path}:{lines[0][0]}: there is no column time_s; a script needs one")
    read: List[Tuple[float, ...]] = []
    time = columns.index("time_s")
    for (number, _), cells in zip(lines[1:], rows[1:]):
        if len(cells) != len(columns):
            raise Error(f"{path}:{number}: the row has {len(cells)} values, but the header names {len(columns)}")
        try:
            values = tuple(float(cell) for cell in cells)
        except ValueError:
            raise Error(f"{path}:{number}: {', '.join(cells)!r} are not all numbers") from None
        if not all(map(math.isfinite, values)):
            raise Error(f"{path}:{number}: {', '.join(cells)!r} are not all finite")
        if read and values[time] <= read[-1][time]:
            raise Error(f"{path}:{number}: time_s is {values[time]:g}, not later than the previous row; give increasing times")
        read.append(values)
    if not read:
        raise Error(f"{path}: there is no row below the header; give at least one")
    return columns, read


def _generated_rows(
    where: str, motion: Dict[str, Any], scene: Scene, seed: int
) -> Tuple[Tuple[str, ...], List[Tuple[float, ...]]]:
    names = [info.name for info in scene.instruments]
    columns = ["time_s"]
    moves = []
    count = max(1, round(motion["duration_s"] / motion["row_s"]))
    times = motion["row_s"] * np.arange(1, count + 1)
    for instrument, hand in sorted(motion["hands"].items()):
        if instrument not in names:
            raise Error(f"{where}: hands.{instrument}: the scene has no such instrument; it has: {', '.join(names)}")
        for column, speed in (("insertion_mm", "speed_mm_s"), ("rotation_rad", "turn_rad_s")):
            columns.append(f"{instrument}.{column}")
            steady = np.full(count, float(hand.get(speed, 0)))
            if motion["spread"] > 0:
                # The hand's speed varies by a new factor each second.
                generator = np.random.default_rng([seed, *columns[-1].encode()])
                factors = generator.normal(1, motion["spread"], int(times[-1]) + 1)
                steady = steady * factors[np.minimum(times.astype(int), len(factors) - 1)]
            moves.append(np.cumsum(steady) * motion["row_s"])
    rows = [tuple(map(float, row)) for row in zip(times, *moves)]
    return tuple(columns), rows


def _rows(
    study: Study, motion: Dict[str, Any], scene: Scene, seed: int
) -> Tuple[Tuple[str, ...], Tuple[Tuple[float, ...], ...], str]:
    """Columns and rows of a motion, with their hash."""
    if "script" in motion:
        columns, moves = _script_rows(motion["script"], scene)
    else:
        columns, moves = _generated_rows(f"{study.path}: motion {motion['name']}", motion, scene, seed)
    return columns, tuple(moves), hashlib.sha256(repr((columns, moves)).encode()).hexdigest()


def cases(study: Study) -> Iterable[Case]:
    """All cases of a study, in the order of the file. Raises Error for values that a scene cannot have."""
    known: Dict[pathlib.Path, str] = {}
    for scene_file in study.scenes:
        file = pathlib.Path(scene_file)
        text = read_text(file)
        folder = str(file.parent.resolve())
        plain = Scene.from_text(text, folder, scene_file)
        # Keyed by the motion's name, and by the seed if the motion is random.
        rows: Dict[Tuple[str, int], Tuple[Tuple[str, ...], Tuple[Tuple[float, ...], ...], str]] = {}
        for values in itertools.product(*study.axes.values()):
            for seed in study.seeds:
                chosen: Dict[str, Any] = dict(zip(study.axes, values))
                for key, (low, high) in sorted(study.random.items()):
                    generator = np.random.default_rng([seed, *key.encode()])
                    chosen[key] = float(generator.uniform(low, high))
                try:
                    scene = plain.with_values(chosen)
                except Error as error:
                    raise Error(f"{study.path}: {error}") from None
                named = _named_files(scene)
                files = file_hashes(named, known)
                for motion in study.motions:
                    name = motion["name"]
                    by_seed = (name, seed if motion.get("spread") else -1)
                    if by_seed not in rows:
                        rows[by_seed] = _rows(study, motion, plain, seed)
                    columns, moves, moves_hash = rows[by_seed]
                    inputs = json.dumps([__build__, scene.text, files, moves_hash, study.shapes])
                    labels = {"scene": file.stem, "motion": name, "seed": seed, **chosen}
                    key = hashlib.sha256(inputs.encode()).hexdigest()
                    yield Case(key, text, folder, scene_file, chosen, named, files, columns, moves, study.shapes, "script" not in motion, labels)


def need(module: str, package: str) -> Any:
    """Imports a module of a Debian package that only torquer-batch needs."""
    return _command.need("torquer-batch", module, package)
