"""Targets drawn at each reset, observations in dicts, and rewards and ends of the user."""

import dataclasses

import numpy as np
import pytest
import torquer
import torquer.envs

BASE = torquer.envs.Task("side", 40.0, max_steps=9)
SEVERAL = dataclasses.replace(BASE, other_targets=(("main", 140.0), ("main", 90.0, 120.0)))


def test_each_reset_draws_a_target_of_the_seed():
    env = torquer.envs.NavigationEnv("ty_phantom", SEVERAL)
    drawn = []
    for seed in range(40):
        observation, info = env.reset(seed=seed)
        assert env.observation_space.contains(observation)
        target = (info["target"], info["target_at_mm"])
        drawn.append(target)
        # The last of the points that an observation has is the target, from the tip.
        tip_mm = env.simulation.tips_mm[0]
        place_mm = env.scene.route_mm(*target)[-1]
        assert observation[24:27] == pytest.approx(place_mm - tip_mm, abs=1e-3)
        again, _ = env.reset(seed=seed)
        assert np.array_equal(again, observation)
    assert {("side", 40.0), ("main", 140.0)} < set(drawn)
    between = [at for name, at in drawn if name == "main" and at != 140.0]
    assert len(set(between)) == len(between) > 3 and 90 <= min(between) and max(between) <= 120
    many = torquer.envs.VectorEnv("ty_phantom", 40, task=SEVERAL)
    _, info = many.reset(seed=0)
    assert list(zip(info["target"], info["target_at_mm"])) == drawn
    # A task with one target has the rotations that it had without the feature.
    plain, _ = torquer.envs.NavigationEnv("ty_phantom", BASE).reset(seed=4)
    turned, _ = env.reset(options={"rotation_rad": np.random.default_rng(4).uniform(-np.pi, np.pi), "target": ("side", 40.0)})
    assert np.array_equal(plain, turned)


def test_targets_are_chosen_and_refused():
    env = torquer.envs.NavigationEnv("ty_phantom", SEVERAL)
    for chosen in (("side", 40), ["main", 140.0], ("main", 101.5)):
        _, info = env.reset(options={"target": chosen})
        assert (info["target"], info["target_at_mm"]) == tuple(chosen)
    for bad in (("side", 41), ("main", 80), "side", 1, ("mian", 140)):
        with pytest.raises(torquer.Error, match=r"target is .*give .*\('side', 40\), \('main', 140\), \('main', 90 to 120\)"):
            env.reset(options={"target": bad})
    for bad in ("main", ("main",), ("main", 120.0, 90.0), ("main", "far"), (3, 4.0)):
        with pytest.raises(torquer.Error, match="other_targets has .*give"):
            torquer.envs.NavigationEnv("ty_phantom", dataclasses.replace(BASE, other_targets=(bad,)))
    with pytest.raises(torquer.Error, match="lad"):
        torquer.envs.NavigationEnv("ty_phantom", dataclasses.replace(BASE, other_targets=(("lad", 1.0),)))


def test_a_reached_target_ends_its_episode():
    task = dataclasses.replace(BASE, max_steps=400, other_targets=(("main", 30.0),))
    env = torquer.envs.NavigationEnv("ty_phantom", task)
    steps = {}
    for target in (("main", 30.0), ("side", 40.0)):
        env.reset(options={"target": target, "rotation_rad": 0.0})
        for steps[target[0]] in range(60):
            *_, terminated, truncated, info = env.step([1.0, 0.0])
            if terminated:
                assert info["success"]
                break
    assert 10 < steps["main"] < 20 and steps["side"] > steps["main"]


def test_observations_in_a_dict():
    task = dataclasses.replace(torquer.envs.TASKS["coronary"].for_training(), picture_px=64)
    both = torquer.envs.make("coronary", ("vector", "picture"), task=task)
    vector = torquer.envs.make("coronary", task=task)
    picture = torquer.envs.make("coronary", "picture", task=task)
    many = torquer.envs.make_vec("coronary", 2, ("vector", "picture"), task=task)
    seen, _ = both.reset(seed=2)
    every, _ = many.reset(seed=2)
    assert set(seen) == set(every) == {"vector", "picture"} and seen["picture"].shape == (64, 64, 1)
    assert np.array_equal(seen["vector"], vector.reset(seed=2)[0])
    assert np.array_equal(seen["picture"], picture.reset(seed=2)[0])
    for _ in range(2):
        seen, *_ = both.step([0.5, 0.1])
        every, *_ = many.step(np.array([[0.5, 0.1]] * 2))
    assert np.array_equal(every["vector"][0], seen["vector"]) and np.array_equal(every["picture"][0], seen["picture"])
    assert both.observation_space.contains(seen) and many.observation_space.contains(every)
    for bad in ("pictures", (), ("vector", "vector"), ("vector", "map")):
        with pytest.raises(torquer.Error, match="observation is .*give 'vector', 'picture'"):
            torquer.envs.make("ty_phantom", bad)


def test_rewards_and_ends_of_the_user():
    seen = []

    def reward(moment):
        seen.append(moment)
        return 100 * moment.simulation.tips_mm[0, 0] + moment.reward

    def end(moment):
        return moment.info["time_s"] > 0.45

    plain = torquer.envs.NavigationEnv("ty_phantom", BASE)
    env = torquer.envs.NavigationEnv("ty_phantom", BASE, reward=reward, end=end)
    many = torquer.envs.VectorEnv("ty_phantom", 2, task=BASE, reward=reward, end=end)
    for one in (plain, env, many):
        one.reset(seed=1)
    for k in range(4):
        _, expected, *_ = plain.step([1.0, 0.2])
        _, got, terminated, truncated, _ = env.step([1.0, 0.2])
        _, rewards, ends, cuts, _ = many.step(np.array([[1.0, 0.2]] * 2))
        assert got == rewards[0] == 100 * env.simulation.tips_mm[0, 0] + expected
        assert terminated == ends[0] == (k == 3) and not truncated and not cuts[0]
    with pytest.raises(torquer.Error, match="ended; call reset"):
        env.step([0.0, 0.0])
    count = len(seen)
    _, rewards, ends, _, info = many.step(np.zeros((2, 2)))  # resets, so there is nothing to reward
    assert len(seen) == count and rewards.tolist() == [0, 0] and not ends.any() and info["time_s"][0] == pytest.approx(0.1)
    env.reset(seed=1)
    env.step([1.0, 0.2])
    wrong = torquer.envs.NavigationEnv("ty_phantom", BASE, reward=lambda moment: float("nan"))
    wrong.reset(seed=1)
    with pytest.raises(torquer.Error, match="the reward is nan; return a finite number"):
        wrong.step([0.0, 0.0])


def test_a_mask_leaves_ends_of_the_user():
    many = torquer.envs.VectorEnv("ty_phantom", 2, task=BASE, end=lambda moment: moment.info["time_s"] > 0.15)
    many.reset(seed=1)
    *_, ends, _, _ = many.step(np.zeros((2, 2)))
    assert ends.all()
    many.reset(options={"reset_mask": np.array([True, False])})
    _, _, ends, _, info = many.step(np.zeros((2, 2)))
    assert ends.tolist() == [True, False] and info["time_s"] == pytest.approx([0.2, 0.1])
