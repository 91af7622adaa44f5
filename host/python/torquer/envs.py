"""Environments for reinforcement learning that follow the interface of Gymnasium.

    import torquer.envs

    env = torquer.envs.make("ty_phantom")
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

Where gymnasium is installed its spaces are used, the environments are gymnasium.Env, and
register() makes them known to gymnasium.make as "torquer/NAME-v0". It is not needed.
"""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any, Dict, List, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene, Simulation, scene_path

try:
    import gymnasium  # type: ignore[import]

    _Env: Any = gymnasium.Env
    _Box: Any = gymnasium.spaces.Box
except ImportError:
    gymnasium = None

    class _PlainBox:
        """What of gymnasium.spaces.Box the environments and simple agents use."""

        def __init__(
            self, low: Any, high: Any, shape: Optional[Tuple[int, ...]] = None, dtype: Any = None
        ) -> None:
            self.dtype = np.dtype(dtype or np.float32)
            self.shape = tuple(np.shape(low)) if shape is None else shape
            self.low = np.broadcast_to(np.asarray(low, self.dtype), self.shape)
            self.high = np.broadcast_to(np.asarray(high, self.dtype), self.shape)
            self._random = np.random.default_rng()

        def seed(self, seed: Optional[int] = None) -> None:
            self._random = np.random.default_rng(seed)

        def sample(self) -> npt.NDArray[Any]:
            if self.dtype == np.uint8:
                return self._random.integers(0, 256, self.shape, dtype=np.uint8)
            low = np.maximum(self.low, -1e6)
            high = np.minimum(self.high, 1e6)
            return self._random.uniform(low, high).astype(self.dtype)

        def contains(self, x: Any) -> bool:
            return bool(
                isinstance(x, np.ndarray)
                and x.dtype == self.dtype
                and x.shape == self.shape
                and (x >= self.low).all()
                and (x <= self.high).all()
            )

    _Env = object
    _Box = _PlainBox

Array = npt.NDArray[Any]

# How many points of the wire, from its tip, and of the route, from the nearest on, a vector shows.
_WIRE_POINTS = 4
_ROUTE_POINTS = 4


def _for_training(text: str, tolerance: float) -> str:
    """The text of a scene with that tolerance, and with an observer of the wall's force."""
    lines = text.splitlines()
    kept: List[str] = []
    section = ""
    for line in lines:
        if line.startswith("["):
            section = line
        if section == "[relaxation]" and re.match(r"tolerance\s*=", line):
            continue
        kept.append(line)
        if line == "[relaxation]":
            kept.append(f"tolerance = {tolerance!r}")
    if "[relaxation]" not in kept:
        kept += ["", "[relaxation]", f"tolerance = {tolerance!r}"]
    if "[effects.wall_force]" not in kept:
        kept += ["", "[effects.wall_force]", "threshold_mN = 100.0"]
    return "\n".join(kept) + "\n"



@dataclasses.dataclass(frozen=True)
class Task:
    """Where the tip of an instrument has to go, and how fast hands may go there."""

    centerline: str
    at_mm: float
    within_mm: float = 3.0
    instrument: int = 0
    step_s: float = 0.1
    longest_mm: float = 2.0
    """Of the motion of one step."""
    largest_turn_rad: float = 0.5
    """The same."""
    force_limit_mN: float = math.inf
    """Of a patch of the wall; above it no success is safe."""
    max_steps: int = 400
    tolerance: float = 1e-4
    """To which a step is relaxed; a scene that is simulated for its own sake takes 1e-6."""


class NavigationEnv(_Env):  # type: ignore[misc]
    """The tip of an instrument goes to a place on a centerline.

    Actions: of each instrument its feed and its turn, -1 .. 1 of what Task allows in a step; shape
    (2 * instruments,), float32.

    Observations "vector", float32, in mm unless said otherwise: for the instrument of the task the
    last points of the wire about 5 mm apart, the next points of the route about 5 mm apart and the
    target, all from the tip on; then of each instrument its insertion and the cosine and sine of
    its rotation. "picture": the X-ray of the scene's [effects.fluoroscopy], shape (height, width,
    1), uint8.

    Reward: the way gained along the route in mm / 10, -0.01 a step, +10 at the target. `info` keeps
    apart "success" (the target was reached) and "safe_success" (and no force was above the limit),
    "wall_force_mN", the "path_mm" that the tip went, "remaining_mm" along the route and "time_s".
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        scene: Union[Scene, str],
        task: Task,
        observation: str = "vector",
        render_mode: Optional[str] = None,
    ) -> None:
        if observation not in ("vector", "picture"):
            raise Error(f"observation is {observation!r}; give 'vector' or 'picture'")
        if render_mode not in (None, "rgb_array"):
            raise Error(f"render_mode is {render_mode!r}; give None or 'rgb_array'")
        given = scene if isinstance(scene, Scene) else Scene(scene)
        self.scene = Scene.from_text(_for_training(given.text, task.tolerance), given.folder)
        if not 0 <= task.instrument < len(self.scene.instruments):
            raise Error(f"instrument is {task.instrument}; the scene has {len(self.scene.instruments)}")
        if (observation == "picture" or render_mode) and "fluoroscopy" not in self.scene.effects:
            raise Error(f"{self.scene.name} makes no pictures; add [effects.fluoroscopy]")
        self.task = task
        self.observation = observation
        self.render_mode = render_mode
        self._route = self.scene.route_mm(task.centerline, task.at_mm, 1.0)
        self._target = self._route[-1]
        self._simulation = Simulation(self.scene)
        self._start = self._simulation.copy()
        self._random = np.random.default_rng()
        count = len(self.scene.instruments)
        self.action_space = _Box(-1.0, 1.0, (2 * count,), np.float32)
        if observation == "vector":
            size = 3 * (_WIRE_POINTS + _ROUTE_POINTS + 1) + 3 * count
            self.observation_space = _Box(-np.inf, np.inf, (size,), np.float32)
        else:
            height, width = self._take_picture().shape
            self.observation_space = _Box(0, 255, (height, width, 1), np.uint8)
        self._steps = self._nearest = 0
        self._path_mm = self._worst_mN = self._force_mN = 0.0
        self._remaining_mm = self._before_mm = 0.0
        self._success = False
        self._last_tip: Array = self._tip()
        self._begin()

    @property
    def simulation(self) -> Simulation:
        """What the environment steps. Step it by the environment alone."""
        return self._simulation

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[Dict[str, Any]] = None
    ) -> Tuple[Array, Dict[str, Any]]:
        """Back to the start. options: "rotation_rad", of the task's instrument before it begins;
        without it, any rotation, by the seed."""
        if seed is not None or gymnasium is not None and self._np_random is None:
            if gymnasium is not None:
                super().reset(seed=seed)
            self._random = np.random.default_rng(seed)
        self._simulation.restore(self._start)
        rotation = (options or {}).get("rotation_rad", self._random.uniform(-math.pi, math.pi))
        hands = self._simulation.hands
        hands[self.task.instrument, 1] += rotation
        self._simulation.step(self.task.step_s, hands, xray=self._sees)
        self._begin()
        return self._observe(), self._info()

    def step(self, action: npt.ArrayLike) -> Tuple[Array, float, bool, bool, Dict[str, Any]]:
        """Moves the hands for Task.step_s."""
        task = self.task
        motion = np.clip(np.asarray(action, float).reshape(-1, 2), -1, 1)
        hands = self._simulation.hands
        hands[:, 0] = np.maximum(0, hands[:, 0] + task.longest_mm * motion[:, 0])
        hands[:, 1] += task.largest_turn_rad * motion[:, 1]
        self._simulation.step(self._simulation.time_s + task.step_s, hands, xray=self._sees)
        self._steps += 1
        tip = self._tip()
        self._path_mm += float(np.linalg.norm(tip - self._last_tip))
        self._last_tip = tip
        self._find_on_route(tip)
        self._force_mN = self._find_force()
        self._worst_mN = max(self._worst_mN, self._force_mN)
        terminated = bool(np.linalg.norm(tip - self._target) <= task.within_mm)
        truncated = not terminated and self._steps >= task.max_steps
        gained = self._before_mm - self._remaining_mm
        self._before_mm = self._remaining_mm
        reward = gained / 10 - 0.01 + (10.0 if terminated else 0.0)
        self._success = terminated
        return self._observe(), float(reward), terminated, truncated, self._info()

    def render(self) -> Optional[Array]:
        """The X-ray picture as rgb, shape (height, width, 3)."""
        if self.render_mode is None:
            return None
        return np.repeat(self._take_picture()[:, :, None], 3, axis=2)

    def close(self) -> None:
        """Nothing is kept open."""

    @property
    def _sees(self) -> bool:
        return self.observation == "picture" or self.render_mode is not None

    def _begin(self) -> None:
        self._steps = 0
        self._path_mm = 0.0
        self._worst_mN = 0.0
        self._force_mN = self._find_force()
        self._success = False
        self._nearest = 0
        self._last_tip = self._tip()
        self._find_on_route(self._last_tip, everywhere=True)
        self._before_mm = self._remaining_mm

    def _tip(self) -> Array:
        tip: Array = self._simulation.tips_mm[self.task.instrument]
        return tip

    def _find_on_route(self, tip: Array, everywhere: bool = False) -> None:
        # Near where it was: a route may pass the same place twice.
        reach = len(self._route) if everywhere else 30
        first = max(0, self._nearest - reach)
        part = self._route[first : self._nearest + reach + 1]
        squared = np.einsum("ij,ij->i", part - tip, part - tip)
        at = int(squared.argmin())
        self._nearest = first + at
        self._remaining_mm = len(self._route) - 1 - self._nearest + math.sqrt(squared[at])

    def _find_force(self) -> float:
        return self._simulation.readings()["wall_force_largest_mN"]

    def _take_picture(self) -> Array:
        picture = self._simulation.picture()
        if picture is None:
            simulation = self._simulation.copy()
            simulation.step(simulation.time_s + 1e-3, simulation.hands, xray=True)
            picture = simulation.picture()
        assert picture is not None
        return picture

    def _observe(self) -> Array:
        if self.observation == "picture":
            picture: Array = self._take_picture()[:, :, None]
            return picture
        tip = self._tip()
        nodes = self._simulation.nodes_mm
        # Where hardly any wire is in, its points are those at the entry.
        segment_mm = float(np.linalg.norm(nodes[-1] - nodes[-2])) if len(nodes) > 2 else 5.0
        every = round(5 / segment_mm)
        back = np.maximum(0, len(nodes) - 1 - every * np.arange(1, _WIRE_POINTS + 1))
        ahead = np.minimum(len(self._route) - 1, self._nearest + 5 * np.arange(1, _ROUTE_POINTS + 1))
        places = self._simulation.places
        vector: Array = np.concatenate(
            [
                (nodes[back] - tip).ravel(),
                (self._route[ahead] - tip).ravel(),
                self._target - tip,
                places[:, 0],
                np.cos(places[:, 1]),
                np.sin(places[:, 1]),
            ]
        ).astype(np.float32)
        return vector

    def _info(self) -> Dict[str, Any]:
        return {
            "success": self._success,
            "safe_success": self._success and self._worst_mN <= self.task.force_limit_mN,
            "wall_force_mN": self._force_mN,
            "path_mm": self._path_mm,
            "remaining_mm": self._remaining_mm,
            "time_s": self._simulation.time_s,
        }


# Tasks in the scenes that Torquer ships.
TASKS: Dict[str, Task] = {
    "ty_phantom": Task("side", 40.0),
    "neuro_arch": Task("lcca", 60.0),
    "coronary": Task("lad", 60.0, within_mm=2.0),
}


def make(
    name: str, observation: str = "vector", render_mode: Optional[str] = None
) -> NavigationEnv:
    """The task of a scene that Torquer ships: one of TASKS."""
    if name not in TASKS:
        raise Error(f"there is no task {name!r}; there are: {', '.join(TASKS)}")
    return NavigationEnv(scene_path(name), TASKS[name], observation, render_mode)


def register() -> None:
    """Makes the tasks known to gymnasium.make as "torquer/NAME-v0". Needs gymnasium."""
    if gymnasium is None:
        raise Error("gymnasium is not installed; use torquer.envs.make")
    for name in TASKS:
        gymnasium.register(f"torquer/{name}-v0", make, kwargs={"name": name})
