"""Places of an instrument in the X-ray picture, as a tracker of pictures finds them."""

from __future__ import annotations

import math
from typing import Any, Tuple

import numpy as np
import numpy.typing as npt

from . import Error, Simulation
from ._names import shown
from ._polyline import arcs_of, at_arcs
from ._spaces import Box

POINTS = 6
"""Tracked points: the tip, and others behind it."""
APART_MM = 5.0


class Tracker:
    """Tracks an instrument of a scene with [effects.fluoroscopy]. No picture is rendered for it."""

    def __init__(self, size: Tuple[int, int], instrument: int, noise_px: Any) -> None:
        """size: width and height of the picture. noise_px: standard deviation of a coordinate of a tracked point."""
        if isinstance(noise_px, bool) or not isinstance(noise_px, (int, float)) or not 0 <= noise_px < math.inf:
            raise Error(f"tracking_noise_px is {shown(noise_px)}; give a number from 0 on")
        self._size = np.array(size, float)
        self._instrument = instrument
        self._noise_px = float(noise_px)

    def space(self) -> Any:
        """Columns and rows, up to one width and one height beyond the picture."""
        high = np.tile(self._size, POINTS + 1)
        return Box((-high).astype(np.float32), (2 * high).astype(np.float32), dtype=np.float32)

    def observe(
        self, simulation: Simulation, target_mm: npt.NDArray[np.float64], random: np.random.Generator
    ) -> npt.NDArray[np.float32]:
        """Columns and rows of the tracked points, from the tip on, and of the target."""
        nodes_mm = simulation.instrument_nodes_mm(self._instrument)
        arcs_mm = arcs_of(nodes_mm)[-1] - APART_MM * np.arange(POINTS)
        places = simulation.places_in_picture(np.vstack([at_arcs(nodes_mm, arcs_mm), target_mm]))
        places[:POINTS] += random.normal(0.0, self._noise_px, (POINTS, 2))
        # A point that is not in front of the source has no place.
        known = np.nan_to_num(places, nan=-np.inf)
        seen: npt.NDArray[np.float32] = np.clip(known, -self._size, 2 * self._size).astype(np.float32).ravel()
        return seen
