"""Many environments of one task that step in threads."""

from __future__ import annotations

import os
from concurrent.futures import Future, ThreadPoolExecutor, wait
from copy import deepcopy
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene, scene_path
from ._anatomies import Anatomies, SceneDraw, next_seed
from ._names import did_you_mean, shown
from ._navigation import (
    FIRST_OF_INFO,
    INFO,
    TASKS,
    End,
    Moment,
    Observation,
    Prepared,
    Reward,
    Target,
    Task,
    action_values,
    check_options,
    chosen_mask,
    chosen_rotation,
    generator,
    info_of,
    rewarded,
    start_rotation,
    whole,
)
from ._spaces import Box, CopiedWhole, DictSpace, VectorEnv as _BaseVectorEnv, gymnasium, refuse_closed
from ._torquer import FACTS, NavigationPool, printable

Array = npt.NDArray[Any]


class VectorEnv(CopiedWhole, _BaseVectorEnv):  # type: ignore[misc]
    """Many environments of one task that step in threads, with the interface of gymnasium.vector.

    Each equals a NavigationEnv with the same seed and actions bit for bit, for any number of threads. The step after
    the end of an episode only resets its environment. It ignores the action, and gives the reward 0 (Gymnasium's
    autoreset mode NEXT_STEP). `info` has arrays. If "_safe_success" is False, "safe_success" is unknown.

    A step() is send() and recv(), which may be called separately. With send() some of the environments start. With
    recv() those that finish first return, while the others go on.
    """

    metadata = {"render_modes": [], "autoreset_mode": "NextStep"}
    render_mode = None
    spec = None
    closed = False

    def __init__(
        self,
        name: Union[str, Scene, SceneDraw],
        count: int,
        threads: Optional[int] = None,
        observation: Observation = "vector",
        task: Optional[Task] = None,
        copy: bool = True,
        reward: Optional[Reward] = None,
        end: Optional[End] = None,
    ) -> None:
        """name: one of TASKS; or, with a task, a scene, its file, or a function of a numpy.random.Generator that returns a
        scene. As in NavigationEnv, each reset of an environment calls that function, by the seed. The scene of the next
        episode is prepared in a thread of Python during this one. threads: one for each core by default. copy: True: observations of all environments are copies. False: the next step
        overwrites them. observation, reward, end: as in NavigationEnv. The functions are called in the thread that
        calls recv() or step(), for one environment after the other."""
        count = whole("count", count, 1, 100_000)
        if threads is not None:
            threads = whole("threads", threads, 1, 1024)
        if task is None:
            if not isinstance(name, str) or name not in TASKS:
                near = did_you_mean(name, TASKS)
                raise Error(f"there is no task {shown(name)}; {near}there are: {', '.join(TASKS)}; or give a task")
            task = TASKS[str(name)]
            name = scene_path(str(name))
        self._anatomies: Optional[Anatomies] = None
        if callable(name):
            self._anatomies = Anatomies(name, task, observation, False)
            prepared = self._anatomies.first
        else:
            prepared = Prepared(name, task, observation, False)
        self.scene = prepared.scene
        self.task = task
        self.num_envs = count
        self.copy = copy
        self.observation = observation
        self.threads = threads
        self.reward = reward
        self.end = end
        self._targets = [prepared.targets] * count
        self._target = [(task.centerline, float(task.at_mm))] * count
        self._target_mm = [prepared.route[-1]] * count
        self._tracker = prepared.tracker
        self._is_dict = prepared.is_dict
        own_space = prepared.observation_space() if self._anatomies is None else self._anatomies.space
        self.single_observation_space = own_space
        self.single_action_space = Box(-1.0, 1.0, (prepared.action_size,), np.float32)
        single = self.single_observation_space if self._is_dict else {prepared.parts[0]: self.single_observation_space}
        spaces = {
            part: Box(
                np.broadcast_to(single[part].low, (count, *single[part].shape)),
                np.broadcast_to(single[part].high, (count, *single[part].shape)),
                dtype=single[part].dtype,
            )
            for part in prepared.parts
        }
        self.observation_space = DictSpace(spaces) if self._is_dict else spaces[prepared.parts[0]]
        self.action_space = Box(-1.0, 1.0, (count, prepared.action_size), np.float32)
        # Gymnasium has these modes since 1.1.
        modes = getattr(getattr(gymnasium, "vector", None), "AutoresetMode", None)
        if modes is not None:
            self.metadata = {**self.metadata, "autoreset_mode": modes.NEXT_STEP}
        self._observations = {part: np.zeros(space.shape, space.dtype) for part, space in spaces.items()}
        self._facts = np.zeros((len(FACTS), count))
        self._begun = False  # True after the first reset
        self._ended = np.zeros(count, bool)
        self._resets = np.ones(count, bool)  # True: the present results are those of a reset
        self._at_work = np.zeros(count, bool)
        self._randoms = [np.random.default_rng() for _ in range(count)]
        self._next_seeds: List[Optional[int]] = [None] * count
        self._ahead: Dict[int, Future[Prepared]] = {}  # scenes of next episodes
        threads = threads or len(os.sched_getaffinity(0))
        self._preparing = None if self._anatomies is None else ThreadPoolExecutor(threads)
        self._pool = NavigationPool(
            self.scene,
            prepared.task,
            count,
            threads,
            self._facts,
            self._observations.get("vector"),
            self._observations.get("picture"),
        )

    _MADE_WITH = ("_given", "num_envs", "threads", "observation", "task", "copy", "reward", "end")
    _MEMORY = ("_begun", "_ended", "_resets", "_randoms", "_target", "_target_mm", "_targets", "_next_seeds")

    @property
    def _given(self) -> Union[Scene, SceneDraw]:
        return self.scene if self._anatomies is None else self._anatomies.draw

    @property
    def scenes(self) -> List[Scene]:
        """Scenes of the present episodes. They are those of `scene`, unless each reset draws another one."""
        return [self._pool.environment(k).simulation.scene for k in range(self.num_envs)]

    def __repr__(self) -> str:
        return f"VectorEnv(scene={self.scene.name!r}, num_envs={self.num_envs}, observation={self.observation!r})"

    def __getstate__(self) -> Dict[str, Any]:
        if self._at_work.any():
            raise Error("environments are running; call recv() before you pickle or copy them")
        return {
            "made_with": [getattr(self, name) for name in self._MADE_WITH],
            "memory": {name: getattr(self, name) for name in self._MEMORY},
            "facts": self._facts,
            "observations": self._observations,
            "environments": [] if self.closed else [self._saved(k) for k in range(self.num_envs)],
            "closed": self.closed,
        }

    def __setstate__(self, state: Dict[str, Any]) -> None:
        name, count, threads, observation, task, *others = state["made_with"]
        self.__init__(name, count, threads, observation, task, *others)  # type: ignore[misc]
        self.__dict__.update(state["memory"])
        for k, saved in enumerate(state["environments"]):
            if self._anatomies is None:
                self._pool.load(k, saved)
            else:
                self._pool.exchange(k, saved)
                self._prepare_next(k)
        self._facts[:] = state["facts"]
        for part, values in state["observations"].items():
            self._observations[part][:] = values
        if state["closed"]:
            self.close()

    def _saved(self, k: int) -> Any:
        return deepcopy(self._pool.environment(k)) if self._anatomies is not None else self._pool.save(k)

    def reset(
        self,
        *,
        seed: Union[None, int, Sequence[Optional[int]]] = None,
        options: Optional[Dict[str, Any]] = None,
    ) -> Tuple[Any, Dict[str, Any]]:
        """Returns all to the start. seed: seed of the first environment, one more for each next; or a list with one for
        each.
        options: as in NavigationEnv.reset; and "reset_mask", an array of booleans: only those
        environments return to the start."""
        refuse_closed(self.closed, "reset")
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
        options = check_options(options, ["rotation_rad", "target", "reset_mask"])
        mask = chosen_mask(options, self.num_envs)
        if not self._begun and not mask.all():
            raise Error("the environments have not begun; call reset() without reset_mask first")
        chosen = chosen_rotation(options)
        chosen_target = self._targets[0].chosen(options)
        if chosen is not None:
            self._pool.check_rotation(chosen)
        made = [None if one is None else generator(one) for one in seeds]
        which = np.flatnonzero(mask).tolist()
        prepared = self._prepared(which, {k: made[k] for k in which})
        for k in which:
            self._randoms[k] = made[k] or self._randoms[k]
            self._start(k, chosen, chosen_target, prepared.get(k))
        self._begun = True
        self._ended[mask] = False
        self._wait(None)
        observations, _, _, _, info = self._results(np.arange(self.num_envs))
        return observations, info

    def _prepared(self, which: Sequence[int], seeded: Dict[int, Optional[np.random.Generator]]) -> Dict[int, Prepared]:
        """Next scenes of these environments, if each reset draws one. seeded: new generators, which draw them."""
        if self._anatomies is None or self._preparing is None:
            return {}
        self._pool.require_own_process()
        coming = {}
        for k in which:
            random = seeded.get(k)
            if random is None and k in self._ahead:
                coming[k] = self._ahead[k]
            else:
                coming[k] = self._preparing.submit(self._anatomies.prepare, random or self._randoms[k])
        wait(coming.values())
        return {k: one.result() for k, one in coming.items()}

    def _prepare_next(self, k: int) -> None:
        seed = self._next_seeds[k]
        if self._anatomies is not None and self._preparing is not None and seed is not None:
            self._ahead[k] = self._preparing.submit(self._anatomies.prepare, np.random.default_rng(seed))

    def _start(
        self, k: int, rotation_rad: Optional[float], target: Optional[Target], prepared: Optional[Prepared]
    ) -> None:
        """Starts a reset of one environment, in a scene that was prepared, or in the same as before."""
        if prepared is not None:
            self._pool.exchange(k, prepared.navigation)
            self._targets[k] = prepared.targets
        rotation_rad = start_rotation(self._randoms[k], rotation_rad)
        self._target[k] = self._targets[k].draw(self._randoms[k], target)
        route = self._targets[k].route(self._target[k])
        self._target_mm[k] = route[-1]
        if prepared is not None:
            self._next_seeds[k] = next_seed(self._randoms[k])
            self._prepare_next(k)
        self._pool.reset(k, rotation_rad, route)
        self._at_work[k] = self._resets[k] = True

    def step(self, actions: npt.ArrayLike) -> Tuple[Any, Array, Array, Array, Dict[str, Any]]:
        """Moves the hands of all for Task.step_s."""
        refuse_closed(self.closed, "step")
        self.send(actions)
        return self.recv()

    def send(self, actions: npt.ArrayLike, ids: Optional[npt.ArrayLike] = None) -> None:
        """Starts a step of the environments `ids`, or of all, and returns at once. Before the first
        reset() this is an error."""
        refuse_closed(self.closed, "send")
        try:
            which = np.arange(self.num_envs) if ids is None else np.asarray(ids).ravel()
        except (TypeError, ValueError) as error:
            raise Error(f"ids are not an array of numbers ({printable(str(error), 200)})") from None
        if which.dtype.kind not in "iu" and len(which) > 0:
            raise Error(f"ids are {shown(which.tolist())}; give whole numbers, 0 to {self.num_envs - 1}")
        which = which.astype(int)
        rows = action_values(actions, (len(which), *self.single_action_space.shape), "actions are")
        if len(np.unique(which)) != len(which) or ((which < 0) | (which >= self.num_envs)).any():
            raise Error(f"ids are {shown(which.tolist())}; give each once, 0 to {self.num_envs - 1}")
        if not self._begun:
            raise Error("the environments have not begun; call reset() before step() or send()")
        if self._at_work[which].any():
            raise Error("an environment is running already; call recv() before the next send()")
        ended = self._ended[which]
        prepared = self._prepared(which[ended].tolist(), {})
        self._pool.step(which[~ended], rows[~ended])
        self._at_work[which] = True
        self._resets[which] = False
        for k in which[ended].tolist():
            self._start(k, None, None, prepared.get(k))

    def recv(self, count: Optional[int] = None) -> Tuple[Any, Array, Array, Array, Dict[str, Any]]:
        """Results of the `count` environments that finish first, or of all that are at work. They are observations,
        rewards, terminated, truncated and info, in the order of info["env_id"]. If an environment fails, this waits for
        all, and raises the error."""
        refuse_closed(self.closed, "recv")
        if not self._at_work.any():
            raise Error("no environment is running; call send() with actions first")
        if count is not None:
            count = whole("count", count, 1, 2**31 - 1)
        return self._results(self._wait(count), True)

    def _wait(self, count: Optional[int]) -> Array:
        try:
            ids = np.sort(np.array(self._pool.wait(self.num_envs if count is None else count), int))
        except Error:
            self._wait_for_all()
            raise
        self._at_work[ids] = False
        if self._tracker is not None:
            for k in ids.tolist():
                seen = self._tracker.observe(self._pool.environment(k).simulation, self._target_mm[k], self._randoms[k])
                self._observations["tracking"][k] = seen
        return ids

    def _results(self, ids: Array, stepped: bool = False) -> Tuple[Any, Array, Array, Array, Dict[str, Any]]:
        facts = self._facts[:, ids]
        everything = len(ids) == self.num_envs and not self.copy
        taken = {part: values if everything else values[ids] for part, values in self._observations.items()}
        info: Dict[str, Any] = dict(zip(INFO, facts[FIRST_OF_INFO:]))
        info["success"] = facts[3] != 0
        info["safe_success"] = facts[4] == 1
        # Gymnasium's mask: False where the value is not known.
        info["_safe_success"] = ~np.isnan(facts[4])
        info["env_id"] = ids
        info["target"] = np.array([self._target[k][0] for k in ids])
        info["target_at_mm"] = np.array([self._target[k][1] for k in ids])
        rewards, terminated, truncated = facts[0].copy(), facts[1] != 0, facts[2] != 0
        if stepped and (self.reward is not None or self.end is not None):
            for row, k in enumerate(ids):
                if self._resets[k]:
                    continue
                here = info_of(facts[:, row].tolist(), self._target[k])
                moment = Moment(self._pool.environment(int(k)).simulation, here, float(rewards[row]))
                rewards[row], ends = rewarded(moment, self.reward, self.end)
                terminated[row] |= ends
            truncated &= ~terminated
        if stepped:
            self._ended[ids] = terminated | truncated
        observations: Any = taken if self._is_dict else taken.popitem()[1]
        return observations, rewards, terminated, truncated, info

    def close(self, **_: Any) -> None:
        """Waits for those at work, and ends the threads. After it, reset(), step(), send() and recv() raise
        ClosedEnvironmentError. Another close() has no effect."""
        # Gymnasium calls this also for an object that could not be made.
        if hasattr(self, "_pool"):
            self._wait_for_all()
            if self._preparing is not None:
                self._preparing.shutdown(cancel_futures=True)
            self._ahead = {}
            del self._pool
        self.closed = True

    def _wait_for_all(self) -> None:
        while self._pool.at_work > 0:
            try:
                self._pool.wait(self.num_envs)
            except Error:
                pass
        self._at_work[:] = False
