"""The environments follow Gymnasium's interface, and say what happened."""

import math

import numpy as np
import pytest
import torquer
import torquer.envs


@pytest.fixture(scope="module")
def env():
    return torquer.envs.make("ty_phantom")


def push(env, steps, action=(1.0, 0.0)):
    return [env.step(np.array(action, np.float32)) for _ in range(steps)]


@pytest.mark.parametrize("name", sorted(torquer.envs.TASKS))
def test_every_task_steps(name):
    env = torquer.envs.make(name)
    observation, info = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    length = info["remaining_mm"]
    assert length > 20
    for _ in range(5):
        action = env.action_space.sample()
        assert env.action_space.contains(action)
        observation, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(observation)
        assert isinstance(reward, float) and type(terminated) is bool and type(truncated) is bool
        assert not info["success"] and not info["safe_success"]
    assert info["time_s"] == pytest.approx(0.6)


def test_the_same_seed_gives_the_same_episode(env):
    def episode(seed):
        first, _ = env.reset(seed=seed)
        rest = push(env, 10, (0.8, 0.3))
        return [first] + [o for o, *_ in rest]

    one, again, other = episode(3), episode(3), episode(4)
    assert all(np.array_equal(a, b) for a, b in zip(one, again))
    assert not np.array_equal(one[0], other[0])


def test_reset_without_a_seed_goes_on_with_the_numbers(env):
    env.reset(seed=3)
    first, _ = env.reset()
    second, _ = env.reset()
    assert not np.array_equal(first, second)


def test_options_choose_the_rotation(env):
    env.reset(seed=1, options={"rotation_rad": 0.25})
    assert env.simulation.hands[0, 1] == pytest.approx(0.25)


def test_a_vector_shows_wire_route_and_target_from_the_tip(env):
    observation, info = env.reset(seed=1, options={"rotation_rad": 0.0})
    push(env, 20)
    observation, _, _, _, info = push(env, 1)[0]
    simulation = env.simulation
    tip = simulation.tips_mm[0]
    points = observation[:-3].reshape(-1, 3)
    assert np.allclose(points[-1] + tip, env.scene.route_mm("side", 40.0)[-1], atol=1e-3)
    # The points of the wire are 5 mm apart along it, those of the route too.
    wire = np.vstack([np.zeros(3), points[:4]])
    gaps = np.linalg.norm(np.diff(wire, axis=0), axis=1)
    assert (gaps > 4).all() and (gaps < 5.6).all()
    gaps = np.linalg.norm(np.diff(points[4:8], axis=0), axis=1)
    assert (gaps > 4).all() and (gaps < 5.1).all()
    insertion, cosine, sine = observation[-3:]
    assert insertion == pytest.approx(simulation.places[0, 0], abs=1e-3)
    assert math.hypot(cosine, sine) == pytest.approx(1, abs=1e-5)


def test_the_way_along_the_route_is_the_reward(env):
    _, info = env.reset(seed=1, options={"rotation_rad": 0.0})
    before = info["remaining_mm"]
    steps = push(env, 10)
    after = steps[-1][4]["remaining_mm"]
    assert 15 < before - after < 21  # ten times 2 mm
    assert sum(reward for _, reward, *_ in steps) == pytest.approx((before - after) / 10 - 0.1)
    assert steps[-1][4]["path_mm"] == pytest.approx(20, abs=1)


def test_success_is_reached_and_safe_only_below_the_limit():
    def reach(limit):
        task = torquer.envs.Task("main", 140.0, force_limit_mN=limit)
        env = torquer.envs.NavigationEnv(torquer.scene_path("ty_phantom"), task)
        env.reset(options={"rotation_rad": 0.0})
        worst = 0.0
        for _ in range(400):
            _, reward, terminated, truncated, info = env.step([1.0, 0.0])
            worst = max(worst, info["wall_force_mN"])
            if terminated or truncated:
                return terminated, reward, info, worst
        raise AssertionError("the episode does not end")

    terminated, reward, info, worst = reach(1e6)
    assert terminated and reward > 9.9 and info["success"] and info["safe_success"]
    assert worst > 0
    _, _, info, _ = reach(worst / 2)
    assert info["success"] and not info["safe_success"]


def test_an_episode_is_truncated_where_the_steps_end():
    task = torquer.envs.Task("side", 40.0, max_steps=3)
    env = torquer.envs.NavigationEnv(torquer.scene_path("ty_phantom"), task)
    env.reset(seed=1)
    ends = [(terminated, truncated) for _, _, terminated, truncated, _ in push(env, 3)]
    assert ends == [(False, False), (False, False), (False, True)]


def test_pictures():
    env = torquer.envs.make("coronary", observation="picture", render_mode="rgb_array")
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    later, *_ = env.step(np.array([1.0, 0.5], np.float32))
    assert not np.array_equal(observation, later)
    assert env.render().shape == later.shape[:2] + (3,)
    assert np.array_equal(env.render()[:, :, 1], later[:, :, 0])


def test_what_cannot_be_used_is_refused():
    path = torquer.scene_path("ty_phantom")
    task = torquer.envs.TASKS["ty_phantom"]
    with pytest.raises(torquer.Error, match="ty_phantom.*coronary|coronary"):
        torquer.envs.make("aorta")
    with pytest.raises(torquer.Error, match="'smell'"):
        torquer.envs.NavigationEnv(path, task, observation="smell")
    with pytest.raises(torquer.Error, match="fluoroscopy"):
        torquer.envs.NavigationEnv(path, task, observation="picture")
    with pytest.raises(torquer.Error, match="instrument is 1"):
        torquer.envs.NavigationEnv(path, torquer.envs.Task("side", 40.0, instrument=1))
    if torquer.envs.gymnasium is None:
        with pytest.raises(torquer.Error, match="gymnasium is not installed"):
            torquer.envs.register()
