"""The environments follow Gymnasium's interface and report each outcome."""

import dataclasses
import json
import math
import os
import signal
import subprocess
import sys
import time

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


@pytest.mark.parametrize("name", sorted(torquer.envs.TASKS))
def test_an_observation_is_within_finite_bounds_wherever_the_hands_go(name):
    many = torquer.envs.VectorEnv(name, 4, task=torquer.envs.TASKS[name].for_training())
    space = many.single_observation_space
    assert np.isfinite(space.low).all() and np.isfinite(space.high).all() and (space.low < space.high).all()
    random = np.random.default_rng(3)
    observations, _ = many.reset(seed=1)
    # One is pushed to its limit, one pulled out, two wander.
    for _ in range(300):
        actions = random.uniform(-1, 1, many.action_space.shape).astype(np.float32)
        actions[0, ::2], actions[1, ::2] = 1, -1
        observations, *_ = many.step(actions)
        assert many.observation_space.contains(observations)
        assert all(space.contains(row) for row in observations)


def test_the_same_seed_gives_the_same_episode(env):
    def episode(seed):
        first, _ = env.reset(seed=seed)
        rest = push(env, 10, (0.8, 0.3))
        return [first] + [o for o, *_ in rest]

    one, again, other = episode(3), episode(3), episode(4)
    assert all(np.array_equal(a, b) for a, b in zip(one, again))
    assert not np.array_equal(one[0], other[0])


def test_reset_without_a_seed_continues_the_random_numbers(env):
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
    # The points of the wire are 5 mm apart along it, as are those of the route.
    wire = np.vstack([np.zeros(3), points[:4]])
    gaps = np.linalg.norm(np.diff(wire, axis=0), axis=1)
    assert (gaps > 4).all() and (gaps < 5.6).all()
    gaps = np.linalg.norm(np.diff(points[4:8], axis=0), axis=1)
    assert (gaps > 4).all() and (gaps < 5.1).all()
    insertion, cosine, sine = observation[-3:]
    assert insertion == pytest.approx(simulation.places[0, 0], abs=1e-3)
    assert math.hypot(cosine, sine) == pytest.approx(1, abs=1e-5)


def test_a_hand_stops_at_the_end_of_its_instrument(env):
    env.reset(seed=1)
    length = env.scene.instruments[0].max_length_mm
    push(env, int(length / 2) + 20)
    assert env.simulation.hands[0, 0] == length
    # So the wire comes back with the first step.
    before = env.simulation.places[0, 0]
    push(env, 1, (-1.0, 0.0))
    assert env.simulation.places[0, 0] < before - 1


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


def test_unusable_values_are_refused():
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


SOME = np.random.default_rng(2).uniform(-0.4, 1, (25, 5, 2)).astype(np.float32)


@pytest.mark.parametrize("threads", [1, 3])
def test_a_vector_gives_what_single_environments_give(threads):
    task = torquer.envs.Task("side", 40.0, max_steps=9)
    path = torquer.scene_path("ty_phantom")
    many = torquer.envs.VectorEnv(path, 5, threads, task=task)
    singles = [torquer.envs.NavigationEnv(path, task) for _ in range(5)]
    observations, info = many.reset(seed=11)
    assert many.observation_space.contains(observations) and many.action_space.contains(SOME[0])
    for k, env in enumerate(singles):
        observation, one = env.reset(seed=11 + k)
        assert np.array_equal(observations[k], observation)
        assert one == {name: info[name][k] for name in one}
    ended = [False] * 5
    resets = 0
    for actions in SOME:
        observations, rewards, terminated, truncated, info = many.step(actions)
        assert info["env_id"].tolist() == [0, 1, 2, 3, 4]
        for k, env in enumerate(singles):
            if ended[k]:
                # The random sequence continues as in an environment that is reset without a seed.
                observation, one = env.reset()
                reward, ends = 0.0, (False, False)
                resets += 1
            else:
                observation, reward, *ends, one = env.step(actions[k])
            assert np.array_equal(observations[k], observation)
            assert (rewards[k], terminated[k], truncated[k]) == (reward, *ends)
            assert one == {name: info[name][k] for name in one}
            ended[k] = any(ends)
    assert resets == 10


def test_some_are_sent_and_the_first_to_finish_received():
    many = torquer.envs.VectorEnv("ty_phantom", 4, 2)
    many.reset(seed=[5, 6, 7, 8])
    other = torquer.envs.VectorEnv("ty_phantom", 4, 1)
    other.reset(seed=5)
    many.send(SOME[0, [2, 0]], [2, 0])
    with pytest.raises(torquer.Error, match="running already"):
        many.send(SOME[0, :1], [2])
    with pytest.raises(torquer.Error, match="are running; call recv"):
        many.reset()
    first = many.recv(1)
    second = many.recv()
    assert first[0].shape == second[0].shape == (1, 30)
    assert {int(first[4]["env_id"][0]), int(second[4]["env_id"][0])} == {0, 2}
    many.send(SOME[0, [1, 3]], [3, 1])
    assert many.recv()[4]["env_id"].tolist() == [1, 3]
    expected = other.step(np.stack([SOME[0, 0], SOME[0, 3], SOME[0, 2], SOME[0, 1]]))[0]
    many.send(SOME[1, :4])
    assert np.array_equal(many.recv()[0], other.step(SOME[1, :4])[0])
    assert not np.array_equal(expected[1], expected[3])
    many.send(SOME[2, :4])
    many.close()
    assert many.closed and not many._at_work.any()


def test_without_copies_the_next_step_overwrites():
    kept = torquer.envs.VectorEnv("ty_phantom", 2, 1)
    shown = torquer.envs.VectorEnv("ty_phantom", 2, 1, copy=False)
    a, b = kept.reset(seed=1)[0], shown.reset(seed=1)[0]
    before = a.copy()
    kept.step(SOME[0, :2])
    again = shown.step(SOME[0, :2])[0]
    assert np.array_equal(a, before) and again is b
    assert not np.array_equal(b, before)


def test_a_vector_of_pictures_of_another_size():
    task = dataclasses.replace(torquer.envs.TASKS["coronary"], picture_px=128)
    path = torquer.scene_path("coronary")
    many = torquer.envs.VectorEnv(path, 2, 2, "picture", task)
    pictures, _ = many.reset(seed=4)
    assert pictures.shape == (2, 128, 128, 1) and many.observation_space.contains(pictures)
    single = torquer.envs.NavigationEnv(path, task, "picture")
    assert np.array_equal(pictures[1], single.reset(seed=5)[0])
    pictures = many.step(SOME[0, :2])[0]
    assert np.array_equal(pictures[1], single.step(SOME[0, 1])[0])
    assert not np.array_equal(pictures[0], pictures[1])


def test_training_takes_longer_segments():
    task = torquer.envs.TASKS["ty_phantom"].for_training()
    assert (task.tolerance, task.segment_mm, task.longest_mm) == (1e-3, 2.0, 1.0)
    assert (task.longest_feed_mm, task.longest_tick_ms) == (1.0, 20.0)
    assert torquer.envs.TASKS["ty_phantom"].segment_mm is None
    fine, coarse = (
        torquer.envs.NavigationEnv(torquer.scene_path("ty_phantom"), dataclasses.replace(task, segment_mm=mm))
        for mm in (1.0, 2.0)
    )
    shapes = []
    for env in (fine, coarse):
        env.reset(options={"rotation_rad": 0.0})
        push(env, 40)
        shapes.append(env.simulation.nodes_mm.copy())
    assert len(shapes[0]) == pytest.approx(2 * len(shapes[1]), abs=2)
    assert np.linalg.norm(shapes[0][-1] - shapes[1][-1]) < 0.5


def test_a_vector_refuses_unusable_arguments():
    make = torquer.envs.VectorEnv
    with pytest.raises(torquer.Error, match="no task 'aorta'; there are: ty_phantom"):
        make("aorta", 2)
    with pytest.raises(torquer.Error, match="count is 0"):
        make("ty_phantom", 0)
    with pytest.raises(torquer.Error, match="threads is 0"):
        make("ty_phantom", 1, 0)
    many = make("ty_phantom", 3, 1)
    many.reset(seed=1)
    for actions, ids, said in [
        (np.zeros((2, 2)), None, r"shape \(2, 2\); give \(3, 2\)"),
        (np.full((3, 2), np.nan), None, "not finite"),
        (np.zeros((2, 2)), [0, 0], "give each once, 0 to 2"),
        (np.zeros((1, 2)), [3], "give each once, 0 to 2"),
    ]:
        with pytest.raises(torquer.Error, match=said):
            many.send(actions, ids)
    with pytest.raises(torquer.Error, match="no environment is running"):
        many.recv()
    with pytest.raises(torquer.Error, match="2 seeds; give 3"):
        many.reset(seed=[1, 2])


NOT_FINITE = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_nan_is_refused_without_effect(env, bad):
    observation, _ = env.reset(seed=3)
    push(env, 3)
    here = env.simulation.state_hash
    many = torquer.envs.VectorEnv("ty_phantom", 2, 1)
    for action in ([bad, 0], [0, bad]):
        with pytest.raises(torquer.Error):
            env.step(action)
        many.reset(seed=1)
        with pytest.raises(torquer.Error):
            many.step([[0, 0], action])
        with pytest.raises(torquer.Error):
            many._pool.step([0, 1], [[0, 0], action])
        assert many._pool.at_work == 0
    for one in (env, many):
        with pytest.raises(torquer.Error, match="rotation_rad is"):
            one.reset(options={"rotation_rad": bad})
        with pytest.raises(torquer.Error, match="seed is"):
            one.reset(seed=bad)
    assert env.simulation.state_hash == here
    for name in ("within_mm", "step_s", "longest_mm", "largest_turn_rad", "force_limit_mN", "instrument", "max_steps",
                 "at_mm", "tolerance", "segment_mm"):
        if name == "force_limit_mN" and bad == math.inf:
            continue
        task = dataclasses.replace(env.task, **{name: bad})
        with pytest.raises(torquer.Error):
            torquer.envs.NavigationEnv(torquer.scene_path("ty_phantom"), task)
    for given in ({"count": bad}, {"count": 2, "threads": bad}):
        with pytest.raises(torquer.Error):
            torquer.envs.VectorEnv("ty_phantom", **given)
    with pytest.raises(torquer.Error):
        many.send([[0, 0]], [bad])
    assert np.array_equal(env.reset(seed=3)[0], observation)


@pytest.mark.parametrize(
    "bad",
    [
        {"seed": -1}, {"seed": "x"}, {"seed": 1.5}, {"seed": [1, -1]}, {"seed": [1, "x"]}, {"seed": 2**64}, {"seed": [1]},
        {"options": {"rotation_rad": "x"}}, {"options": {"rotation_rad": [1, 2]}}, {"options": {"rotation_rad": 1e9}}, {"options": 3},
    ],
)
def test_a_reset_that_is_refused_does_not_keep_the_next_from_it(bad):
    many = torquer.envs.VectorEnv("ty_phantom", 2, 1)
    expected, _ = many.reset(seed=1)
    with pytest.raises(torquer.Error):
        many.reset(**bad)
    with pytest.raises(torquer.Error):
        many.step([["x", 0], [0, 0]])
    assert np.array_equal(many.reset(seed=1)[0], expected)


@pytest.mark.parametrize("at_work", [False, True])
def test_a_forked_child_must_make_a_new_one(at_work):
    many = torquer.envs.VectorEnv("ty_phantom", 2, 2)
    many.reset(seed=1)
    if at_work:
        many.send(np.ones((2, 2)))
    child = os.fork()
    if child == 0:
        refused = 0
        for call in (lambda: many.reset(seed=1), lambda: many.step(np.zeros((2, 2))), many.recv):
            try:
                call()
            except torquer.Error:
                refused += 1
        many.close()
        del many
        own = torquer.envs.VectorEnv("ty_phantom", 2, 2)
        own.reset(seed=1)
        os._exit(7 if refused == 3 else 1)
    for _ in range(600):
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        time.sleep(0.1)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        pytest.fail("the child hangs")
    assert os.waitstatus_to_exitcode(status) == 7
    if at_work:
        many.recv()
    many.step(np.zeros((2, 2)))


def test_an_exception_of_a_thread_is_raised():
    # Hand targets are limited to 1e5 rad.
    task = torquer.envs.Task("side", 40.0, largest_turn_rad=2e5)
    many = torquer.envs.VectorEnv(torquer.scene_path("ty_phantom"), 2, 2, task=task)
    many.reset(seed=1)
    with pytest.raises(torquer.Error, match="within 1e5"):
        many.step(np.array([[0, 1], [0, 0]]))
    many.send(np.zeros((1, 2)), [1])
    assert many.recv()[4]["env_id"].tolist() == [1]


def test_the_benchmark_reports_speed_and_accuracy():
    done = subprocess.run(
        [sys.executable, "-m", "torquer", "benchmark", "--json", "ty_phantom"],
        capture_output=True, text=True, check=True,
    )
    result = json.loads(done.stdout)
    assert [row["accuracy"] for row in result["rows"]] == ["accurate", "default", "training"]
    for row in result["rows"]:
        assert row["single"]["steps_s"] > 0 and row["vector"]["steps_core_s"] > 0
        assert 0.1 < row["memory_MB"] < 10
    assert result["rows"][2]["memory_MB"] < result["rows"][0]["memory_MB"]  # longer segments, so fewer
    accurate, default, training = (row["tip_error_p95_mm"] for row in result["rows"])
    assert accurate == 0 < default < training < 2
    done = subprocess.run(
        [sys.executable, "-m", "torquer", "benchmark", "aorta"], capture_output=True, text=True
    )
    assert done.returncode == 2 and "there is no task 'aorta'" in done.stderr
