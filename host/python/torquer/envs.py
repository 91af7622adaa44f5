"""Environments for reinforcement learning that follow the interface of Gymnasium.

    import torquer.envs

    env = torquer.envs.make("ty_phantom")
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

    many = torquer.envs.VectorEnv("ty_phantom", 64)  # in threads

Gymnasium is optional. With it, its spaces are used, and the environments are gymnasium.Env and
gymnasium.vector.VectorEnv. They are then registered on import:

    gymnasium.make("torquer/NeuroArch-v0", task=task.for_training())
    gymnasium.make_vec("torquer/NeuroArch-v0", num_envs=64)  # a VectorEnv
"""

from __future__ import annotations

from typing import Any, Dict, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene, Simulation, scene_path
from ._anatomies import Anatomies, SceneDraw as SceneDraw, next_seed
from ._names import did_you_mean, shown
from ._navigation import (
    TASKS as TASKS,
    End,
    Moment as Moment,
    Observation,
    Prepared,
    Reward,
    Task as Task,
    action_values,
    check_options,
    chosen_rotation,
    generator,
    info_of,
    rewarded,
    start_rotation,
    task_of,
)
from ._render import Window, WireView
from ._spaces import (
    Box,
    ClosedEnvironmentError as ClosedEnvironmentError,
    CopiedWhole,
    Env,
    gymnasium as gymnasium,
    refuse_closed,
)
from ._vector import VectorEnv as VectorEnv

Array = npt.NDArray[Any]

RENDER_MODES = ["rgb_array", "human"]
_DRAWN = {"torquer/Arches-v0": "torquer.arches", "torquer/Trees-v0": "torquer.trees"}
_STEVE = ("BasicWireNav", "ArchVariety", "DualDeviceNav")


class NavigationEnv(CopiedWhole, Env):  # type: ignore[misc]
    """Moves the tip of an instrument to a place on a centerline.

    Actions: feed and turn of each instrument, -1 .. 1 as fractions of the limits in Task; shape
    (2 * instruments,), float32.

    Observations "vector", float32, in mm unless stated otherwise. They have the last points of the task's instrument,
    the next points of the route, and the target. Points are about 5 mm apart. All of these are relative to the tip of
    that instrument. Then follow the insertions, cosines and sines of the rotations of all instruments. Observations
    "picture": the X-ray picture of [effects.fluoroscopy], shape (height, width, 1), uint8. Observations "tracking",
    float32: column and row of the tip in that picture, of 5 points behind it, 5 mm apart, and of the target. The points
    of the instrument have noise of Task.tracking_noise_px, by the seed. A tuple, as ("vector", "picture"), gives a dict.
    The finite bounds of the space are valid for all motions.

    Reward: progress along the route in mm / 10, -0.01 for each step, +10 at the target. `info` has "success" (the
    target was reached) and "safe_success" (success without a force above the limit). The forces of a step that did not
    converge are not known: "wall_force_mN" is then NaN, and "safe_success" None if it depends on them. `info` also has
    "path_mm" of the tip, "remaining_mm" along the route and "time_s". The "target" is a centerline, with its
    "target_at_mm".

    scene: a scene, its file, or a function of a numpy.random.Generator that returns a scene. Each reset calls the function,
    by the seed. All of its scenes must have the same instruments and the task's centerlines.

    reward: a function of a Moment whose result replaces that reward. end: a function of a Moment. If it returns True,
    the episode has terminated, as at the target.
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 10}

    def __init__(
        self,
        scene: Union[Scene, str, SceneDraw],
        task: Task,
        observation: Observation = "vector",
        render_mode: Optional[str] = None,
        reward: Optional[Reward] = None,
        end: Optional[End] = None,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            near = did_you_mean(render_mode, RENDER_MODES)
            raise Error(f"render_mode is {shown(render_mode)}; {near}give None, 'rgb_array' or 'human'")
        sees = render_mode is not None
        self._anatomies: Optional[Anatomies] = None
        self._next_seed: Optional[int] = None
        if callable(scene):
            self._anatomies = Anatomies(scene, task, observation, sees)
            prepared = self._anatomies.first
        else:
            prepared = Prepared(scene, task, observation, sees)
        self.task = task
        self.observation = observation
        self.render_mode = render_mode
        self.reward = reward
        self.end = end
        self._closed = False
        self._parts = prepared.parts
        self._is_dict = prepared.is_dict
        self._enter(prepared)
        self._window = Window(self.scene.name) if render_mode == "human" else None
        self._random = np.random.default_rng()
        self._target = (task.centerline, float(task.at_mm))
        self._target_mm = prepared.route[-1]
        self._ended = False  # by the user's end
        self.action_space = Box(-1.0, 1.0, (prepared.action_size,), np.float32)
        self.observation_space = prepared.observation_space() if self._anatomies is None else self._anatomies.space

    def __repr__(self) -> str:
        place = f"scene={self.scene.name!r}, target={self._target!r}"
        return f"NavigationEnv({place}, observation={self.observation!r}, time_s={self.simulation.time_s!r})"

    def _enter(self, prepared: Prepared) -> None:
        self._navigation = prepared.navigation
        self._targets = prepared.targets
        self._tracker = prepared.tracker
        self._view = None if prepared.sees or self.render_mode is None else WireView(self.scene)

    def _next_scene(self) -> None:
        """Draws the scene of the next episode."""
        if self._anatomies is not None:
            seed = self._next_seed
            self._enter(self._anatomies.prepare(self._random if seed is None else np.random.default_rng(seed)))

    def __getstate__(self) -> Dict[str, Any]:
        # A window stays with its process.
        return {name: value for name, value in self.__dict__.items() if name != "_window"}

    def __setstate__(self, state: Dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._window = Window(self.scene.name) if self.render_mode == "human" and not self._closed else None

    @property
    def scene(self) -> Scene:
        """Scene with the settings of the task."""
        return self._navigation.simulation.scene

    @property
    def simulation(self) -> Simulation:
        """Simulation of the environment. Only the environment may step it."""
        return self._navigation.simulation

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[Dict[str, Any]] = None
    ) -> Tuple[Any, Dict[str, Any]]:
        """Returns to the start. Options are "rotation_rad", the start rotation of the task's instrument, and "target".
        A target is a pair of a centerline and at_mm from the task's targets. Without them, both are random, by the
        seed."""
        refuse_closed(self._closed, "reset")
        options = check_options(options, ["rotation_rad", "target"])
        chosen = chosen_rotation(options)
        chosen_target = self._targets.chosen(options)
        if chosen is not None:
            self._navigation.check_rotation(chosen)
        if seed is not None or gymnasium is not None and self._np_random is None:
            random = generator(seed)
            if gymnasium is not None:
                super().reset(seed=seed)
            self._random, self._next_seed = random, None
        self._next_scene()
        rotation_rad = start_rotation(self._random, chosen)
        self._target = self._targets.draw(self._random, chosen_target)
        route = self._targets.route(self._target)
        self._target_mm = route[-1]
        if self._anatomies is not None:
            self._next_seed = next_seed(self._random)
        self._navigation.reset(rotation_rad, route)
        self._ended = False
        self._show()
        return self._observe(), info_of(self._navigation.facts, self._target)

    def step(self, action: npt.ArrayLike) -> Tuple[Any, float, bool, bool, Dict[str, Any]]:
        """Moves the hands for Task.step_s. Before a reset, and after the end, this is an error."""
        refuse_closed(self._closed, "step")
        if self._ended:
            raise Error("the episode has ended; call reset() before step()")
        self._navigation.step(action_values(action, self.action_space.shape, "the action is"))
        facts = self._navigation.facts
        info = info_of(facts, self._target)
        reward, self._ended = rewarded(Moment(self.simulation, info, facts[0]), self.reward, self.end)
        self._show()
        terminated = facts[1] != 0 or self._ended
        return self._observe(), reward, terminated, facts[2] != 0 and not terminated, info

    def render(self) -> Optional[Array]:
        """With render_mode "rgb_array": the X-ray picture as RGB, shape (height, width, 3). If the scene has no X-ray,
        it is a view of the wire in the vessel. Mode "human" shows it at each step."""
        refuse_closed(self._closed, "render")
        return self._draw() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Closes the environment, and the window of render_mode "human". After it, reset(), step() and render() raise
        ClosedEnvironmentError. Another close() has no effect."""
        # Gymnasium calls this also for an object that could not be made.
        window: Optional[Window] = getattr(self, "_window", None)
        if window is not None:
            window.close()
        self._window = None
        self._closed = True

    def _draw(self) -> Array:
        if self._view is not None:
            return self._view.draw(self.simulation, self._target_mm)
        return np.repeat(self._navigation.take_picture()[:, :, None], 3, axis=2)

    def _show(self) -> None:
        if self._window is not None:
            self._window.show(self._draw())

    def _observe(self) -> Any:
        taken = {part: self._take(part) for part in self._parts}
        return taken if self._is_dict else taken[self._parts[0]]

    def _take(self, part: str) -> Array:
        if part == "picture":
            picture: Array = self._navigation.take_picture()[:, :, None]
            return picture
        if part == "tracking" and self._tracker is not None:
            return self._tracker.observe(self.simulation, self._target_mm, self._random)
        return self._navigation.observe()


def make(
    name: str,
    observation: Observation = "vector",
    render_mode: Optional[str] = None,
    task: Optional[Task] = None,
    reward: Optional[Reward] = None,
    end: Optional[End] = None,
) -> NavigationEnv:
    """Environment of a task in TASKS, or of another task in the same scene."""
    given = task_of(name, task)
    return NavigationEnv(scene_path(name), given, observation, render_mode, reward, end)


def make_vec(
    name: str,
    num_envs: int = 1,
    observation: Observation = "vector",
    render_mode: Optional[str] = None,
    task: Optional[Task] = None,
    threads: Optional[int] = None,
    copy: bool = True,
    reward: Optional[Reward] = None,
    end: Optional[End] = None,
) -> VectorEnv:
    """VectorEnv of a task in TASKS, or of another task in the same scene."""
    if render_mode is not None:
        raise Error(f"render_mode is {shown(render_mode)}, but a vector of environments renders nothing; leave it out")
    given = task_of(name, task)
    return VectorEnv(scene_path(name), num_envs, threads, observation, given, copy, reward, end)


def register() -> None:
    """Registers each task with Gymnasium, as "torquer/NeuroArch-v0", "torquer/Arches-v0" and "torquer/Trees-v0". So are the tasks of
    torquer.steve, as "torquer/ArchVariety-v0" and "torquer/ArchVarietyRealistic-v0". The import of torquer.envs calls this
    where Gymnasium is installed. A second call has no effect."""
    if gymnasium is None:
        raise Error("gymnasium is not installed; use torquer.envs.make")
    for name in TASKS:
        id = f"torquer/{''.join(part.capitalize() for part in name.split('_'))}-v0"
        if id not in gymnasium.registry:
            gymnasium.register(
                id,
                entry_point="torquer.envs:make",
                vector_entry_point="torquer.envs:make_vec",
                kwargs={"name": name},
            )
    for id, module in _DRAWN.items():
        if id not in gymnasium.registry:
            gymnasium.register(id, entry_point=f"{module}:make", vector_entry_point=f"{module}:make_vec")
    for name in _STEVE:
        for realistic in (False, True):
            id = f"torquer/{name}{'Realistic' if realistic else ''}-v0"
            if id not in gymnasium.registry:
                kwargs = {"name": name, "realistic": realistic}
                gymnasium.register(id, entry_point="torquer.steve:SteveEnv", kwargs=kwargs)


if gymnasium is not None:
    register()
