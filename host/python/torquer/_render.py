"""Pictures of the instruments in the vessel, without X-ray."""

from __future__ import annotations

import tomllib
from typing import Any, List, Tuple

import numpy as np
import numpy.typing as npt

from . import Error, Scene, Simulation
from ._polyline import arcs_of, at_arcs

Picture = npt.NDArray[np.uint8]

_LARGEST_PX = 400
_STEP_MM = 1.0
_OUTSIDE = (18, 20, 26)
_LUMEN = (96, 58, 58)
_TARGET = (80, 220, 120)
_INSTRUMENTS = ((240, 240, 240), (255, 190, 80), (110, 180, 255), (220, 130, 255))


class WireView:
    """Projection of a scene along the shorter horizontal side of its bounding box.

    The patient's head is at the top. In a scene without [patient_axes], the longest side is vertical.
    The lumen is drawn as a disk at each point of the centerlines, with the clearance there as its radius. It shows the
    vessel at rest.
    """

    def __init__(self, scene: Scene) -> None:
        low, high = scene.bounds_mm
        longest = "+" + "xyz"[int(np.argmax(high - low))]
        superior = tomllib.loads(scene.text).get("patient_axes", {}).get("superior", longest)
        self._up = "xyz".index(superior[-1])
        self._upside_down = superior[0] == "-"
        horizontal = [axis for axis in range(3) if axis != self._up]
        self._across = max(horizontal, key=lambda axis: float(high[axis] - low[axis]))
        self._low = low
        sides_mm = (high - low)[[self._up, self._across]]
        longest_mm = float(sides_mm.max())
        self._px_per_mm = (_LARGEST_PX - 1) / longest_mm
        self._shape = (*(int(side * self._px_per_mm) + 1 for side in sides_mm), 3)
        self._background = np.empty(self._shape, np.uint8)
        self._background[:] = _OUTSIDE
        for name in scene.centerlines:
            points_mm = scene.centerline_mm(name, max(_STEP_MM, longest_mm / 1000))
            radii = np.maximum(scene.clearance_mm(points_mm) * self._px_per_mm, 0)
            for (row, column), radius in zip(self._pixels(points_mm), radii):
                self._disk(self._background, row, column, float(radius), _LUMEN)

    def draw(self, simulation: Simulation, target_mm: npt.ArrayLike) -> Picture:
        """Picture of the present state, shape (height, width, 3), with the target."""
        picture = self._background.copy()
        target = self._pixels(np.atleast_2d(np.asarray(target_mm, float)))[0]
        self._disk(picture, int(target[0]), int(target[1]), 4.0, _TARGET)
        # The innermost instrument is drawn last.
        for index in reversed(range(len(simulation.scene.instruments))):
            color = _INSTRUMENTS[index % len(_INSTRUMENTS)]
            nodes_mm = simulation.instrument_nodes_mm(index)
            rows, columns = self._line(nodes_mm).T
            picture[rows, columns] = color
            if len(nodes_mm) > 0:
                tip = self._pixels(nodes_mm[-1:])[0]
                self._disk(picture, int(tip[0]), int(tip[1]), 1.5, color)
        return picture

    def _pixels(self, points_mm: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Row and column of points, shape (n, 2), moved into the picture."""
        up = (points_mm[:, self._up] - self._low[self._up]) * self._px_per_mm
        across = (points_mm[:, self._across] - self._low[self._across]) * self._px_per_mm
        rows = np.rint(up) if self._upside_down else self._shape[0] - 1 - np.rint(up)
        rows = np.clip(rows, 0, self._shape[0] - 1)
        columns = np.clip(np.rint(across), 0, self._shape[1] - 1)
        pixels: npt.NDArray[np.int64] = np.stack([rows, columns], axis=1).astype(np.int64)
        return pixels

    def _line(self, nodes_mm: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Pixels of the polyline through nodes."""
        if len(nodes_mm) < 2:
            return self._pixels(nodes_mm)
        samples = np.arange(0.0, arcs_of(nodes_mm)[-1], 0.5 / self._px_per_mm)
        return self._pixels(at_arcs(nodes_mm, samples))

    @staticmethod
    def _disk(picture: Picture, row: int, column: int, radius: float, color: Tuple[int, int, int]) -> None:
        reach = int(radius)
        top, left = max(row - reach, 0), max(column - reach, 0)
        part = picture[top : row + reach + 1, left : column + reach + 1]
        rows, columns = np.ogrid[top : top + part.shape[0], left : left + part.shape[1]]
        part[(rows - row) ** 2 + (columns - column) ** 2 <= radius**2] = color


class Window:
    """Window of matplotlib that shows one picture after another."""

    def __init__(self, title: str) -> None:
        try:
            import matplotlib.pyplot as plt  # type: ignore[import]
        except ImportError:
            raise Error("render_mode 'human' needs python3-matplotlib; install it, or use 'rgb_array'") from None
        self._plt: Any = plt
        plt.ion()
        self._figure: Any = plt.figure(title)
        self._axes: Any = self._figure.add_axes((0, 0, 1, 1))
        self._axes.set_axis_off()
        self._images: List[Any] = []

    def show(self, picture: Picture) -> None:
        if not self._images:
            self._images.append(self._axes.imshow(picture))
        self._images[0].set_data(picture)
        self._figure.canvas.draw_idle()
        self._figure.canvas.flush_events()

    def close(self) -> None:
        self._plt.close(self._figure)
