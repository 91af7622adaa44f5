"""Adapter to stable-baselines3: torquer.envs.VectorEnv with the interface of its VecEnv.

    from stable_baselines3 import PPO
    from torquer.stable import StableVecEnv

    task = torquer.envs.TASKS["coronary"].for_training()
    PPO("MlpPolicy", StableVecEnv("coronary", 16, task=task)).learn(50_000)

The import needs stable-baselines3, which needs Gymnasium.
"""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene
from ._anatomies import SceneDraw
from ._names import shown
from ._navigation import End, Observation, Reward, Task
from ._spaces import CopiedWhole, refuse_closed
from ._vector import VectorEnv

try:
    from stable_baselines3.common.vec_env import VecEnv  # type: ignore[import]
except ImportError:
    raise Error(
        "torquer.stable needs stable-baselines3; install it with pip, or use torquer.envs.VectorEnv"
    ) from None

Indices = Union[None, int, Sequence[int]]


class StableVecEnv(CopiedWhole, VecEnv):  # type: ignore[misc]
    """Environments in threads for stable-baselines3.

    As its VecEnv does, an environment returns to the start in the step that ends its episode. Its info
    then has "terminal_observation", and "TimeLimit.truncated", which is True if only Task.max_steps
    ended it.
    """

    def __init__(
        self,
        name: Union[str, Scene, SceneDraw],
        count: int,
        threads: Optional[int] = None,
        observation: Observation = "vector",
        task: Optional[Task] = None,
        reward: Optional[Reward] = None,
        end: Optional[End] = None,
    ) -> None:
        """The arguments are those of torquer.envs.VectorEnv."""
        self.vector = VectorEnv(name, count, threads, observation, task, True, reward, end)
        self._actions: Optional[npt.NDArray[Any]] = None
        self._chosen_seed: Optional[int] = None
        self._chosen_options: Optional[Dict[str, Any]] = None
        self.render_mode = None
        super().__init__(count, self.vector.single_observation_space, self.vector.single_action_space)

    def __repr__(self) -> str:
        return f"StableVecEnv({self.vector!r})"

    def reset(self) -> Any:
        """Returns all to the start: with the seeds of seed() and the options of set_options()."""
        observations, info = self.vector.reset(seed=self._chosen_seed, options=self._chosen_options)
        self._chosen_seed = self._chosen_options = None
        self.reset_infos = self._infos(info)
        return observations

    def seed(self, seed: Optional[int] = None) -> List[Optional[int]]:
        """Seeds for the next reset(): `seed` for the first environment, one more for each next."""
        self._chosen_seed = int(np.random.randint(2**31)) if seed is None else seed
        return [self._chosen_seed + k for k in range(self.num_envs)]

    def set_options(self, options: Union[None, Dict[str, Any], List[Dict[str, Any]]] = None) -> None:
        """Options for the next reset(), the same for all environments."""
        if isinstance(options, list):
            if any(given != options[0] for given in options):
                raise Error(f"options are {shown(options)}; give the same to all environments")
            options = options[0]
        self._chosen_options = options

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        refuse_closed(self.vector.closed, "step_async")
        self._actions = np.asarray(actions)

    def step_wait(self) -> Tuple[Any, npt.NDArray[np.float32], npt.NDArray[np.bool_], List[Dict[str, Any]]]:
        if self._actions is None:
            raise Error("no step has begun; call step_async() before step_wait()")
        observations, rewards, terminated, truncated, info = self.vector.step(self._actions)
        self._actions = None
        infos = self._infos(info)
        ended = terminated | truncated
        if ended.any():
            for k in np.flatnonzero(ended):
                infos[k]["terminal_observation"] = self._one(observations, int(k))
                infos[k]["TimeLimit.truncated"] = bool(truncated[k])
            # The next step of the vector would only return these to the start.
            observations, info = self.vector.reset(options={"reset_mask": ended})
            at_start = self._infos(info)
            for k in np.flatnonzero(ended):
                self.reset_infos[k] = at_start[k]
        return observations, rewards.astype(np.float32), ended, infos

    def close(self) -> None:
        self.vector.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> List[Any]:
        """Attribute of the vector, once for each environment."""
        value = self.render_mode if attr_name == "render_mode" else getattr(self.vector, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        raise Error(f"{attr_name} of single environments cannot be set; make a StableVecEnv with another task")

    def env_method(self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any) -> List[Any]:
        raise Error(f"{method_name} cannot be called in single environments, which have no Python object; use StableVecEnv.vector")

    def env_is_wrapped(self, wrapper_class: Any, indices: Indices = None) -> List[bool]:
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> List[Optional[npt.NDArray[np.uint8]]]:
        """None: a vector of environments renders no picture."""
        return [None] * self.num_envs

    def _infos(self, info: Dict[str, Any]) -> List[Dict[str, Any]]:
        """`info` of the vector for each environment, as from a NavigationEnv."""
        names = [name for name in info if name not in ("env_id", "_safe_success")]
        infos = [{name: info[name][k].item() for name in names} for k in range(self.num_envs)]
        for one, is_known in zip(infos, info["_safe_success"]):
            if not is_known:
                one["safe_success"] = None
        return infos

    def _one(self, observations: Any, k: int) -> Any:
        if isinstance(observations, dict):
            return {part: values[k] for part, values in observations.items()}
        return observations[k]
