"""Tasks of environments, and their scenes, starts and spaces."""

from __future__ import annotations

import dataclasses
import math
import numbers
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene, Simulation
from ._names import did_you_mean, first_unknown, shown
from ._spaces import Box, DictSpace
from ._torquer import FACTS, Navigation, NavigationTask, printable
from ._tracking import Tracker


Target = Tuple[str, float]
"""Centerline, and the distance from its start, mm."""
Observation = Union[str, Sequence[str]]


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
    """Segment length of the wire; None: the scene's value. Longer segments are faster and coarser."""
    longest_feed_mm: Optional[float] = None
    """Longest feed before the wire is relaxed again; None: the scene's value."""
    longest_tick_ms: Optional[float] = None
    """Longest tick while the vessel moves or blood flows; None: the scene's value."""
    picture_px: Optional[int] = None
    """Width and height of pictures, 64 to 1024; None: the scene's values."""
    other_targets: Tuple[Tuple[Any, ...], ...] = ()
    """More targets: pairs of a centerline and at_mm, or (centerline, lowest, highest) for a random place
    between two. Each reset draws one of all targets, with equal probability."""
    tracking_noise_px: float = 0.0
    """Standard deviation of each coordinate of a tracked point, pixels."""

    def for_training(self) -> Task:
        """Task with faster, less accurate steps: see the table in host/python/README.md."""
        return dataclasses.replace(
            self, tolerance=1e-3, segment_mm=2.0, longest_mm=1.0, longest_feed_mm=1.0, longest_tick_ms=20.0
        )


def _require_number(what: str, value: Any) -> None:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise Error(f"{what} is {shown(value)}; give a number")


def _check(task: Any) -> None:
    """Checks the types of a task that a user gave."""
    if not isinstance(task, Task):
        raise Error(f"task is {shown(task)}; give a torquer.envs.Task")
    if not isinstance(task.centerline, str):
        raise Error(f"centerline is {shown(task.centerline)}; give the name of a centerline")
    for name in ("at_mm", "within_mm", "step_s", "longest_mm", "largest_turn_rad", "force_limit_mN", "tolerance"):
        _require_number(name, getattr(task, name))
    for name in ("segment_mm", "longest_feed_mm", "longest_tick_ms"):
        if getattr(task, name) is not None:
            _require_number(name, getattr(task, name))
    if not isinstance(task.other_targets, (tuple, list)):
        raise Error(f"other_targets is {shown(task.other_targets)}; give a tuple of targets")


def _scene_of(scene: Scene, task: Task, sees: bool) -> Scene:
    """Scene with the settings of a task, and with an observer of the wall's force."""
    values: Dict[str, Any] = {"relaxation.tolerance": task.tolerance}
    for key in ("segment_mm", "longest_feed_mm", "longest_tick_ms"):
        if getattr(task, key) is not None:
            values[f"relaxation.{key}"] = float(getattr(task, key))
    if "wall_force" not in scene.effects:
        values["effects.wall_force.threshold_mN"] = 100.0
    if sees and "fluoroscopy" not in scene.effects:
        raise Error(f"{scene.name} has no X-ray pictures; add [effects.fluoroscopy]")
    if sees and task.picture_px is not None:
        size = whole("picture_px", task.picture_px, 64, 1024)
        values.update({"effects.fluoroscopy.width_px": size, "effects.fluoroscopy.height_px": size})
    return scene.with_values(values)


def whole(what: str, value: Any, lowest: int, highest: int) -> int:
    """Checks a whole number that a user gave."""
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and lowest <= value <= highest:
        return int(value)
    raise Error(f"{what} is {shown(value)}; give a whole number from {lowest} to {highest}")


OBSERVATIONS = ("vector", "picture", "tracking")


def parts_of(observation: Observation) -> Tuple[str, ...]:
    """Names of the parts of an observation."""
    try:
        parts = (observation,) if isinstance(observation, str) else tuple(observation)
    except TypeError:
        parts = ()
    if not parts or len(set(parts)) < len(parts) or any(part not in OBSERVATIONS for part in parts):
        near = did_you_mean(first_unknown(parts, OBSERVATIONS), OBSERVATIONS)
        raise Error(f"observation is {shown(observation)}; {near}give 'vector', 'picture' or 'tracking', or some of them as a tuple for a dict")
    return parts


class Targets:
    """Targets of a task, with the routes to them."""

    def __init__(self, scene: Scene, task: Task) -> None:
        self._scene = scene
        self._instrument = task.instrument
        self.ranges: List[Tuple[str, float, float]] = [(task.centerline, float(task.at_mm), float(task.at_mm))]
        for given in task.other_targets:
            name, *at_mm = given if isinstance(given, (tuple, list)) else (given,)
            good = isinstance(name, str) and len(at_mm) in (1, 2) and all(isinstance(at, numbers.Real) for at in at_mm)
            if not good or not at_mm[0] <= at_mm[-1]:
                raise Error(f"other_targets has {shown(given)}; give (centerline, at_mm) or (centerline, lowest, highest)")
            self.ranges.append((name, float(at_mm[0]), float(at_mm[-1])))
        # The ends of all ranges must be in the vessel.
        self.ends = [self.route((name, at)) for name, low, high in self.ranges for at in {low, high}]

    def route(self, target: Target) -> npt.NDArray[np.float64]:
        return self._scene.route_mm(target[0], target[1], 1.0, self._instrument)

    def draw(self, random: np.random.Generator, chosen: Optional[Target]) -> Target:
        """Target of an episode. Uses no random number if there is only one target."""
        if chosen is not None:
            return chosen
        if len(self.ranges) == 1 and self.ranges[0][1] == self.ranges[0][2]:
            return self.ranges[0][:2]
        name, low, high = self.ranges[random.integers(len(self.ranges))]
        return name, float(random.uniform(low, high))

    def chosen(self, options: Dict[str, Any]) -> Optional[Target]:
        """Target in the options, or None."""
        given = options.get("target")
        if given is None:
            return None
        for name, low, high in self.ranges:
            if isinstance(given, (tuple, list)) and len(given) == 2 and given[0] == name and isinstance(given[1], numbers.Real):
                at_mm = float(given[1])
                if low <= at_mm <= high:
                    return name, at_mm
        names = [name for name, _, _ in self.ranges]
        known = ", ".join(f"({name!r}, {low:g})" if low == high else f"({name!r}, {low:g} to {high:g})" for name, low, high in self.ranges)
        name = given[0] if isinstance(given, (tuple, list)) and given else given
        near = did_you_mean(first_unknown([name], names), names)
        raise Error(f"target is {shown(given)}; {near}give a centerline and at_mm of the task's targets: {known}")


class Prepared:
    """Common parts of a single environment and a vector of them."""

    def __init__(self, scene: Union[Scene, str], task: Task, observation: Observation, sees: bool) -> None:
        _check(task)
        self.parts = parts_of(observation)
        self.is_dict = not isinstance(observation, str)
        given = scene if isinstance(scene, Scene) else Scene(scene)
        count = len(given.instruments)
        whole("instrument", task.instrument, 0, count - 1)
        whole("max_steps", task.max_steps, 1, 2**31 - 1)
        # Without X-ray, a view of the wire in the vessel is rendered.
        sees = "picture" in self.parts or (sees and "fluoroscopy" in given.effects)
        self.sees = sees
        tracks = "tracking" in self.parts
        self.scene = _scene_of(given, task, sees or tracks)
        self.instrument = task.instrument
        self.targets = Targets(self.scene, task)
        self.route = self.targets.route((task.centerline, task.at_mm))
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
        self.tracker: Optional[Tracker] = None
        if tracks:
            height, width = self.navigation.take_picture().shape
            self.tracker = Tracker((width, height), task.instrument, task.tracking_noise_px)
        self.action_size = 2 * count
        self.vector_size = len(self.navigation.observe())

    def observation_space(self, room: float = 1.0) -> Any:
        """room: factor of the bounds of points over those that this scene needs."""
        spaces = {part: self._space(part, room) for part in self.parts}
        return DictSpace(spaces) if self.is_dict else spaces[self.parts[0]]

    def fits(self, space: Any) -> bool:
        """True if the bounds in `space` contain all observations of this scene."""

        def contains(outer: Any, inner: Any) -> bool:
            return bool(outer.shape == inner.shape and (outer.low <= inner.low).all() and (outer.high >= inner.high).all())

        own = self.observation_space()
        return all(contains(space[part], own[part]) for part in self.parts) if self.is_dict else contains(space, own)

    def _space(self, part: str, room: float) -> Any:
        if part == "vector":
            # No point of a wire is farther from the entry than the wire's length.
            longest_mm = [one.max_length_mm for one in self.scene.instruments]
            entry_mm = self.navigation.simulation.instrument_nodes_mm(self.instrument)[:1]
            ways_mm = [
                np.linalg.norm(np.diff(route, axis=0, prepend=entry_mm), axis=1).sum() for route in self.targets.ends
            ]
            far_mm = room * (2 * max(longest_mm) + max(ways_mm))
            turns = [1.0] * 2 * len(longest_mm)
            points = [far_mm] * (self.vector_size - len(longest_mm) - len(turns))
            high = np.array([*points, *longest_mm, *turns], np.float32)
            low = np.array([*np.negative(points), *np.zeros(len(longest_mm)), *np.negative(turns)], np.float32)
            return Box(low, high, dtype=np.float32)
        if part == "tracking" and self.tracker is not None:
            return self.tracker.space()
        height, width = self.navigation.take_picture().shape
        return Box(0, 255, (height, width, 1), np.uint8)


def action_values(actions: npt.ArrayLike, shape: Tuple[int, ...], name: str) -> npt.NDArray[np.float64]:
    """Actions as numbers. Raises Error unless they have the shape and are finite."""
    try:
        values = np.asarray(actions, float)
    except (TypeError, ValueError) as error:
        raise Error(f"{name} not an array of numbers ({printable(str(error), 200)})") from None
    if values.shape != shape:
        raise Error(f"{name} of the shape {values.shape}; give {shape}")
    if not np.isfinite(values).all():
        raise Error(f"{name} not finite; give -1 to 1")
    return values


def check_options(options: Optional[Dict[str, Any]], known: Sequence[str]) -> Dict[str, Any]:
    """Options of a reset. Unknown options are an error."""
    if options is None:
        return {}
    if not isinstance(options, dict):
        raise Error(f"options are {shown(options)}; give a dict, as {{'rotation_rad': 0.5}}")
    for name in options:
        if name not in known:
            raise Error(f"options have {shown(name)}; {did_you_mean(name, known)}give only {', '.join(known)}")
    return options


def chosen_rotation(options: Dict[str, Any]) -> Optional[float]:
    """Rotation in the options, or None."""
    chosen = options.get("rotation_rad")
    if chosen is None:
        return None
    try:
        return float(chosen)
    except (TypeError, ValueError):
        raise Error(f"rotation_rad is {shown(chosen)}; give a number") from None


def start_rotation(random: np.random.Generator, chosen: Optional[float]) -> float:
    drawn = random.uniform(-math.pi, math.pi)
    return float(drawn) if chosen is None else chosen


def chosen_mask(options: Dict[str, Any], count: int) -> npt.NDArray[np.bool_]:
    """Environments to reset: those of the option "reset_mask", or all."""
    mask = options.get("reset_mask")
    if mask is None:
        return np.ones(count, bool)
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,) or not mask.any():
        raise Error(f"reset_mask is {shown(mask)}; give an array of {count} booleans, at least one of them True")
    return mask


def generator(seed: Optional[int]) -> np.random.Generator:
    return np.random.default_rng(None if seed is None else whole("seed", seed, 0, 2**63 - 1))


# Tasks in the scenes that Torquer ships.
TASKS: Dict[str, Task] = {
    "ty_phantom": Task("side", 40.0),
    "neuro_arch": Task("lcca", 60.0),
    "coronary": Task("lad", 60.0, within_mm=2.0),
}


def task_of(name: str, task: Optional[Task]) -> Task:
    if name not in TASKS:
        raise Error(f"there is no task {shown(name)}; {did_you_mean(name, TASKS)}there are: {', '.join(TASKS)}")
    return TASKS[name] if task is None else task


@dataclasses.dataclass(frozen=True)
class Moment:
    """Argument of a reward and of an end that a user gives: the state after a step."""

    simulation: Simulation
    info: Dict[str, Any]
    """As `info` of a single environment."""
    reward: float
    """Reward of the environment itself."""


Reward = Callable[[Moment], float]
End = Callable[[Moment], bool]


def rewarded(moment: Moment, reward: Optional[Reward], end: Optional[End]) -> Tuple[float, bool]:
    """Reward of a step, and True if the user's end is reached."""
    given: Any = moment.reward if reward is None else reward(moment)
    try:
        number = float(given)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise Error(f"the reward is {shown(given)}; return a finite number")
    return number, end is not None and bool(end(moment))


# Facts of a step that its info has; those before are the values that step() returns.
FIRST_OF_INFO = FACTS.index("success")
INFO = FACTS[FIRST_OF_INFO:]


def info_of(facts: Sequence[float], target: Target) -> Dict[str, Any]:
    """`info` of one environment."""
    info: Dict[str, Any] = dict(zip(INFO, facts[FIRST_OF_INFO:]))
    info["success"] = facts[3] != 0
    info["safe_success"] = None if math.isnan(facts[4]) else facts[4] != 0
    info["target"], info["target_at_mm"] = target
    return info
