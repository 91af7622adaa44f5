"""Environments refuse the same steps alone and in a vector, and report if a result is unknown."""

import copy
import dataclasses
import math
import os
import pickle

import numpy as np
import pytest
import torquer
import torquer.envs


def pushed_to_the_target(budget_units):
    """Wall force of each step, and the last info, of an environment and of a vector with it."""
    scene = torquer.Scene("ty_phantom").with_values({"relaxation.budget_units": budget_units})
    task = torquer.envs.Task("main", 140.0, force_limit_mN=1e6, tolerance=1e-10)
    env = torquer.envs.NavigationEnv(scene, task)
    many = torquer.envs.VectorEnv(scene, 1, task=task)
    env.reset(options={"rotation_rad": 0.0})
    _, info = many.reset(options={"rotation_rad": 0.0})
    assert info["_safe_success"].all()
    forces_mN = []
    for _ in range(400):
        observation, _, terminated, truncated, info = env.step([1.0, 0.0])
        *_, infos = many.step([[1.0, 0.0]])
        assert np.isfinite(observation).all()
        np.testing.assert_equal(infos["wall_force_mN"][0], info["wall_force_mN"])
        forces_mN.append(info["wall_force_mN"])
        if terminated or truncated:
            break
    assert info["success"] and infos["success"][0]
    return np.array(forces_mN), info, infos


def test_safety_is_not_known_where_no_step_converged():
    forces_mN, info, infos = pushed_to_the_target(4)
    assert np.isnan(forces_mN).all()
    assert info["safe_success"] is None
    assert not infos["safe_success"][0] and not infos["_safe_success"][0]


def test_safety_is_not_known_after_a_step_that_did_not_converge():
    runs = [pushed_to_the_target(budget_units) for budget_units in range(26, 36)]
    # In some of these budgets an early step does not converge, and the last one does.
    early = [run for run in runs if np.isnan(run[0]).any() and not np.isnan(run[0][-1])]
    assert early
    for _, info, infos in early:
        assert info["safe_success"] is None
        assert not infos["safe_success"][0] and not infos["_safe_success"][0]


def test_single_and_vector_refuse_the_same_steps():
    task = torquer.envs.Task("side", 40.0, max_steps=2)
    env = torquer.envs.NavigationEnv(torquer.scene_path("ty_phantom"), task)
    many = torquer.envs.VectorEnv(torquer.scene_path("ty_phantom"), 1, task=task)
    for step in (lambda: env.step([0.0, 0.0]), lambda: many.step([[0.0, 0.0]])):
        with pytest.raises(torquer.Error, match="call reset"):
            step()
    env.reset(seed=1)
    many.reset(seed=1)
    for bad in (math.nan, math.inf, -math.inf):
        for step in (lambda: env.step([bad, 0.0]), lambda: many.step([[0.0, bad]])):
            with pytest.raises(torquer.Error, match="finite|not a number|nan|inf"):
                step()
    # Both name the same remedy, and refuse the same forms.
    bad_actions = {math.nan: "not finite; give -1 to 1", "one": "not an array of numbers", None: "not finite"}
    for bad, said in bad_actions.items():
        for step in (lambda: env.step([0.0, bad]), lambda: many.step([[0.0, bad]])):
            with pytest.raises(torquer.Error, match=said):
                step()
    for step in (lambda: env.step([[0.0, 0.0]]), lambda: many.step([[[0.0, 0.0]]]), lambda: env.step(0.0), lambda: many.step(0.0)):
        with pytest.raises(torquer.Error, match="of the shape"):
            step()
    # A refused step has no motion.
    assert env.simulation.time_s == pytest.approx(0.1)
    for _ in range(2):
        *_, truncated, _ = env.step([1.0, 0.0])
        *_, all_truncated, _ = many.step([[1.0, 0.0]])
    assert truncated and all_truncated[0]
    with pytest.raises(torquer.Error, match="ended; call reset"):
        env.step([0.0, 0.0])
    with pytest.raises(torquer.Error, match="finite"):
        many.step([[math.nan, 0.0]])
    # The vector resets instead, as documented.
    _, rewards, _, all_truncated, info = many.step([[0.0, 0.0]])
    assert rewards[0] == 0 and not all_truncated[0] and info["time_s"][0] == pytest.approx(0.1)
    env.reset(seed=1)
    env.step([0.0, 0.0])


def test_single_and_vector_refuse_unknown_options():
    env = torquer.envs.make("ty_phantom")
    many = torquer.envs.make_vec("ty_phantom", 2)
    with pytest.raises(torquer.Error, match="'rotation'; did you mean rotation_rad. give only rotation_rad, target"):
        env.reset(options={"rotation": 1.0})
    with pytest.raises(torquer.Error, match="'reset_mask'; give only rotation_rad, target"):
        env.reset(options={"reset_mask": np.array([True])})
    with pytest.raises(torquer.Error, match="'rotation'; did you mean rotation_rad. give only rotation_rad, target, reset_mask"):
        many.reset(options={"rotation": 1.0})
    with pytest.raises(torquer.Error, match="without reset_mask first"):
        many.reset(options={"reset_mask": np.array([True, False])})
    many.reset(seed=1)
    for bad in ([True, False], np.array([True]), np.array([1, 0]), np.array([False, False])):
        with pytest.raises(torquer.Error, match="array of 2 booleans, at least one"):
            many.reset(options={"reset_mask": bad})
    with pytest.raises(torquer.Error, match="renders nothing"):
        torquer.envs.make_vec("ty_phantom", 2, render_mode="rgb_array")


TASK = torquer.envs.Task("side", 40.0)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"within_mm": "1"}, "within_mm is '1'; give a number"),
        ({"at_mm": None}, "at_mm is None; give a number"),
        ({"step_s": True}, "step_s is True; give a number"),
        ({"segment_mm": "x"}, "segment_mm is 'x'; give a number"),
        ({"centerline": 3}, "centerline is 3; give the name"),
        ({"other_targets": None}, "other_targets is None; give a tuple"),
        ({"other_targets": "side"}, "other_targets is 'side'; give a tuple"),
    ],
)
def test_a_task_with_a_value_of_another_type_is_refused(changed, said):
    task = dataclasses.replace(TASK, **changed)
    for make in (torquer.envs.NavigationEnv, lambda scene, task: torquer.envs.VectorEnv(scene, 1, task=task)):
        with pytest.raises(torquer.Error, match=said):
            make("ty_phantom", task)


def test_an_environment_without_a_task_or_an_observation_is_refused():
    with pytest.raises(torquer.Error, match="task is 'side'; give a torquer.envs.Task"):
        torquer.envs.NavigationEnv("ty_phantom", "side")
    for observation in (None, 3, ("vector", None), np.array(3)):
        with pytest.raises(torquer.Error, match="observation is"):
            torquer.envs.NavigationEnv("ty_phantom", TASK, observation)


def test_targets_and_rewards_of_another_type_are_refused():
    env = torquer.envs.NavigationEnv("ty_phantom", TASK, reward=lambda moment: None)
    for target in (("side", "40"), ("side", None), np.array(["side", 40], object), (3, 40)):
        with pytest.raises(torquer.Error, match="target is"):
            env.reset(options={"target": target})
    assert env.reset(seed=0, options={"target": ("side", np.float32(40))})[1]["target_at_mm"] == 40
    with pytest.raises(torquer.Error, match="the reward is None; return a finite number"):
        env.step([1.0, 0.0])


def test_a_reset_mask_resets_only_the_chosen_environments():
    many = torquer.envs.make_vec("ty_phantom", 3)
    twin = torquer.envs.make_vec("ty_phantom", 3)
    for one in (many, twin):
        one.reset(seed=5)
        for _ in range(4):
            before, *_ = one.step(np.full((3, 2), 0.5, np.float32))
    after, info = many.reset(seed=9, options={"reset_mask": np.array([False, True, False])})
    fresh, _ = torquer.envs.make_vec("ty_phantom", 1).reset(seed=10)
    assert np.array_equal(after[[0, 2]], before[[0, 2]]) and np.array_equal(after[1], fresh[0])
    assert info["time_s"] == pytest.approx([0.5, 0.1, 0.5]) and info["env_id"].tolist() == [0, 1, 2]
    # The other environments continue as without the reset.
    rows = np.full((3, 2), 0.5, np.float32)
    assert np.array_equal(many.step(rows)[0][[0, 2]], twin.step(rows)[0][[0, 2]])
    # Those that were not reset keep their random sequence.
    every, _ = many.reset()
    expected, _ = twin.reset()
    assert np.array_equal(every[[0, 2]], expected[[0, 2]])


def calls_of(env, many):
    """Calls that a closed environment refuses."""
    yield from (env.reset, env.render, lambda: env.step([0.0, 0.0]), lambda: env.step("none"))
    yield from (many.reset, many.recv, lambda: many.send([[0.0, 0.0]] * 2), lambda: many.step([[0.0, 0.0]] * 2))
    yield lambda: many.send([], [])


def test_single_and_vector_refuse_calls_after_close():
    env = torquer.envs.make("ty_phantom", render_mode="rgb_array")
    many = torquer.envs.make_vec("ty_phantom", 2, threads=2)
    never = torquer.envs.make_vec("ty_phantom", 2)
    never.close()
    env.reset(seed=1)
    many.reset(seed=1)
    env.step([0.5, 0.0])
    many.send([[0.5, 0.0]] * 2)  # at work while it is closed
    for one in (env, many):
        one.close()
        one.close()
    # A copy of a closed environment is closed too.
    for two in ((env, many), (env, never), copy.deepcopy((env, many)), pickle.loads(pickle.dumps((env, many)))):
        for call in calls_of(*two):
            with pytest.raises(torquer.envs.ClosedEnvironmentError, match=r"\(\) of an environment after close"):
                call()
        for one in two:
            one.close()
    assert issubclass(torquer.envs.ClosedEnvironmentError, torquer.Error)
    assert env.simulation.time_s == pytest.approx(0.2) and env.action_space.shape == (2,)


def test_a_closed_vector_has_no_threads():
    before = len(os.listdir("/proc/self/task"))
    many = torquer.envs.make_vec("ty_phantom", 3, threads=3)
    assert len(os.listdir("/proc/self/task")) == before + 3
    many.close()
    assert len(os.listdir("/proc/self/task")) == before
