"""From a folder of Guide3D to shapes, with a report about calibration, noise and registration."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
import math
import os
import pathlib
from typing import Any, Dict, List, Mapping, Sequence, Tuple, Union

import numpy as np

from .. import __build__, __version__
from ..export import write_folder
from . import _annotations, _cameras, _curves, _registration
from ._annotations import Frame, Video
from .._polyline import rms
from ._base import Array, Error, need
from ._cameras import Pair
from ._registration import Minimum

Path = Union[str, "os.PathLike[str]"]

# Names of a file beside each other, or in the repositories tudorjnu/guide3d and airvlab/guide3d.
_CALIBRATION = "src/guide3d/calibration/2024-03-04/norm"
_FILES = {
    "annotations": ("3d.json", "data/annotations/3d.json", "src/guide3d/annotations/3d.json"),
    "camera 1": ("16710.txt", f"{_CALIBRATION}/16710.txt"),
    "camera 2": ("16709.txt", f"{_CALIBRATION}/16709.txt"),
    "surface": ("mesh.stl", "src/guide3d/assets/mesh.stl"),
}
_MESH_UNIT = "cm"
# The radius of a 0.035-inch wire.
_ROOM_MM = 0.4445
_PLACES, _NOISE_PAIRS, _NOISE_DRAWS = 9, 6, 8
# A pair is left out if its tips differ by _BAD_CLICKS, or if the curve misses the pictures by _BAD_PX.
_BAD_CLICKS, _BAD_PX = 10.0, 5.0
# Standard deviation over median deviation, and error of a median over that of a mean, of a normal distribution.
_MAD, _MEDIAN = 1.4826, 1.2533


@dataclasses.dataclass(frozen=True)
class Check:
    """Epipolar check of a video, or of several."""

    name: str
    use: str
    pairs: int
    median_px: float
    scatter_px: float
    median_error_px: float
    """Standard error of the median, if the clicks of all pairs are independent."""
    same_side_percent: float


def _paths(folder: pathlib.Path) -> Dict[str, str]:
    found = {}
    for what, names in _FILES.items():
        there = [folder / name for name in names if (folder / name).is_file()]
        if not there:
            raise Error(
                f"{folder}: has no {names[0]} ({what}), also not as {' or '.join(names[1:])}; give a clone of "
                "github.com/tudorjnu/guide3d, or a folder with 3d.json, 16710.txt, 16709.txt and mesh.stl"
            )
        found[what] = str(there[0])
    return found


def _offset_px(pair: Pair, frame: Frame) -> float:
    """Rows by which the tips of a pair miss each other's plane through both centers."""
    return float(pair.offsets_px(frame.first[:1], frame.second[:1])[0])


def _check(name: str, use: str, pair: Pair, frames: Sequence[Frame]) -> Check:
    offsets = np.array([_offset_px(pair, frame) for frame in frames])
    median = float(np.median(offsets))
    scatter = _MAD * float(np.median(np.abs(offsets - median)))
    side = 100 * float((np.sign(offsets) == np.sign(median)).mean())
    return Check(name, use, len(frames), median, scatter, _MEDIAN * scatter / math.sqrt(len(frames)), side)


def _spread(frames: Sequence[Frame], count: int) -> List[Frame]:
    """Some of the frames, evenly chosen."""
    return [frames[k] for k in np.unique(np.linspace(0, len(frames) - 1, min(count, len(frames))).astype(int))]


def _shapes(wires: Mapping[str, Array], minimum: Minimum) -> str:
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["shape", "point", "x_mm", "y_mm", "z_mm"])
    for name, points in wires.items():
        for number, point in enumerate(minimum.moved(points)):
            table.writerow([name, number, *(f"{value:.4f}" for value in point)])
    return out.getvalue()


def convert(folder: Path, out: Path) -> str:
    """Reads the data in a folder and makes a new folder of shapes; returns a description.

    Videos in the order of their names are calibration, test, calibration and so on. The offset of
    the cameras, the noise and the registration come from the calibration videos alone. Raises Error
    naming file, field, value and remedy.
    """
    source = pathlib.Path(folder)
    if os.path.lexists(out):
        raise Error(f"{os.fspath(out)}: exists already; remove it, or give another name")
    need("scipy.optimize")
    paths = _paths(source)
    cameras = _cameras.read(paths["camera 1"]), _cameras.read(paths["camera 2"])
    _cameras.check(*cameras)
    published = Pair(*cameras)
    videos = [video for video in _annotations.read(paths["annotations"]) if video.frames]
    lumen = _registration.lumen_of(paths["surface"], _MESH_UNIT)
    uses = {video.name: "test" if k % 2 else "calibration" for k, video in enumerate(videos)}
    calibration = [frame for video in videos if uses[video.name] == "calibration" for frame in video.frames]

    whole = _check("all calibration videos", "calibration", published, calibration)
    pair = published.corrected(whole.median_px)
    click_px = whole.scatter_px / math.sqrt(2)
    checks = [whole, *(_check(video.name, uses[video.name], published, video.frames) for video in videos)]
    after = _check("all calibration videos, corrected", "calibration", pair, calibration)
    wires, bad, errors_px = _reconstructed(pair, videos, click_px)
    good = [frame for frame in calibration if frame.name in wires]
    if not good:
        raise Error(f"{paths['annotations']}: no pair of a calibration video agrees with the cameras; check that these belong together")
    random = np.random.default_rng(1)
    noise = [_curves.noise_of(pair, frame, click_px, _NOISE_DRAWS, random) for frame in _spread(good, _NOISE_PAIRS)]
    minima = _registration.register(lumen, [wires[frame.name] for frame in _spread(good, _PLACES)], _ROOM_MM)
    size = pair.mm_per_px(np.vstack([wires[frame.name] for frame in good]))
    report: Dict[str, Any] = {
        "sources": {
            what: {"file": path, "sha256": hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()} for what, path in paths.items()
        },
        "torquer": f"{__version__}, build {__build__}",
        "epipolar_checks": [dataclasses.asdict(check) for check in [*checks, after]],
        "correction_px": whole.median_px,
        "correction_mm": whole.median_px * size,
        "mm_per_px": size,
        "click_px": click_px,
        "reprojection_rms_px": rms(errors_px),
        "noise_mm": [{"along_wire": along, "tip": tip} for along, tip in noise],
        "registration": [
            {**dataclasses.asdict(one), "from_best_deg": _registration.angle_deg(np.radians(one.turn_deg), np.radians(minima[0].turn_deg))}
            for one in minima
        ],
        "left_out": bad,
    }
    files = {"report.json": json.dumps(report, indent=1, allow_nan=False) + "\n", "report.md": _markdown(report, len(wires))}
    for use in ("calibration", "test"):
        some = {name: points for name, points in wires.items() if uses[name.rsplit("/", 1)[0]] == use}
        for number, minimum in enumerate(minima, 1):
            if some:
                files[f"{use}{'' if number == 1 else f'_minimum_{number}'}.csv"] = _shapes(some, minimum)
    write_folder(out, files)
    return (
        f"{len(wires)} shapes, {len(bad)} pairs left out; cameras off by {whole.median_px:+.1f} px = {abs(report['correction_mm']):.1f} mm, "
        f"corrected; a click has {click_px:.1f} px of noise; {len(minima)} places in the lumen fit alike: report.md"
    )


def _reconstructed(pair: Pair, videos: Sequence[Video], click_px: float) -> Tuple[Dict[str, Array], List[Dict[str, str]], List[float]]:
    """Wires by their names, pairs that are left out with the reasons, and reprojection errors."""
    wires: Dict[str, Array] = {}
    bad: List[Dict[str, str]] = []
    errors = []
    for video in videos:
        for frame in video.frames:
            tip = _offset_px(pair, frame)
            if abs(tip) > _BAD_CLICKS * max(click_px, 1.0):
                bad.append({"pair": frame.name, "reason": f"the tips are {abs(tip):.0f} px apart"})
                continue
            wire = _curves.reconstruct(pair, frame.first, frame.second)
            if not wire.reprojection_px <= _BAD_PX or len(wire.points) < 12:
                bad.append({"pair": frame.name, "reason": f"the curve misses the pictures by {wire.reprojection_px:.1f} px"})
                continue
            wires[frame.name] = wire.points
            errors.append(wire.reprojection_px)
    return wires, bad, errors


def _markdown(report: Mapping[str, Any], shapes: int) -> str:
    def table(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> List[str]:
        cells = [[f"{value:.2f}" if isinstance(value, float) else str(value) for value in row] for row in rows]
        return ["| " + " | ".join(row) + " |" for row in [list(names), ["---"] * len(names), *cells]]

    checks = report["epipolar_checks"]
    minima = report["registration"]
    noise = report["noise_mm"]
    lines = [
        f"# {shapes} shapes of Guide3D", "", "## Epipolar check of the cameras", "",
        "Rows by which the tip in picture 1 lies too far from the epipolar line of that in picture 2.", "",
        *table(list(checks[0]), [list(check.values()) for check in checks]), "",
        f"Half of {report['correction_px']:.2f} px, the median of the calibration videos, was put into the principal point of each "
        f"camera. It is {abs(report['correction_mm']):.2f} mm at the wire. The curves miss the pictures by "
        f"{report['reprojection_rms_px']:.2f} px RMS.",
        "", "## Noise", "",
        f"A click has {report['click_px']:.2f} px of noise, the scatter of the calibration videos over the square root of 2. "
        f"Clicks moved by that ({_NOISE_DRAWS} draws each) move {len(noise)} wires by "
        f"{min(one['along_wire'] for one in noise):.2f} to {max(one['along_wire'] for one in noise):.2f} mm RMS across themselves, "
        f"and their tips by {min(one['tip'] for one in noise):.2f} to {max(one['tip'] for one in noise):.2f} mm.",
        "", "## Registration with the surface", "",
        f"Rigid, by up to {_PLACES} wires of calibration videos, whose points should have {_ROOM_MM:g} mm of room; "
        f"{_registration.STARTS} starts up to {_registration.LARGEST_TURN_DEG:g} degrees and about {_registration.SHIFT_MM:g} mm from the "
        f"frame of the cameras. Minima up to {_registration.ALIKE:g} times the least violation compete:", "",
        *table(list(minima[0]), [[_numbers(value) for value in one.values()] for one in minima]), "",
        "The first one gave `calibration.csv` and `test.csv`, another one the files with its number.",
    ]
    if report["left_out"]:
        lines += ["", "## Left out", "", *table(["pair", "reason"], [list(one.values()) for one in report["left_out"]])]
    lines += ["", "## Sources", ""] + [f"- {what}: `{one['file']}`, SHA-256 `{one['sha256']}`" for what, one in report["sources"].items()]
    return "\n".join(lines) + "\n"


def _numbers(value: Any) -> Any:
    return "(" + ", ".join(f"{number:.2f}" for number in value) + ")" if isinstance(value, tuple) else value
