"""Pickles of simulations and environments: they continue to the bit, and damaged ones are refused."""

import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
import torquer
import torquer.envs
import torquer.steve

TASK = torquer.envs.Task("side", 40.0, max_steps=12, other_targets=(("main", 100.0, 140.0),))


def reward_of(moment):
    return moment.reward + moment.simulation.time_s


@pytest.fixture(scope="module")
def moved():
    simulation = torquer.Simulation("ty_phantom")
    hands = simulation.hands
    for k in range(5):
        hands += [[2.0, 0.3]]
        simulation.step(0.1 * (k + 1), hands, after_tick=lambda _: None)
    return simulation


def test_a_simulation_continues_in_another_process(moved, tmp_path):
    file = tmp_path / "pickle"
    file.write_bytes(pickle.dumps(moved))
    code = (
        "import pickle, sys; s = pickle.load(open(sys.argv[1], 'rb')); "
        "s.step(0.6, s.hands + [[1.0, 0.1]]); print(s.state_hash, s.scene.path)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(file)], env=os.environ, capture_output=True, text=True, check=True)
    twin = copy.copy(moved)
    twin.step(0.6, twin.hands + [[1.0, 0.1]])
    assert done.stdout.split() == [str(twin.state_hash), moved.scene.path]


def test_a_scene_with_negative_zeros_is_itself_again():
    # A tool that writes numbers with a fixed count of digits writes -0.000000.
    text = """name = "zeros"
[vessel]
kind = "tubes"
wall_stiffness_N_mm2 = 10
[[vessel.tube]]
name = "main"
points_mm = [[-0.0, -0.0, -0.0], [100.0, -0.0, -0.0]]
radii_mm = 3.0
[entry]
point_mm = [5.0, -0.0, -0.0]
direction = [1.0, -0.0, -0.0]
[[instrument]]
name = "guidewire"
max_length_mm = 50
from_tip_mm = [0.0, 20.0]
radius_mm = 0.4
rigidity_N_mm2 = 10.0
curvature_1_per_mm = [0.02, -0.0]
[[instrument]]
name = "second"
max_length_mm = 50
radius_mm = 0.3
rigidity_N_mm2 = 10.0
curvature_2_per_mm = -0.0
[instrument.entry]
point_mm = [5.0, -0.0, 1.0]
direction = [1.0, -0.0, -0.0]
"""
    scene = torquer.Scene.from_text(text)
    assert pickle.loads(pickle.dumps(scene)).content_hash == scene.content_hash


def test_an_exchanged_simulation_is_copied_pickled_and_restored():
    scene = torquer.Scene("ty_phantom")
    simulation = torquer.Simulation(scene)
    before = simulation.copy()
    simulation.step(0.1, [[5.0, 0.0]])
    with pytest.raises(torquer.Error, match="guidewire is inserted by 5 mm.*withdraw it to 0 mm first"):
        simulation.exchange("guidewire", "sion")
    simulation.step(0.2, [[0.0, 0.0]])
    with pytest.raises(torquer.Error, match='did you mean "sion_blue"'):
        simulation.exchange("guidewire", "sion_bleu")
    simulation.exchange("guidewire", "sion")
    assert simulation.scene.instruments[0].tip_radius_mm == 0.1778
    assert simulation.scene_at_start.content_hash == scene.content_hash != simulation.scene.content_hash
    simulation.step(0.4, [[40.0, 0.3]])
    restored = before.copy()
    restored.restore(simulation)
    for twin in (pickle.loads(pickle.dumps(simulation)), copy.deepcopy(simulation), restored):
        twin.step(0.6, [[45.0, 0.1]])
        one = simulation.copy()
        one.step(0.6, [[45.0, 0.1]])
        assert twin.state_hash == one.state_hash
        assert twin.scene.content_hash == simulation.scene.content_hash
        twin.restore(before)
        assert twin.state_hash == before.state_hash and twin.scene.content_hash == scene.content_hash
    simulation.restart()
    assert simulation.state_hash == torquer.Simulation(scene).state_hash


def test_damaged_and_foreign_pickles_are_refused(moved):
    scene, saved = moved.__getstate__()
    blank = torquer.Simulation.__new__(torquer.Simulation)
    foreign = saved.replace(torquer.__build__.encode(), b"0" * 40)
    for bad in (saved[:-1], b"", foreign, saved[:60] + b"?" + saved[61:]):
        with pytest.raises(torquer.Error, match="damaged|not a saved"):
            blank.__setstate__((scene, bad))
    for bad in ((), (scene,), (saved, scene), (scene, saved, 1), (torquer.Scene("drill_tube"), saved)):
        with pytest.raises(torquer.Error, match="damaged|other contents"):
            blank.__setstate__(bad)
    blank = torquer.Scene.__new__(torquer.Scene)
    for bad in ((), ("name = 1",), (1, 2, 3, 4), (scene.text, scene.folder, "x", "y")):
        with pytest.raises(torquer.Error, match="pickled scene is damaged"):
            blank.__setstate__(bad)
    env = torquer.envs.NavigationEnv("ty_phantom", TASK)
    env.reset(seed=1)
    given, task, state = env._navigation.__getstate__()
    blank = torquer._torquer.Navigation.__new__(torquer._torquer.Navigation)
    cases = [(given, task, (*state[:k], None, *state[k + 1 :])) for k in range(len(state))]
    cases += [(), (given, task), (given, (1, 2), state), (given, task, ()), (given, task, (*state[:3], 10**6, *state[4:]))]
    for bad in cases:
        with pytest.raises(torquer.Error, match="damaged|route"):
            blank.__setstate__(bad)


def test_an_environment_continues_with_its_targets_and_rotations():
    env = torquer.envs.NavigationEnv("ty_phantom", TASK, render_mode="rgb_array", reward=reward_of)
    env.reset(seed=3)
    for _ in range(3):
        env.step([1.0, 0.3])
    for twin in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        original = copy.deepcopy(env)
        for k in range(20):
            got, expected = ((one.step([1.0, 0.2]) if k % 10 < 9 else (*one.reset(), None)) for one in (twin, original))
            assert np.array_equal(got[0], expected[0]) and got[1:] == expected[1:]
        assert np.array_equal(twin.render(), original.render())
        assert twin.simulation.state_hash == original.simulation.state_hash


def test_a_vector_continues_and_is_not_pickled_at_work():
    many = torquer.envs.VectorEnv("ty_phantom", 3, task=TASK, reward=reward_of)
    many.reset(seed=5)
    rows = np.full((3, 2), 0.5, np.float32)
    for _ in range(4):
        many.step(rows)
    many.reset(options={"reset_mask": np.array([False, True, False])})
    twin = pickle.loads(pickle.dumps(many))
    for _ in range(14):  # past the end of the episodes
        expected, got = many.step(rows), twin.step(rows)
        for one, other in zip(expected[:4], got[:4]):
            assert np.array_equal(one, other)
        assert all(np.array_equal(expected[4][name], got[4][name], equal_nan=expected[4][name].dtype.kind == "f") for name in expected[4])
    many.send(rows)
    with pytest.raises(torquer.Error, match="call recv"):
        pickle.dumps(many)
    many.recv()


def course(env):
    """Observations of two resets with random targets, and of steps."""
    seen = []
    for _ in range(2):
        seen.append(env.reset()[0])
        for _ in range(3):
            seen.append(env.step(np.full(env.action_space.shape, 0.5, np.float32))[0])
    return [part for one in seen for part in (one.values() if isinstance(one, dict) else [one])]


@pytest.mark.parametrize(
    "make",
    [
        lambda: torquer.envs.NavigationEnv("ty_phantom", TASK),
        lambda: torquer.envs.VectorEnv("ty_phantom", 2, task=TASK),
        lambda: torquer.steve.SteveEnv("BasicWireNav"),
    ],
    ids=["one", "vector", "steve"],
)
def test_a_copied_environment_shares_nothing_with_its_original(make):
    env = make()
    env.reset(seed=4)
    twin, other = copy.copy(env), copy.deepcopy(env)
    expected = course(twin)
    for one in (env, other):
        assert all(map(np.array_equal, course(one), expected))


def test_copies_of_a_scene_share_it():
    scene = torquer.Scene("ty_phantom")
    for twin in (copy.copy(scene), copy.deepcopy(scene)):
        assert twin.content_hash == scene.content_hash and twin.path == scene.path
