"""Study files of torquer-batch: their contents, and their cases."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
import math
import pathlib
from typing import Any, Dict, Iterable, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from . import Error, Scene, __build__, _command, scene_names, scene_path
from ._devices import shipped
from ._names import did_you_mean
from ._user_file import parse_toml, read_text, read_toml

SHAPES = ("last", "rows", "none")
PLOTS = ("valid", "all")
_STUDY_KEYS = ("axes", "motion", "plots", "random", "scenes", "seeds", "shapes")
_MOTION_KEYS = ("duration_s", "hands", "name", "row_s", "script", "spread")
_HAND_KEYS = ("speed_mm_s", "turn_rad_s")
_MOST_CASES = 1_000_000
_MOST_ROWS = 1_000_000
_MOST_KEY_PARTS = 16


@dataclasses.dataclass(frozen=True)
class Script:
    """Motion of a case, as torquer-simulator --script takes it."""

    text: str
    path: str  # for messages
    named: Tuple[str, ...]  # files of the devices of its exchanges


@dataclasses.dataclass(frozen=True)
class Case:
    """One run: the input of a worker, and labels for tables."""

    key: str  # hash of all that decides the result; 64 hexadecimal digits
    text: str  # of the scene file
    folder: str  # base of its paths
    path: str  # of the scene file, for messages
    values: Dict[str, Any]  # of the scene's keys, in place of those in the text
    named: Tuple[str, ...]  # files and folders that the scene and the script name
    files: Tuple[str, ...]  # their hashes
    script: Script
    shapes: str
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


def _device_files(names: Iterable[str]) -> List[pathlib.Path]:
    devices = shipped("devices")
    return [devices / f"{name}.toml" for name in sorted(set(names)) if "\0" not in name]


def _named_files(scene: Scene) -> Tuple[str, ...]:
    """Paths of the files and folders that a scene's vessel names, and of its devices of Torquer."""
    table = parse_toml(scene.path, scene.text)
    texts = sorted({text for text in _strings(table.get("vessel")) if text and "\0" not in text and len(text) < 1000})
    paths = [pathlib.Path(scene.folder) / text for text in texts]
    paths += _device_files(_strings(table.get("instrument")))
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


def _generated(where: str, motion: Dict[str, Any], scene: Scene, seed: int) -> str:
    """Script of hands that move by speeds. A hand that is pulled back stays at the entry."""
    starts_mm = {info.name: info.start[0] for info in scene.instruments}
    count = max(1, round(motion["duration_s"] / motion["row_s"]))
    times = motion["row_s"] * np.arange(count + 1)
    columns = {"time_s": times}
    for instrument, hand in sorted(motion["hands"].items()):
        if instrument not in starts_mm:
            raise Error(
                f"{where}: hands.{instrument}: the scene has no such instrument; {did_you_mean(instrument, starts_mm)}"
                f"it has: {', '.join(starts_mm)}"
            )
        for what, speed in (("insertion_mm", "speed_mm_s"), ("rotation_rad", "turn_rad_s")):
            column = f"{instrument}.{what}"
            steady = np.full(count, float(hand.get(speed, 0)))
            if motion["spread"] > 0:
                # The hand's speed varies by a new factor each second.
                generator = np.random.default_rng([seed, *column.encode()])
                factors = generator.normal(1, motion["spread"], int(times[-1]) + 1)
                steady = steady * factors[np.minimum(times[1:].astype(int), len(factors) - 1)]
            way = np.concatenate([[0], np.cumsum(steady) * motion["row_s"]])
            columns[column] = np.maximum(way, -starts_mm[instrument]) if what == "insertion_mm" else way
    rows = np.column_stack(list(columns.values())).tolist()
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def _script(study: Study, motion: Dict[str, Any], scene: Scene, seed: int) -> Script:
    """Script of a motion, checked for a scene."""
    if "script" in motion:
        path = str(motion["script"])
        text = read_text(path)
    else:
        path = f"{study.path}: motion {motion['name']}"
        text = _generated(path, motion, scene, seed)
    rows = scene.parse_script(text, path)
    if not rows:
        raise Error(f"{path}: there is no row below the header; give at least one")
    devices = _device_files(device for row in rows for _, device in row.exchanges)
    return Script(text, path, tuple(map(str, devices)))


def cases(study: Study) -> Iterable[Case]:
    """All cases of a study, in the order of the file. Raises Error for values that a scene cannot have."""
    known: Dict[pathlib.Path, str] = {}
    for scene_file in study.scenes:
        file = pathlib.Path(scene_file)
        text = read_text(file)
        folder = str(file.parent.resolve())
        plain = Scene.from_text(text, folder, scene_file)
        # Keyed by the motion's name, the instruments at the start, and the seed if the motion is random.
        scripts: Dict[Any, Script] = {}
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
                starts = tuple((info.name, info.start) for info in scene.instruments)
                for motion in study.motions:
                    name = motion["name"]
                    of = (name, starts, seed if motion.get("spread") else None)
                    if of not in scripts:
                        scripts[of] = _script(study, motion, scene, seed)
                    script = scripts[of]
                    read = files + file_hashes(script.named, known)
                    inputs = json.dumps([__build__, scene.text, read, script.text, study.shapes])
                    labels = {"scene": file.stem, "motion": name, "seed": seed, **chosen}
                    key = hashlib.sha256(inputs.encode()).hexdigest()
                    yield Case(key, text, folder, scene_file, chosen, named + script.named, read, script, study.shapes, labels)


def need(module: str, package: str) -> Any:
    """Imports a module of a Debian package that only torquer-batch needs."""
    return _command.need("torquer-batch", module, package)
