"""A scripted controller for the tasks of torquer.steve. It sees the whole state of the simulation and of the vessel."""

from __future__ import annotations

import math
from typing import Any, Dict, Tuple

import numpy as np
import numpy.typing as npt

from . import steve
from ._polyline import arcs_of, at_arcs

Array = npt.NDArray[Any]

# The shaped part of a wire is a little longer than this. Its direction is that of the part behind it.
_TIP_MM, _BEHIND_MM = 14.0, 6.0
_AHEAD_MM = 16.0  # from the tip to the point of the route at which the tip aims
_ASIDE_MM = 3.0  # a target of the aim less far from the wire's axis needs little rotation
_GAIN = 0.6  # part of the error of the rotation that a step corrects
_OTHER_MM = 3.0  # points of centerlines farther from the route are other vessels
_WRONG_MM = 9.0  # a tip so far outside of the route's vessel may be in another one
_PATIENCE = 12  # steps without progress
_BACK_MM = 15.0
_LAG_MM = 30.0  # of an outer instrument behind the wire


class Teacher:
    """Aims the bent tip at the route ahead, and pushes. In another vessel, or without progress, it withdraws the wire,
    aims again and pushes. Outer instruments follow the wire."""

    def __init__(self, env: steve.SteveEnv, info: Dict[str, Any]) -> None:
        """For the episode that a reset has begun. info: that of the reset."""
        self._env = env
        scene = env.scene
        self._route = scene.route_mm(info["target"], info["target_at_mm"])
        self._arcs = arcs_of(self._route)
        self._radii = scene.clearance_mm(self._route)
        tree = np.vstack([scene.centerline_mm(name, 2.0) for name in scene.centerlines])
        off_mm = np.linalg.norm(tree[:, None] - self._route[None, ::2], axis=2).min(axis=1)
        self._others = tree[off_mm > _OTHER_MM]
        self._other_radii = scene.clearance_mm(self._others)
        self._mode = "push"
        self._best_mm = self._back_to_mm = 0.0
        self._idle = 0.0
        self._tries = 0

    def act(self) -> Array:
        """Feed and rotation of each instrument as fractions of the limits, shape (instruments, 2)."""
        hands = self._env.simulation.hands
        out = np.zeros_like(hands)
        out[0] = self._steer(float(hands[0, 0]))
        lag_mm = hands[0, 0] - hands[1:, 0]
        out[1:, 0] = np.clip((lag_mm - _LAG_MM) / self._env.task.longest_mm, -1, 1)
        return out

    def _steer(self, inserted_mm: float) -> Tuple[float, float]:
        nodes_mm = self._env.simulation.nodes_mm
        at_mm, wrong = self._place(nodes_mm[-1])
        error_rad, aside_mm = self._rotation_error(nodes_mm, at_mm)
        turn = float(np.clip(_GAIN * error_rad / self._env.task.largest_turn_rad, -1, 1))
        self._decide(at_mm, wrong, inserted_mm, abs(error_rad))
        if self._mode == "withdraw":
            return -1.0, 0.0
        if self._mode == "turn":
            return 0.0, turn
        if aside_mm <= _ASIDE_MM:
            return 1.0, 0.5 * turn
        feed = 1.0 if abs(error_rad) < 0.5 else 0.3 if abs(error_rad) < 1 else 0.0
        if feed == 0:
            self._idle -= 0.7
        return feed, turn

    def _decide(self, at_mm: float, wrong: bool, inserted_mm: float, error_rad: float) -> None:
        """Sets the mode of this step."""
        if self._mode == "push":
            progress = at_mm > self._best_mm + 0.5 and not wrong
            self._best_mm, self._idle = (at_mm, 0.0) if progress else (self._best_mm, self._idle + 1)
            if wrong or self._idle > _PATIENCE:
                self._tries += 1
                self._mode, self._back_to_mm = "withdraw", max(0.0, at_mm - _BACK_MM - 5 * (self._tries % 4))
        if self._mode == "withdraw" and (at_mm <= self._back_to_mm + 1 and not wrong or inserted_mm < 2):
            self._mode, self._idle = "turn", 0.0
        if self._mode == "turn":
            self._idle += 1
            if error_rad < 0.35 or self._idle > _PATIENCE:
                self._mode, self._best_mm, self._idle = "push", at_mm, 0.0

    def _place(self, tip_mm: Array) -> Tuple[float, bool]:
        """Place of the tip along the route, and True if the tip is in another vessel."""
        off_mm = np.linalg.norm(self._route - tip_mm, axis=1)
        own = off_mm**2 - self._radii**2
        nearest = own.argmin()
        outside_mm = off_mm[nearest] - 1.2 * self._radii[nearest]
        if outside_mm < _WRONG_MM or len(self._others) == 0:
            return float(self._arcs[off_mm.argmin()]), False
        other = ((self._others - tip_mm) ** 2).sum(axis=1) - self._other_radii**2
        return float(self._arcs[off_mm.argmin()]), bool(other.min() < own[nearest])

    def _rotation_error(self, nodes_mm: Array, at_mm: float) -> Tuple[float, float]:
        """Angle from the bent tip to the aim about the wire's axis, rad, and the distance of the aim from that axis."""
        length_mm = arcs_of(nodes_mm)[-1]
        if length_mm < _TIP_MM + _BEHIND_MM:
            return 0.0, 0.0
        tip, bend, behind = at_arcs(nodes_mm, length_mm - np.array([0.0, _TIP_MM, _TIP_MM + _BEHIND_MM]))
        axis = (bend - behind) / np.linalg.norm(bend - behind)
        aim = at_arcs(self._route, [min(at_mm + _AHEAD_MM, self._arcs[-1])])[0]
        want, have = (way - axis * (axis @ way) for way in (aim - bend, tip - bend))
        return math.atan2(axis @ np.cross(have, want), have @ want), float(np.linalg.norm(want))
