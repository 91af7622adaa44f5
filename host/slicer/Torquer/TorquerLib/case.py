"""Inputs and results of torquer-import: places, curves, command lines and the files of a case.

3D Slicer has right, anterior, superior (RAS) in its nodes. Torquer has left, posterior, superior (LPS). All in mm.
"""

import glob
import json
import os
import re
import shlex
import shutil
from typing import Any, Dict, List, NamedTuple, Optional, Sequence

Points = Sequence[Sequence[float]]
LPS, RAS = "LPS", "RAS"
_LARGEST_MM = 1e5


class Refused(Exception):
    """An input that cannot be used. Its text names the field, the value and the remedy."""


class Place(NamedTuple):
    """New folders of an import."""

    case: str
    """Made by torquer-import."""
    inputs: str
    """What torquer-import reads, made by this module."""


class CaseFiles(NamedTuple):
    """Files of a case that Slicer shows."""

    surface: str
    curves: List[str]
    scene: str
    report: str


def turned(points: Points) -> List[List[float]]:
    """Points of RAS in LPS, or of LPS in RAS."""
    return [[-float(x), -float(y), float(z)] for x, y, z in points]


def point_word(option: str, point_ras: Sequence[float]) -> str:
    """An option with a place, as --seed=-12.5,30,1480."""
    (point,) = turned([point_ras])
    if not all(abs(value) < _LARGEST_MM for value in point):
        raise Refused(f"{option}: the point {list(point_ras)} is no place in a patient; place it again")
    # 0.0 is added because -0 would look like an error.
    return f"{option}=" + ",".join(f"{round(value, 3) + 0.0:.8g}" for value in point)


def new_place(folder: str, name: str) -> Place:
    """Checks the fields "Folder" and "Name", and that nothing would be overwritten."""
    if not folder.strip():
        raise Refused("Folder: is empty; choose the folder for the new case")
    if not os.path.isdir(folder):
        raise Refused(f"Folder: there is no folder {folder}; make it first, or choose another one")
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise Refused(f"Name: {name!r} has other characters than letters, digits, - and _; it becomes the name of the scene")
    place = Place(os.path.join(folder, name), os.path.join(folder, name + ".input"))
    for path in place:
        if os.path.lexists(path):
            raise Refused(f"Name: {path} exists already; remove it, or give another name")
    return place


def program_words(text: str, environment: Dict[str, str]) -> List[str]:
    """Words of the field "Command", with the path of the program."""
    try:
        words = [text] if os.path.isfile(text) else shlex.split(text)
    except ValueError as error:
        raise Refused(f"Command: {text!r} cannot be read ({error}); give torquer-import, or its path") from None
    if not words:
        raise Refused("Command: is empty; give torquer-import, or its path")
    found = shutil.which(words[0], path=environment.get("PATH"))
    if found is None:
        raise Refused(f"Command: there is no program {words[0]}; install the package python3-torquer, or give the program's path")
    return [found, *words[1:]]


def _places(root_ras: Points, entry_ras: Points) -> List[str]:
    words = []
    for option, points in (("--root", root_ras), ("--entry", entry_ras)):
        if option == "--entry" and len(points) > 1:
            raise Refused(f"{option}: the point list has {len(points)} points; leave one")
        words += [point_word(option, point) for point in points]
    return words


def scan_words(scan: str, seeds_ras: Points, root_ras: Points = (), entry_ras: Points = ()) -> List[str]:
    """Words after the program, for an angiography with places in the lumen."""
    if not seeds_ras:
        raise Refused("Seeds: the point list has no placed point; place one in the middle of a wide artery")
    return [scan, *(point_word("--seed", point) for point in seeds_ras), *_places(root_ras, entry_ras)]


def label_words(labels: str, root_ras: Points = (), entry_ras: Points = ()) -> List[str]:
    """Words for a label map with the lumen as 1."""
    return [labels, "--label", "1", *_places(root_ras, entry_ras)]


def surface_words(surface: str, curves: Optional[str] = None, root_ras: Points = (), entry_ras: Points = ()) -> List[str]:
    """Words for a surface, whose file names its coordinate system, and for the folder of its curves."""
    given = [] if curves is None else ["--centerlines", curves]
    return [surface, "--mesh-unit", "mm", *given, *_places(root_ras, entry_ras)]


def body_words(scan: str) -> List[str]:
    """Further words for the CT that X-ray pictures of a label map or a surface show."""
    return ["--body", scan]


def curve_text(points_ras: Points) -> str:
    """A file .mrk.json with a curve, in LPS and mm."""
    points = [{"id": str(k), "position": point, "positionStatus": "defined"} for k, point in enumerate(turned(points_ras), 1)]
    markup: Dict[str, Any] = {"type": "Curve", "coordinateSystem": LPS, "coordinateUnits": "mm", "controlPoints": points}
    return json.dumps({"markups": [markup]}, indent=1) + "\n"


def write_curves(folder: str, curves_ras: Dict[str, Points]) -> None:
    """A new folder with a file for each curve, by its name."""
    for name, points in curves_ras.items():
        if len(points) < 2:
            raise Refused(f"Curves: {name} has {len(points)} points; place two at least, or hide it")
    if not curves_ras:
        raise Refused("Curves: no open curve is visible; show those of the case, or do not use the curves")
    os.mkdir(folder)
    for number, (name, points) in enumerate(curves_ras.items()):
        plain = re.sub(r"[^A-Za-z0-9_-]", "_", name)
        with open(os.path.join(folder, f"{number:03}_{plain}.mrk.json"), "x", encoding="utf-8") as file:
            file.write(curve_text(points))


def case_files(case: str) -> CaseFiles:
    """The files of a case that torquer-import made."""
    case = os.path.normpath(case)
    files = CaseFiles(
        os.path.join(case, "surface.stl"),
        sorted(glob.glob(os.path.join(glob.escape(case), "centerlines", "*.mrk.json"))),
        os.path.join(case, os.path.basename(case) + ".toml"),
        os.path.join(case, "report.txt"),
    )
    for path in (files.surface, files.scene, files.report):
        if not os.path.isfile(path):
            raise Refused(f"Case: {path} is missing; choose a folder that torquer-import made")
    if not files.curves:
        raise Refused(f"Case: {case}/centerlines has no curves (.mrk.json); choose a folder that torquer-import made")
    return files


def simulator_lines(case: str) -> str:
    """Command lines that run a case on a page, steered by its keys."""
    scene = shlex.quote(case_files(case).scene)
    return f"torquer-simulator --scene {scene}\ntorquer-viewer --scene {scene} --steer"
