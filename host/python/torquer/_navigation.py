"""Tasks of environments, and their scenes, starts and spaces."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any, Dict, List, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene
from ._spaces import Box
from ._torquer import Navigation, NavigationTask


def with_keys(text: str, section: str, values: Dict[str, Any]) -> str:
    """Text of a scene with these keys set in a section, which is added if it is missing."""
    kept: List[str] = []
    at = ""
    for line in text.splitlines():
        if line.startswith("["):
            at = line
        if at == f"[{section}]" and re.match(r"(\w+)\s*=", line) and line.split("=")[0].strip() in values:
            continue
        kept.append(line)
    if f"[{section}]" not in kept:
        kept += ["", f"[{section}]"]
    index = kept.index(f"[{section}]") + 1
    kept[index:index] = [f"{key} = {value!r}" for key, value in values.items()]
    return "\n".join(kept) + "\n"


@dataclasses.dataclass(frozen=True)
class Task:
    """Target for the tip of an instrument, and limits for the motion of hands."""

    centerline: str
    at_mm: float
    within_mm: float = 3.0
    instrument: int = 0
    step_s: float = 0.1
    longest_mm: float = 2.0
    """Largest insertion or retraction in one step."""
    largest_turn_rad: float = 0.5
    """Largest turn in one step."""
    force_limit_mN: float = math.inf
    """Force on a patch of the wall; above it no success is safe."""
    max_steps: int = 400
    tolerance: float = 1e-4
    """Tolerance to which a step is relaxed; a scene's default is 1e-6."""
    segment_mm: Optional[float] = None
    """Segment length of the wire; None: that of the scene. Longer ones are faster and coarser."""
    longest_feed_mm: Optional[float] = None
    """Longest feed before the wire is relaxed again; None: that of the scene."""
    longest_tick_ms: Optional[float] = None
    """Longest tick while the vessel moves or blood flows; None: that of the scene."""
    picture_px: Optional[int] = None
    """Width and height of pictures, 64 to 1024; None: those of the scene."""

    def for_training(self) -> Task:
        """Task with faster, less accurate steps: see the table in host/python/README.md."""
        return dataclasses.replace(
            self, tolerance=1e-3, segment_mm=2.0, longest_mm=1.0, longest_feed_mm=1.0, longest_tick_ms=20.0
        )


def _scene_of(scene: Scene, task: Task, sees: bool) -> Scene:
    """Scene with the settings of a task, and with an observer of the wall's force."""
    keys: Dict[str, Any] = {"tolerance": task.tolerance}
    if task.segment_mm is not None:
        keys["segment_mm"] = float(task.segment_mm)
    if task.longest_feed_mm is not None:
        keys["longest_feed_mm"] = float(task.longest_feed_mm)
    if task.longest_tick_ms is not None:
        keys["longest_tick_ms"] = float(task.longest_tick_ms)
    text = with_keys(scene.text, "relaxation", keys)
    if "wall_force" not in scene.effects:
        text = with_keys(text, "effects.wall_force", {"threshold_mN": 100.0})
    if sees and "fluoroscopy" not in scene.effects:
        raise Error(f"{scene.name} has no X-ray pictures; add [effects.fluoroscopy]")
    if sees and task.picture_px is not None:
        size = whole("picture_px", task.picture_px, 64, 1024)
        text = with_keys(text, "effects.fluoroscopy", {"width_px": size, "height_px": size})
    return Scene.from_text(text, scene.folder)


def whole(what: str, value: Any, lowest: int, highest: int) -> int:
    """Checks a whole number that a user gave."""
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and lowest <= value <= highest:
        return int(value)
    raise Error(f"{what} is {value!r}; give a whole number from {lowest} to {highest}")


class Prepared:
    """Common parts of a single environment and a vector of them."""

    def __init__(self, scene: Union[Scene, str], task: Task, observation: str, sees: bool) -> None:
        if observation not in ("vector", "picture"):
            raise Error(f"observation is {observation!r}; give 'vector' or 'picture'")
        given = scene if isinstance(scene, Scene) else Scene(scene)
        count = len(given.instruments)
        whole("instrument", task.instrument, 0, count - 1)
        whole("max_steps", task.max_steps, 1, 2**31 - 1)
        # Without X-ray, a view of the wire in the vessel is rendered.
        sees = observation == "picture" or (sees and "fluoroscopy" in given.effects)
        self.sees = sees
        self.scene = _scene_of(given, task, sees)
        self.instrument = task.instrument
        self.route = self.scene.route_mm(task.centerline, task.at_mm, 1.0, task.instrument)
        self.task = NavigationTask(
            instrument=task.instrument,
            within_mm=task.within_mm,
            step_s=task.step_s,
            longest_mm=task.longest_mm,
            largest_turn_rad=task.largest_turn_rad,
            force_limit_mN=task.force_limit_mN,
            max_steps=task.max_steps,
            pictures=sees,
            route=self.route,
        )
        self.navigation = Navigation(self.scene, self.task)
        self.action_size = 2 * count
        self.vector_size = len(self.navigation.observe())

    def observation_space(self, observation: str) -> Any:
        if observation == "vector":
            # No point of a wire is farther from the entry than the wire's length.
            longest_mm = [one.max_length_mm for one in self.scene.instruments]
            entry_mm = self.navigation.simulation.instrument_nodes_mm(self.instrument)[:1]
            steps_mm = np.diff(self.route, axis=0, prepend=entry_mm)
            far_mm = 2 * max(longest_mm) + np.linalg.norm(steps_mm, axis=1).sum()
            turns = [1.0] * 2 * len(longest_mm)
            points = [far_mm] * (self.vector_size - len(longest_mm) - len(turns))
            high = np.array([*points, *longest_mm, *turns], np.float32)
            low = np.array([*np.negative(points), *np.zeros(len(longest_mm)), *np.negative(turns)], np.float32)
            return Box(low, high, dtype=np.float32)
        height, width = self.navigation.take_picture().shape
        return Box(0, 255, (height, width, 1), np.uint8)


def check_options(options: Optional[Dict[str, Any]], known: Sequence[str]) -> Dict[str, Any]:
    """Options of a reset, all of which are known."""
    if options is None:
        return {}
    if not isinstance(options, dict):
        raise Error(f"options are {options!r}; give a dict, as {{'rotation_rad': 0.5}}")
    for name in options:
        if name not in known:
            raise Error(f"options have {name!r}; give only {', '.join(known)}")
    return options


def chosen_rotation(options: Dict[str, Any]) -> Optional[float]:
    """Rotation in the options, or None."""
    chosen = options.get("rotation_rad")
    if chosen is None:
        return None
    try:
        return float(chosen)
    except (TypeError, ValueError):
        raise Error(f"rotation_rad is {chosen!r}; give a number") from None


def start_rotation(random: np.random.Generator, chosen: Optional[float]) -> float:
    drawn = random.uniform(-math.pi, math.pi)
    return float(drawn) if chosen is None else chosen


def chosen_mask(options: Dict[str, Any], count: int) -> npt.NDArray[np.bool_]:
    """Environments to reset: those of the option "reset_mask", or all."""
    mask = options.get("reset_mask")
    if mask is None:
        return np.ones(count, bool)
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,) or not mask.any():
        raise Error(f"reset_mask is {mask!r}; give an array of {count} booleans, at least one of them True")
    return mask


def generator(seed: Optional[int]) -> np.random.Generator:
    return np.random.default_rng(None if seed is None else whole("seed", seed, 0, 2**63 - 1))


INFO = ("success", "safe_success", "wall_force_mN", "path_mm", "remaining_mm", "time_s")
