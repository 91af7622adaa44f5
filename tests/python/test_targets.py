"""Targets drawn at each reset, observations in dicts, and rewards and ends of the user."""

import dataclasses
import pickle

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


def test_tracking_has_the_places_in_the_picture_with_noise():
    base = dataclasses.replace(torquer.envs.TASKS["coronary"].for_training(), max_steps=4)
    clear = torquer.envs.make("coronary", "tracking", task=base)
    seen, info = clear.reset(seed=3)
    for _ in range(3):
        seen, *_ = clear.step([1.0, 0.2])
    simulation = clear.simulation
    nodes_mm = simulation.instrument_nodes_mm(0)
    points_mm = [simulation.tips_mm[0], clear.scene.route_mm(info["target"], info["target_at_mm"])[-1]]
    places = np.reshape(seen, (-1, 2))
    assert seen.dtype == np.float32 and places.shape == (7, 2)
    assert places[[0, 6]] == pytest.approx(simulation.places_in_picture(points_mm), abs=1e-3)
    # The other points lie on the wire, 5 mm apart along it.
    line = simulation.places_in_picture(nodes_mm)
    behind = np.linalg.norm(np.diff(nodes_mm, axis=0), axis=1)[::-1].cumsum()
    for k in range(1, 6):
        at = int(np.searchsorted(behind, 5.0 * k))
        assert np.linalg.norm(places[k] - line[[-2 - at, -1 - at]], axis=1).sum() < 1.01 * np.linalg.norm(line[-2 - at] - line[-1 - at]) + 1e-3
    noisy = dataclasses.replace(base, tracking_noise_px=2.0)
    env = torquer.envs.make("coronary", ("tracking", "vector"), task=noisy)
    many = torquer.envs.make_vec("coronary", 3, ("tracking", "vector"), task=noisy)
    every, _ = many.reset(seed=2)
    assert np.array_equal(every["tracking"][1], env.reset(seed=3)[0]["tracking"])
    errors, env_ended = [], False
    for _ in range(9):  # with a reset
        every, _, ended, cut, _ = many.step(np.array([[1.0, 0.2]] * 3))
        one = env.step([1.0, 0.2])[0] if not env_ended else env.reset()[0]
        env_ended = bool(ended[1] or cut[1])
        assert np.array_equal(every["tracking"][1], one["tracking"])
        assert many.observation_space.contains(every)
        ours = env.simulation.places_in_picture(env.simulation.tips_mm)[0]
        errors.append(one["tracking"][:2] - ours)
    assert 0.8 < np.std(errors) < 4 and np.abs(np.mean(errors)) < 2
    other = pickle.loads(pickle.dumps(many))
    assert np.array_equal(other.step(np.zeros((3, 2)))[0]["tracking"], many.step(np.zeros((3, 2)))[0]["tracking"])
    with pytest.raises(torquer.Error, match="tracking_noise_px is -1; give a number from 0 on"):
        torquer.envs.make("coronary", "tracking", task=dataclasses.replace(base, tracking_noise_px=-1))
    with pytest.raises(torquer.Error, match="ty_phantom has no X-ray pictures; add .effects.fluoroscopy."):
        torquer.envs.make("ty_phantom", "tracking")


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
