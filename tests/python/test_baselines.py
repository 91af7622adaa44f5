"""Policies for the tasks of stEVE_bench: training, files and evaluation."""

import dataclasses
import errno
import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
import torquer
import torquer.baselines as baselines
import torquer.steve as steve


@pytest.fixture
def short(monkeypatch):
    """Short episodes, and small updates."""
    whole = steve.task

    def task(name, training=False):
        return dataclasses.replace(whole(name, True), max_steps=5)

    monkeypatch.setattr(steve, "task", task)
    monkeypatch.setattr(baselines, "_UPDATE_STEPS", 10)
    monkeypatch.setattr(baselines, "_SAMPLES", 40)
    monkeypatch.setattr(baselines, "_TRAINING_STEPS", 4)


def trained(path, name="BasicWireNav", seed=1, realistic=False):
    pytest.importorskip("torch")
    return baselines.train(name, str(path), realistic, 24, seed)


def test_a_policy_is_trained_by_the_seed_and_read_again(short, tmp_path):
    policy = trained(tmp_path / "a.npz")
    read = baselines.load(str(tmp_path / "a.npz"))
    assert (read.task, read.realistic, read.seed) == ("BasicWireNav", False, 1)
    # Each update has three episodes of 4 steps. The teacher steers in the first one.
    assert read.curve[:, 0].tolist() == [12, 24] and read.curve[0, 1] == 0
    env = steve.SteveEnv("BasicWireNav")
    observation, info = env.reset(seed=1)
    acts = [one.begin(env, info) for one in (policy, read)]
    for _ in range(3):
        shares, same = (act(observation) for act in acts)
        assert (shares == same).all() and shares.shape == (1, 2) and (abs(shares) <= 1).all()
        observation, *_ = env.step(shares * env.action_space.high)
    again, other = trained(tmp_path / "b.npz"), trained(tmp_path / "c.npz", seed=2)
    assert all((a == b).all() for a, b in zip(policy.weights, again.weights))
    assert any((a != b).any() for a, b in zip(policy.weights, other.weights))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz", "b.npz", "c.npz"]


def test_a_policy_acts_as_its_network(short, tmp_path):
    """The network in PyTorch, from the first step of an episode on."""
    torch = pytest.importorskip("torch")
    policy = trained(tmp_path / "a.npz", "DualDeviceNav", realistic=True)
    width, inputs = policy.weights[0].shape
    layers = torch.nn.Linear(inputs, width), torch.nn.GRU(width, width), torch.nn.Linear(width, 4)
    network = torch.nn.ModuleList(layers)
    for own, weight in zip(network.parameters(), policy.weights):
        own.data = torch.tensor(weight)
    seen = np.random.default_rng(1).normal(size=(5, inputs)).astype(np.float32)
    with torch.no_grad():
        expected = torch.tanh(layers[2](layers[1](torch.tanh(layers[0](torch.tensor(seen))))[0])).numpy()
    memory = np.zeros(width, np.float32)
    for x, shares in zip(seen, expected):
        memory, found = policy.step(x, memory)
        assert found == pytest.approx(shares, abs=1e-5)
    assert len(found) == 4


def test_a_network_learns_the_actions_of_lessons(monkeypatch):
    """Lessons of 6 to 30 steps, whose action is a feature of the step before."""
    torch = pytest.importorskip("torch")
    monkeypatch.setattr(baselines, "_SAMPLES", 60_000)
    torch.manual_seed(1)
    random = np.random.default_rng(1)
    lessons = []
    for count in range(6, 31):
        seen = random.uniform(-0.8, 0.8, (count + 1, 2)).astype(np.float32)
        lessons.append((seen[1:], seen[:-1, :1] * (np.arange(count) > 0)[:, None]))
    network = torch.nn.ModuleList([torch.nn.Linear(2, 16), torch.nn.GRU(16, 16), torch.nn.Linear(16, 1)])
    adam = torch.optim.Adam(network.parameters(), lr=1e-2)

    def error():
        policy = baselines.Policy("BasicWireNav", False, 1, baselines._weights(network), np.zeros((1, 4)))
        squares = []
        for seen, wanted in lessons:
            memory = np.zeros(16, np.float32)
            for x, one in zip(seen, wanted):
                memory, found = policy.step(x, memory)
                squares.append(float((found - one) @ (found - one)))
        return np.mean(squares)

    before = error()
    baselines._learn(torch, network, adam, lessons, random)
    assert error() < 0.2 * before


def test_an_episode_begins_without_memory():
    env = steve.SteveEnv("BasicWireNav")
    observation, info = env.reset(seed=1)
    inputs, random = len(baselines._Senses()(observation)), np.random.default_rng(1)
    shapes = [(4, inputs), (4,), (12, 4), (12, 4), (12,), (12,), (2, 4), (2,)]
    policy = baselines.Policy("BasicWireNav", False, 1, [random.normal(size=shape) for shape in shapes], np.zeros((1, 4)))
    act, other = policy.begin(env, info), policy.begin(env, info)
    first, second = act(observation), act(observation)
    assert (first != second).all() and (other(observation) == first).all()


def test_the_sums_of_the_senses_are_those_of_the_wire():
    """Place and rotation of the hand, from the actions in the observations."""
    env = steve.SteveEnv("BasicWireNav")
    observation, _ = env.reset(seed=3, options={"rotation_rad": 0.0})
    senses = baselines._Senses()
    senses(observation)
    for shares in ([1.0, 0.4], [0.5, -1.0], [-0.3, -0.7]):
        observation, *_ = env.step(np.array([shares]) * env.action_space.high)
        x = senses(observation)
    fed_mm, turned_rad = env.simulation.hands[0]
    assert x[-5] == pytest.approx(fed_mm / 200, abs=1e-6)
    assert x[-9:-7] == pytest.approx([math.cos(turned_rad), math.sin(turned_rad)], abs=1e-6)


def test_the_teacher_reaches_targets_that_pushing_misses():
    """A target in each artery."""
    env = steve.SteveEnv("BasicWireNav", task=dataclasses.replace(steve.task("BasicWireNav", True), max_steps=150))
    for target in (("curve_11", 40.0), ("lcca", 60.0), ("rcca", 30.0), ("curve_18", 30.0)):
        observation, info = env.reset(seed=1, options={"target": target, "rotation_rad": -1.0})
        act, ended = baselines.taught(env, info), False
        while not ended:
            observation, _, terminated, truncated, info = env.step(act(observation) * env.action_space.high)
            ended = terminated or truncated
        assert info["success"], target


def test_the_teacher_withdraws_from_a_wrong_artery():
    env = steve.SteveEnv("BasicWireNav", task=steve.task("BasicWireNav", True))
    # Pushing alone enters the left subclavian artery.
    _, info = env.reset(seed=1, options={"target": ("lcca", 60.0), "rotation_rad": 1.57})
    while env.simulation.hands[0, 0] < 215:
        env.step([[35.0, 0.0]])
    act = baselines.taught(env, info)
    shares = act({})
    assert shares.tolist() == [[-1.0, 0.0]]


def test_outer_instruments_follow_the_wire():
    env = steve.SteveEnv("DualDeviceNav", task=steve.task("DualDeviceNav", True))
    _, info = env.reset(seed=1)
    act = baselines.taught(env, info)
    for _ in range(15):
        env.step(act({}) * env.action_space.high)
    wire_mm, catheter_mm = env.simulation.hands[:, 0]
    assert wire_mm > 40 and wire_mm - catheter_mm == pytest.approx(30, abs=5) and env.simulation.hands[1, 1] == 0


def test_a_policy_of_another_build_is_refused(short, tmp_path, monkeypatch):
    path = str(tmp_path / "a.npz")
    with monkeypatch.context() as other:
        other.setattr(baselines, "__build__", "0123abc")
        trained(path)
    with pytest.raises(torquer.Error, match=f"a.npz: is a policy of the build 0123abc, but this is {torquer.__build__}; train"):
        baselines.load(path)


def test_a_file_that_is_no_policy_is_refused(tmp_path):
    (tmp_path / "text.npz").write_text("no policy")
    np.savez(tmp_path / "other.npz", about=np.array("{}"))
    (tmp_path / "cut.npz").write_bytes((tmp_path / "other.npz").read_bytes()[:60])
    two = [np.zeros((2, 2)), np.zeros(2)]
    baselines.Policy("BasicWireNav", False, 1, two, np.zeros((1, 4))).save(str(tmp_path / "two.npz"))
    for name in ("text", "other", "cut", "two"):
        with pytest.raises(torquer.Error, match=f"{name}.npz: is no policy; give a file that torquer train wrote"):
            baselines.load(str(tmp_path / f"{name}.npz"))
    with pytest.raises(torquer.Error, match="missing.npz: cannot be read"):
        baselines.load(str(tmp_path / "missing.npz"))


def failing(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_policy_that_cannot_be_written_leaves_nothing(tmp_path, monkeypatch):
    policy = baselines.Policy("BasicWireNav", False, 1, [np.zeros((2, 2)), np.zeros(2)], np.zeros((1, 4)))
    with pytest.raises(torquer.Error, match="a.npz: there is no folder .*none; make it first"):
        policy.save(str(tmp_path / "none" / "a.npz"))
    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises(torquer.Error, match="a.npz: cannot be written .No space left.*; check the disk and permissions"):
        policy.save(str(tmp_path / "a.npz"))
    assert list(tmp_path.iterdir()) == []


def test_no_file_of_a_user_is_replaced(short, tmp_path, monkeypatch):
    """A file of the name of the policy, which was there before or came during the training, and one beside it."""
    beside, path = tmp_path / "a.npz.part", tmp_path / "a.npz"
    beside.write_text("of the user")
    trained(path)
    with pytest.raises(torquer.Error, match="a.npz: exists already; move it away, or give another name"):
        trained(path)
    with pytest.raises(torquer.Error, match="a.npz: exists already"):
        baselines.load(str(path)).save(str(path))

    def updates(name, realistic, steps, seed):
        (tmp_path / "b.npz").write_text("of the user")
        yield 1, 0, 0, [np.zeros((2, 2)), np.zeros(2)]

    monkeypatch.setattr(baselines, "_updates", updates)
    with pytest.raises(torquer.Error, match="b.npz: exists already"):
        baselines.train("BasicWireNav", str(tmp_path / "b.npz"), False, 1, 1)
    assert beside.read_text() == (tmp_path / "b.npz").read_text() == "of the user"
    assert baselines.load(str(path)).seed == 1


def test_an_evaluation_counts_the_held_out_episodes(monkeypatch):
    """A stand-in for the environment has known results."""
    made = []

    class Stand:
        action_space = steve.SteveEnv("BasicWireNav").action_space
        largest_mN = 40.0

        def __init__(self, name, realistic, task):
            made.append((name, realistic, task))
            self.seeds = []

        def reset(self, seed):
            self.seeds.append(seed)
            self.step_count = 0
            made[0] += (seed,)
            zeros = {"tracking": np.zeros((2, 3, 2)), "target": np.zeros(2), "last_action": np.zeros((1, 2))}
            return zeros, {"time_s": 0.5, "at_end": False}

        def step(self, action):
            assert action == pytest.approx(np.array([[35.0, 0.0]]))
            self.step_count += 1
            k = len(self.seeds) - 1
            end = self.step_count == 3
            info = {
                "success": end and k != 1,
                "safe_success": {0: True, 1: False, 2: None}[k] if end else False,
                "time_s": 0.5 + (k + 1) * self.step_count,
                "path_ratio": 0.25 * (k + 1),
                "wall_force_mN": self._force_mN(k),
                "target": "lcca",
                "at_end": self.step_count == 2,
            }
            return self._none(), 0.0, end and k != 1, end and k == 1, info

        def _force_mN(self, k):
            if math.isnan(Stand.largest_mN):
                return math.nan
            return [10.0 * (k + 1), math.nan if k == 2 else Stand.largest_mN, 5.0][self.step_count - 1]

        def _none(self):
            return {"tracking": np.zeros((2, 3, 2)), "target": np.zeros(2), "last_action": np.zeros((1, 2))}

    monkeypatch.setattr(steve, "SteveEnv", Stand)
    found = baselines.evaluate("BasicWireNav", True, baselines.pushed, 3)
    name, realistic, task, *seeds = made[0]
    assert (name, realistic, task.max_steps, task.tolerance) == ("BasicWireNav", True, 1000, 1e-4)
    assert seeds == [1_000_000, 1_000_001, 1_000_002]
    assert (found["reached"], found["safe"], found["safety_unknown"], found["episodes"]) == (2, 1, 1, 3)
    # Episodes 0 and 2 last for 3 and 9 s.
    assert found["time_s"] == pytest.approx(6) and found["path_ratio"] == pytest.approx(0.5)
    assert (found["force_p50_mN"], found["force_max_mN"], found["steps_of_unknown_force"]) == (40, 40, 1)
    # The third step of each episode begins at an end of the vessel, and does not count.
    assert found["steps"] == 6 and found["steps_core_s"] > 0
    table = baselines.as_table([{**found, "policy": "only pushed", "steps_core_s": 800.4}]).splitlines()
    assert table[2] == "| BasicWireNav, realistic | only pushed | 2 of 3 | 1, 1 | 6.0 | 0.50 | 40, 40 | 800 |"
    # No force is known in any step.
    monkeypatch.setattr(Stand, "largest_mN", math.nan)
    found = baselines.evaluate("BasicWireNav", True, baselines.pushed, 3)
    assert (found["force_p50_mN"], found["force_max_mN"], found["steps_of_unknown_force"]) == (None, None, 9)
    table = baselines.as_table([{**found, "policy": "only pushed", "steps_core_s": 800.4}]).splitlines()
    assert table[2].endswith("| 0.50 | - | 800 |")


def test_evaluations_repeat(short, tmp_path):
    policy = trained(tmp_path / "a.npz", "ArchVariety")
    begins = policy.begin, policy.begin, baselines.pushed
    first, again, pushed = (baselines.evaluate("ArchVariety", False, begin, 3) for begin in begins)
    for found in (first, again, pushed):
        del found["steps_core_s"]
    assert first == again and first["steps"] == 15
    assert first["reached"] == 0 and first["time_s"] is None
    assert first != pushed


def torquer_command(*arguments):
    return subprocess.run(
        [sys.executable, "-B", "-m", "torquer", *arguments], capture_output=True, text=True, timeout=120, check=False
    )


def test_the_command_refuses_bad_arguments(tmp_path):
    for arguments, message in (
        (["evaluate"], "there is nothing to test; give a POLICY, --pushed TASK or --taught TASK"),
        (["evaluate", "--pushed", "Basic"], "there is no task 'Basic' of stEVE_bench"),
        (["evaluate", "--realistic", "a.npz"], "--realistic is for --pushed and --taught"),
        (["evaluate", "--taught", "Basic"], "there is no task 'Basic' of stEVE_bench"),
        (["evaluate", "--pushed", "BasicWireNav", "--episodes", "0"], "episodes is 0; give a whole number from 1"),
        (["evaluate", str(tmp_path / "none.npz")], "none.npz: cannot be read"),
        (["train", "Basic", str(tmp_path / "a.npz")], "there is no task 'Basic' of stEVE_bench"),
        (["train", "BasicWireNav", str(tmp_path / "a.npz"), "--steps", "0"], "steps is 0; give a whole number from 1"),
        (["train", "BasicWireNav", str(tmp_path / "no/a.npz"), "--steps", "1"], "there is no folder"),
    ):
        done = torquer_command(*arguments)
        assert done.returncode == 2 and message in done.stderr and done.stdout == "", (arguments, done.stderr)
    assert not list(tmp_path.iterdir())


def test_the_command_prints_one_line_of_json(tmp_path, monkeypatch, capsys, short):
    import torquer.__main__ as program

    monkeypatch.setattr(sys, "argv", ["torquer", "evaluate", "--pushed", "BasicWireNav", "--episodes", "2", "--json"])
    assert program.main() == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["task"], row["policy"], row["episodes"], row["reached"]) == ("BasicWireNav", "only pushed", 2, 0)
