"""Cameras of Guide3D, and the planes in which both see the same point."""

from __future__ import annotations

import dataclasses
from typing import Any, Dict, List

import numpy as np

from .._user_file import read_text
from ._base import Array, Error

# The files have cm.
_MM = 10.0
_SECTIONS = {"image size": (1, 2), "camera matrix": (3, 3), "rotation": (3, 3), "translation": (3, 1)}


@dataclasses.dataclass(frozen=True)
class Camera:
    """A pinhole: pixel = matrix (rotation point + shift), points in mm."""

    matrix: Array
    rotation: Array
    shift: Array

    @property
    def center(self) -> Array:
        out: Array = -self.rotation.T @ self.shift
        return out

    def moved(self, rows_px: float) -> Camera:
        """The camera with its principal point moved by rows."""
        matrix = self.matrix.copy()
        matrix[1, 2] += rows_px
        return dataclasses.replace(self, matrix=matrix)

    def pixels(self, points: Array) -> Array:
        inside = (points @ self.rotation.T + self.shift) @ self.matrix.T
        out: Array = inside[:, :2] / inside[:, 2:]
        return out

    def slopes(self, points: Array) -> Array:
        """Change of the pixels with the points: (n, 2, 3)."""
        matrix = self.matrix @ self.rotation
        inside = (points @ self.rotation.T + self.shift) @ self.matrix.T
        first = matrix[None, :2, :] / inside[:, 2, None, None]
        second = inside[:, :2, None] * matrix[None, 2:, :] / inside[:, 2, None, None] ** 2
        out: Array = first - second
        return out

    def rays(self, pixels: Array) -> Array:
        """Directions from the center to pixels, not of length 1."""
        ends = np.column_stack([pixels, np.ones(len(pixels))])
        out: Array = np.linalg.solve(self.matrix, ends.T).T @ self.rotation
        return out


def read(path: str) -> Camera:
    """Reads a file of the published calibration. Raises Error naming file, line, value and remedy."""
    lines = read_text(path).splitlines()
    found: Dict[str, Array] = {}
    k = 0
    while k < len(lines):
        name = lines[k].strip()
        k += 1
        if name not in _SECTIONS:
            continue
        count, width = _SECTIONS[name]
        rows: List[List[float]] = []
        for line in range(k, k + count):
            text = lines[line] if line < len(lines) else ""
            try:
                rows.append([float(word) for word in text.split(",")])
            except ValueError:
                rows.append([])
            if len(rows[-1]) != width or not np.isfinite(rows[-1]).all():
                raise Error(f"{path}:{line + 1}: {name} is {text[:60]!r}; give {width} numbers, as in the published file")
        found[name] = np.array(rows)
        k += count
    for name in _SECTIONS:
        if name not in found:
            raise Error(f"{path}: section {name!r} is missing; give the published file of the camera")
    rotation = found["rotation"]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0:
        raise Error(f"{path}: rotation is no rotation; give the published file of the camera")
    if not (found["camera matrix"][[0, 1], [0, 1]] > 0).all():
        raise Error(f"{path}: camera matrix has a focal length that is not positive; give the published file of the camera")
    return Camera(found["camera matrix"], rotation, _MM * found["translation"][:, 0])


class Pair:
    """Two cameras. A point and both centers span a plane, whose angle about the line of the centers both see."""

    def __init__(self, first: Camera, second: Camera) -> None:
        self.cameras = (first, second)
        base = second.center - first.center
        base /= np.linalg.norm(base)
        ahead = first.rotation[2] + second.rotation[2]
        ahead -= ahead @ base * base
        ahead /= np.linalg.norm(ahead)
        self._ahead, self._side = ahead, np.cross(base, ahead)

    def angles(self, number: int, pixels: Array) -> Array:
        """Angle of the plane of each pixel of a camera, rad."""
        rays = self.cameras[number].rays(pixels)
        out: Array = np.arctan2(rays @ self._side, rays @ self._ahead)
        return out

    def per_row(self, number: int, pixels: Array) -> Array:
        """Change of these angles with the row, rad/px."""
        half = np.array([0.0, 0.5])
        return self.angles(number, pixels + half) - self.angles(number, pixels - half)

    def offsets_px(self, first: Array, second: Array) -> Array:
        """Rows by which pixels of the first picture lie too far from the planes of those of the second."""
        slope = (self.per_row(0, first) + self.per_row(1, second)) / 2
        return (self.angles(0, first) - self.angles(1, second)) / slope

    def corrected(self, offset_px: float) -> Pair:
        """The pair with half of an offset in the principal point of each camera."""
        first, second = self.cameras
        return Pair(first.moved(offset_px / 2), second.moved(-offset_px / 2))

    def points(self, first: Array, second: Array) -> Array:
        """Points that are nearest to the rays of pixels of both pictures."""
        sums = np.zeros((len(first), 3, 3))
        sides = np.zeros((len(first), 3))
        for camera, pixels in zip(self.cameras, (first, second)):
            rays = camera.rays(pixels)
            rays /= np.linalg.norm(rays, axis=1)[:, None]
            across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
            sums += across
            sides += across @ camera.center
        out: Array = np.linalg.solve(sums, sides[:, :, None])[:, :, 0]
        return out

    def mm_per_px(self, points: Array) -> float:
        """Size of a pixel at points: the mean over both cameras."""
        sizes: List[Any] = []
        for camera in self.cameras:
            depth = (points @ camera.rotation.T + camera.shift)[:, 2]
            sizes.append(depth / np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1]))
        return float(np.mean(sizes))


def check(first: Camera, second: Camera) -> None:
    """Refuses cameras that see in the same direction or from the same place."""
    if np.linalg.norm(first.center - second.center) < 1 or abs(first.rotation[2] @ second.rotation[2]) > 0.99:
        raise Error("both cameras see the same; give the files of two cameras, 16710.txt and 16709.txt")
