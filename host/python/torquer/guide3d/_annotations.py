"""Annotations of Guide3D: 3d.json, a list of videos with the clicked points of each pair of pictures."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Dict, List

import numpy as np

from .._user_file import load_json, read_text
from ._base import Array, Error

_CAMERAS = ("camera1", "camera2")
_FEWEST, _MOST, _LARGEST_PX = 6, 1000, 1e5
_PUBLISHED = "give 3d.json as published"


@dataclasses.dataclass(frozen=True)
class Frame:
    """A pair of pictures: the clicked points of each, tip first, without repeated ones."""

    name: str
    first: Array
    second: Array


@dataclasses.dataclass(frozen=True)
class Video:
    name: str
    frames: List[Frame]


def _field(where: str, value: Any, name: str, kind: type) -> Any:
    if not isinstance(value, dict) or name not in value:
        raise Error(f"{where}.{name} is missing; {_PUBLISHED}")
    if not isinstance(value[name], kind) or isinstance(value[name], bool):
        raise Error(f"{where}.{name} is {str(value[name])[:40]}, not {kind.__name__}; {_PUBLISHED}")
    return value[name]


def _points(where: str, value: Any) -> Array:
    points = _field(where, value, "points", list)
    if not _FEWEST <= len(points) <= _MOST:
        raise Error(f"{where}.points has {len(points)} points, not {_FEWEST} to {_MOST}; {_PUBLISHED}")
    for k, point in enumerate(points):
        numbers = point if isinstance(point, list) else []
        if len(numbers) != 2 or not all(
            type(number) in (int, float) and math.isfinite(number) and abs(number) < _LARGEST_PX for number in numbers
        ):
            raise Error(f"{where}.points[{k}] is {str(point)[:40]}, not [column, row] in pixels; {_PUBLISHED}")
    out = np.array(points, float)
    moved = np.append(True, np.linalg.norm(np.diff(out, axis=0), axis=1) > 0)
    if moved.sum() < _FEWEST:
        raise Error(f"{where}.points has {moved.sum()} different points; {_PUBLISHED}")
    kept: Array = out[moved]
    return kept


def read(path: str) -> List[Video]:
    """Videos by their names. Raises Error naming file, field, value and remedy."""
    try:
        document = load_json(read_text(path))
    except ValueError as error:
        raise Error(f"{path}: not valid JSON ({error}); {_PUBLISHED}") from None
    if not isinstance(document, list) or not document:
        raise Error(f"{path}: is no list of videos; {_PUBLISHED}")
    videos: Dict[str, Video] = {}
    for number, video in enumerate(document):
        where = f"{path}: [{number}]"
        name = _field(where, video, "task", str)
        if not name or not name.isprintable() or len(name) > 60 or name in videos:
            raise Error(f"{where}.task is {name[:60]!r}, which is not a new name; {_PUBLISHED}")
        videos[name] = Video(name, [])
        numbers = set()
        for k, frame in enumerate(_field(where, video, "frames", list)):
            at = f"{where}.frames[{k}]"
            frame_number = _field(at, frame, "frame_number", int)
            if frame_number in numbers:
                raise Error(f"{at}.frame_number is {frame_number} again; {_PUBLISHED}")
            numbers.add(frame_number)
            pair = [_points(f"{at}.{camera}", _field(at, frame, camera, dict)) for camera in _CAMERAS]
            videos[name].frames.append(Frame(f"{name}/{frame_number}", pair[0], pair[1]))
    if not any(video.frames for video in videos.values()):
        raise Error(f"{path}: holds no frame; {_PUBLISHED}")
    return [videos[name] for name in sorted(videos)]
