"""The adapter to stable-baselines3, against a stand-in of the interface that stable-baselines3 publishes."""

import abc
import copy
import pickle
import subprocess
import sys
import types

import numpy as np
import pytest
import torquer
import torquer.envs

TASK = torquer.envs.Task("side", 40.0, max_steps=3)


class VecEnv(abc.ABC):
    """Abstract methods of VecEnv, and the parts of its base that algorithms use."""

    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs = num_envs
        self.observation_space = observation_space
        self.action_space = action_space
        self.reset_infos = [{} for _ in range(num_envs)]
        assert self.get_attr("render_mode") == [None] * num_envs

    for name in ("reset", "step_async", "step_wait", "close", "get_attr", "set_attr", "env_method", "env_is_wrapped", "seed"):
        locals()[name] = abc.abstractmethod(lambda self, *_: None)

    def step(self, actions):
        self.step_async(actions)
        return self.step_wait()

    def _get_indices(self, indices):
        return range(self.num_envs) if indices is None else [indices] if isinstance(indices, int) else indices


@pytest.fixture(scope="module")
def stable():
    names = ("stable_baselines3", "stable_baselines3.common", "stable_baselines3.common.vec_env")
    for name in names:
        sys.modules[name] = types.ModuleType(name)
    sys.modules[names[-1]].VecEnv = VecEnv
    import torquer.stable

    yield torquer.stable.StableVecEnv
    for name in (*names, "torquer.stable"):
        del sys.modules[name]


def test_an_episode_ends_as_stable_baselines_has_it(stable):
    env = stable("ty_phantom", 2, task=TASK)
    single = torquer.envs.NavigationEnv("ty_phantom", TASK)
    assert env.observation_space.shape == single.observation_space.shape and env.action_space.shape == (2,)
    assert env.seed(7) == [7, 8]
    first = env.reset()
    expected, _ = single.reset(seed=7)
    assert np.array_equal(first[0], expected)
    actions = np.full((2, 2), 0.5, np.float32)
    for k in range(3):
        observations, rewards, dones, infos = env.step(actions)
        expected, reward, _, truncated, info = single.step(actions[0])
        assert rewards.dtype == np.float32 and rewards[0] == np.float32(reward) and dones[0] == truncated == (k == 2)
    assert np.array_equal(infos[0]["terminal_observation"], expected) and infos[0]["TimeLimit.truncated"] is True
    assert {name: infos[0][name] for name in info} == info
    assert copy.copy(env).vector is not env.vector
    # The observation is already that of the next episode.
    expected, info = single.reset()
    assert np.array_equal(observations[0], expected) and env.reset_infos[0] == info
    observations, _, dones, infos = env.step(actions)
    assert not dones.any() and np.array_equal(observations[0], single.step(actions[0])[0]) and "terminal_observation" not in infos[0]


def test_options_attributes_and_refusals(stable):
    env = stable("ty_phantom", 2, task=TASK, end=lambda moment: moment.info["time_s"] > 0.25)
    env.set_options([{"rotation_rad": 0.5}] * 2)
    turned = env.reset()
    assert np.array_equal(turned[0], turned[1])
    assert not np.array_equal(*env.reset())  # the options were for one reset
    env.step(np.zeros((2, 2)))
    *_, dones, infos = env.step(np.zeros((2, 2)))
    assert dones.all() and infos[0]["TimeLimit.truncated"] is False
    assert env.get_attr("task") == [TASK] * 2 and env.get_attr("task", 1) == [TASK] and env.env_is_wrapped(object) == [False] * 2
    for call, said in (
        (lambda: env.set_options([{"rotation_rad": 0.5}, {}]), "the same to all"),
        (env.step_wait, "call step_async"),
        (lambda: env.set_attr("task", TASK), "another task"),
        (lambda: env.env_method("reset"), "StableVecEnv.vector"),
    ):
        with pytest.raises(torquer.Error, match=said):
            call()
    with pytest.raises(AttributeError):
        env.get_attr("nothing")
    env.close()
    for call in (env.reset, lambda: env.step_async(np.zeros((2, 2)))):
        with pytest.raises(torquer.envs.ClosedEnvironmentError):
            call()


def test_pictures_and_vectors_in_a_dict(stable):
    task = torquer.envs.Task("lad", 60.0, max_steps=1, picture_px=64).for_training()
    env = stable("coronary", 2, observation=("vector", "picture"), task=task)
    env.reset()
    observations, _, dones, infos = env.step(np.zeros((2, 2)))
    assert dones.all() and observations["picture"].shape == (2, 64, 64, 1)
    assert infos[1]["terminal_observation"]["picture"].shape == (64, 64, 1)
    pickle.loads(pickle.dumps(env.vector)).close()


def test_the_import_names_the_missing_package():
    code = "import sys; sys.modules['stable_baselines3'] = None; import torquer.stable"
    done = subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True)
    assert done.returncode != 0 and "torquer.stable needs stable-baselines3; install it" in done.stderr
