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

import math
import os
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene, Simulation, scene_path
from ._navigation import (
    INFO,
    Prepared,
    Task as Task,
    check_options,
    chosen_mask,
    chosen_rotation,
    generator,
    start_rotation,
    whole,
)
from ._render import Window, WireView
from ._spaces import Box, Env, VectorEnv as _BaseVectorEnv, gymnasium as gymnasium
from ._torquer import NavigationPool

Array = npt.NDArray[Any]

RENDER_MODES = ["rgb_array", "human"]


class NavigationEnv(Env):  # type: ignore[misc]
    """Moves the tip of an instrument to a place on a centerline.

    Actions: feed and turn of each instrument, -1 .. 1 as fractions of the limits in Task; shape
    (2 * instruments,), float32.

    Observations "vector", float32, in mm unless stated otherwise. They have the last points of the
    task's instrument about 5 mm apart, the next points of the route about 5 mm apart, and the
    target. All of these are relative to the tip of that instrument. Then follow the insertions, cosines and
    sines of the rotations of all instruments. Observations "picture": the X-ray picture of
    [effects.fluoroscopy], shape (height, width, 1), uint8. The finite bounds of the space are valid
    for all motions.

    Reward: progress along the route in mm / 10, -0.01 for each step, +10 at the target. `info` has
    "success" (the target was reached), "safe_success" (and no force was above the limit; None if
    forces that did not converge decide it), "wall_force_mN", "path_mm" of the tip, "remaining_mm" along the route, and "time_s".
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 10}

    def __init__(
        self,
        scene: Union[Scene, str],
        task: Task,
        observation: str = "vector",
        render_mode: Optional[str] = None,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise Error(f"render_mode is {render_mode!r}; give None, 'rgb_array' or 'human'")
        prepared = Prepared(scene, task, observation, render_mode is not None)
        self.scene = prepared.scene
        self.task = task
        self.observation = observation
        self.render_mode = render_mode
        self._navigation = prepared.navigation
        self._view = None if prepared.sees or render_mode is None else WireView(self.scene, prepared.route[-1])
        self._window = Window(self.scene.name) if render_mode == "human" else None
        self._random = np.random.default_rng()
        self.action_space = Box(-1.0, 1.0, (prepared.action_size,), np.float32)
        self.observation_space = prepared.observation_space(observation)

    @property
    def simulation(self) -> Simulation:
        """Simulation of the environment. Only the environment may step it."""
        return self._navigation.simulation

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[Dict[str, Any]] = None
    ) -> Tuple[Array, Dict[str, Any]]:
        """Returns to the start. options: "rotation_rad", that of the task's instrument at the start.
        Without it the rotation is random, by the seed."""
        chosen = chosen_rotation(check_options(options, ["rotation_rad"]))
        if chosen is not None:
            self._navigation.check_rotation(chosen)
        if seed is not None or gymnasium is not None and self._np_random is None:
            random = generator(seed)
            if gymnasium is not None:
                super().reset(seed=seed)
            self._random = random
        self._navigation.reset(start_rotation(self._random, chosen))
        self._show()
        return self._observe(), self._info(self._navigation.facts)

    def step(self, action: npt.ArrayLike) -> Tuple[Array, float, bool, bool, Dict[str, Any]]:
        """Moves the hands for Task.step_s. Before a reset, and after the end, this is an error."""
        self._navigation.step(action)
        facts = self._navigation.facts
        self._show()
        return self._observe(), facts[0], facts[1] != 0, facts[2] != 0, self._info(facts)

    def render(self) -> Optional[Array]:
        """With render_mode "rgb_array": the X-ray picture as RGB, shape (height, width, 3), or a view
        of the wire in the vessel if the scene has no X-ray. "human" shows it at each step."""
        return self._draw() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Closes the window of render_mode "human"."""
        # Gymnasium calls this also for an object that could not be made.
        window: Optional[Window] = getattr(self, "_window", None)
        if window is not None:
            window.close()
        self._window = None

    def _draw(self) -> Array:
        if self._view is not None:
            return self._view.draw(self._navigation.simulation)
        return np.repeat(self._navigation.take_picture()[:, :, None], 3, axis=2)

    def _show(self) -> None:
        if self._window is not None:
            self._window.show(self._draw())

    def _observe(self) -> Array:
        if self.observation == "picture":
            picture: Array = self._navigation.take_picture()[:, :, None]
            return picture
        return self._navigation.observe()

    @staticmethod
    def _info(facts: List[float]) -> Dict[str, Any]:
        info: Dict[str, Any] = dict(zip(INFO, facts[3:]))
        info["success"] = facts[3] != 0
        info["safe_success"] = None if math.isnan(facts[4]) else facts[4] != 0
        return info


# Tasks in the scenes that Torquer ships.
TASKS: Dict[str, Task] = {
    "ty_phantom": Task("side", 40.0),
    "neuro_arch": Task("lcca", 60.0),
    "coronary": Task("lad", 60.0, within_mm=2.0),
}


def _task(name: str, task: Optional[Task]) -> Task:
    if name not in TASKS:
        raise Error(f"there is no task {name!r}; there are: {', '.join(TASKS)}")
    return TASKS[name] if task is None else task


def make(
    name: str,
    observation: str = "vector",
    render_mode: Optional[str] = None,
    task: Optional[Task] = None,
) -> NavigationEnv:
    """Environment of a task in TASKS, or of another task in the same scene."""
    return NavigationEnv(scene_path(name), _task(name, task), observation, render_mode)


def make_vec(
    name: str,
    num_envs: int = 1,
    observation: str = "vector",
    render_mode: Optional[str] = None,
    task: Optional[Task] = None,
    threads: Optional[int] = None,
    copy: bool = True,
) -> VectorEnv:
    """VectorEnv of a task in TASKS, or of another task in the same scene."""
    if render_mode is not None:
        raise Error(f"render_mode is {render_mode!r}, but a vector of environments renders nothing; leave it out")
    return VectorEnv(scene_path(name), num_envs, threads, observation, _task(name, task), copy)


class VectorEnv(_BaseVectorEnv):  # type: ignore[misc]
    """Many environments of one task that step in threads, with the interface of gymnasium.vector.

    Each gives the same as a NavigationEnv with the same seed and actions, bit for bit, for any
    number of threads. The step after the end of an episode only resets its environment, ignores the
    action, and gives the reward 0 (Gymnasium's autoreset mode NEXT_STEP). `info` has arrays. Where
    "_safe_success" is False, "safe_success" is not known.

    step() is send() and recv(), which may be called separately. send() starts some of the
    environments, and recv() returns those that finish first, while the others go on.
    """

    metadata = {"render_modes": [], "autoreset_mode": "NextStep"}
    render_mode = None
    spec = None

    def __init__(
        self,
        name: Union[str, Scene],
        count: int,
        threads: Optional[int] = None,
        observation: str = "vector",
        task: Optional[Task] = None,
        copy: bool = True,
    ) -> None:
        """name: one of TASKS; or, with a task, a scene or its file. threads: one for each core by
        default. copy: True: observations of all environments are copies. False: the next step
        overwrites them."""
        count = whole("count", count, 1, 100_000)
        if threads is not None:
            threads = whole("threads", threads, 1, 1024)
        if task is None:
            if name not in TASKS:
                raise Error(f"there is no task {name!r}; there are: {', '.join(TASKS)}; or give a task")
            task = TASKS[str(name)]
            name = scene_path(str(name))
        prepared = Prepared(name, task, observation, False)
        self.scene = prepared.scene
        self.task = task
        self.num_envs = count
        self.copy = copy
        self.single_observation_space = prepared.observation_space(observation)
        self.single_action_space = Box(-1.0, 1.0, (prepared.action_size,), np.float32)
        single = self.single_observation_space
        self.observation_space = Box(
            np.broadcast_to(single.low, (count, *single.shape)),
            np.broadcast_to(single.high, (count, *single.shape)),
            dtype=single.dtype,
        )
        self.action_space = Box(-1.0, 1.0, (count, prepared.action_size), np.float32)
        # Gymnasium has these modes since 1.1.
        modes = getattr(getattr(gymnasium, "vector", None), "AutoresetMode", None)
        if modes is not None:
            self.metadata = {**self.metadata, "autoreset_mode": modes.NEXT_STEP}
        self._observations = np.zeros((count, *single.shape), single.dtype)
        self._facts = np.zeros((3 + len(INFO), count))
        self._begun = False  # True after the first reset
        self._ended = np.zeros(count, bool)
        self._at_work = np.zeros(count, bool)
        self._randoms = [np.random.default_rng() for _ in range(count)]
        cores = len(os.sched_getaffinity(0))
        self._pool = NavigationPool(
            self.scene, prepared.task, count, threads or cores, self._facts, self._observations
        )

    def reset(
        self,
        *,
        seed: Union[None, int, Sequence[Optional[int]]] = None,
        options: Optional[Dict[str, Any]] = None,
    ) -> Tuple[Array, Dict[str, Any]]:
        """Returns all to the start. seed: that of the first, one more for each next; or one for each.
        options: as in NavigationEnv.reset; and "reset_mask", an array of booleans: only those
        environments return to the start."""
        if self._at_work.any():
            raise Error("environments are running; call recv() before reset()")
        seeds: Sequence[Optional[int]]
        if seed is None:
            seeds = [None] * self.num_envs
        elif isinstance(seed, (list, tuple, np.ndarray)):
            seeds = seed
        else:
            first = whole("seed", seed, 0, 2**63 - 1 - self.num_envs)
            seeds = [first + k for k in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise Error(f"there are {len(seeds)} seeds; give {self.num_envs}, or one")
        # Checks all arguments before the first environment begins.
        options = check_options(options, ["rotation_rad", "reset_mask"])
        mask = chosen_mask(options, self.num_envs)
        if not self._begun and not mask.all():
            raise Error("the environments have not begun; call reset() without reset_mask first")
        chosen = chosen_rotation(options)
        if chosen is not None:
            self._pool.check_rotation(chosen)
        made = [None if one is None else generator(one) for one in seeds]
        for k in np.flatnonzero(mask):
            self._randoms[k] = self._randoms[k] if made[k] is None else made[k]
            self._pool.reset(int(k), start_rotation(self._randoms[k], chosen))
            self._at_work[k] = True
        self._begun = True
        self.recv()
        observations, _, _, _, info = self._results(np.arange(self.num_envs))
        return observations, info

    def step(self, actions: npt.ArrayLike) -> Tuple[Array, Array, Array, Array, Dict[str, Any]]:
        """Moves the hands of all for Task.step_s."""
        self.send(actions)
        return self.recv()

    def send(self, actions: npt.ArrayLike, ids: Optional[npt.ArrayLike] = None) -> None:
        """Starts a step of the environments `ids`, or of all, and returns at once. Before the first
        reset() this is an error."""
        try:
            which = np.arange(self.num_envs) if ids is None else np.asarray(ids).ravel()
            rows = np.asarray(actions, float)
        except (TypeError, ValueError) as error:
            raise Error(f"actions or ids are no array of numbers ({error})") from None
        if which.dtype.kind not in "iu" and len(which) > 0:
            raise Error(f"ids are {which.tolist()}; give whole numbers, 0 to {self.num_envs - 1}")
        which = which.astype(int)
        shape = (len(which), *self.single_action_space.shape)
        if rows.shape != shape:
            raise Error(f"actions have the shape {rows.shape}; give {shape}")
        if not np.isfinite(rows).all():
            raise Error("actions hold a number that is not finite; give -1 to 1")
        if len(np.unique(which)) != len(which) or ((which < 0) | (which >= self.num_envs)).any():
            raise Error(f"ids are {which.tolist()}; give each once, 0 to {self.num_envs - 1}")
        if not self._begun:
            raise Error("the environments have not begun; call reset() before step() or send()")
        if self._at_work[which].any():
            raise Error("an environment is running already; call recv() before the next send()")
        ended = self._ended[which]
        self._pool.step(which[~ended], rows[~ended])
        for k in which[ended]:
            self._pool.reset(int(k), start_rotation(self._randoms[k], None))
        self._at_work[which] = True

    def recv(self, count: Optional[int] = None) -> Tuple[Array, Array, Array, Array, Dict[str, Any]]:
        """Results of the `count` that finish first, or of all that are at work: observations,
        rewards, terminated, truncated and info, in the order of info["env_id"]. If one of them
        fails, this waits for all, and raises the error."""
        if not self._at_work.any():
            raise Error("no environment is running; call send() with actions first")
        if count is not None:
            count = whole("count", count, 1, 2**31 - 1)
        try:
            ids = np.sort(np.array(self._pool.wait(self.num_envs if count is None else count), int))
        except Error:
            self._wait_for_all()
            raise
        self._at_work[ids] = False
        return self._results(ids)

    def _results(self, ids: Array) -> Tuple[Array, Array, Array, Array, Dict[str, Any]]:
        facts = self._facts[:, ids]
        everything = len(ids) == self.num_envs
        observations = self._observations if everything and not self.copy else self._observations[ids]
        info: Dict[str, Any] = dict(zip(INFO, facts[3:]))
        info["success"] = facts[3] != 0
        info["safe_success"] = facts[4] == 1
        # Gymnasium's mask: False where the value is not known.
        info["_safe_success"] = ~np.isnan(facts[4])
        info["env_id"] = ids
        terminated, truncated = facts[1] != 0, facts[2] != 0
        self._ended[ids] = terminated | truncated
        return observations, facts[0], terminated, truncated, info

    def close(self, **_: Any) -> None:
        """Waits for those at work. Gymnasium calls it also for an object that could not be made."""
        if hasattr(self, "_pool"):
            self._wait_for_all()
        self.closed = True

    def _wait_for_all(self) -> None:
        while self._pool.at_work > 0:
            try:
                self._pool.wait(self.num_envs)
            except Error:
                pass
        self._at_work[:] = False


def register() -> None:
    """Registers each task with Gymnasium, as "torquer/NeuroArch-v0". The import of torquer.envs calls
    this where Gymnasium is installed. A second call changes nothing."""
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


if gymnasium is not None:
    register()
