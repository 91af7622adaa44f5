"""Rendering, and registration with Gymnasium."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import torquer
import torquer.envs

# The part of Gymnasium that the package uses.
GYMNASIUM = """
import types
import numpy as np

class Env:
    _np_random = None
    def reset(self, *, seed=None, options=None):
        self._np_random = np.random.default_rng(seed)

class VectorEnv:
    closed = False

class ClosedEnvironmentError(Exception):
    pass

class Box:
    def __init__(self, low, high, shape=None, dtype=None):
        self.dtype = np.dtype(dtype)
        self.shape = np.shape(low) if shape is None else shape
        self.low = np.broadcast_to(np.asarray(low, dtype), self.shape)
        self.high = np.broadcast_to(np.asarray(high, dtype), self.shape)

error = types.SimpleNamespace(ClosedEnvironmentError=ClosedEnvironmentError)
vector = types.SimpleNamespace(VectorEnv=VectorEnv)
spaces = types.SimpleNamespace(Box=Box, Dict=dict)
registry = {}

def register(id, **keys):
    assert id not in registry
    registry[id] = keys
"""

CLIENT = """
import dataclasses, importlib, json
import gymnasium
import torquer
import torquer.arches
import torquer.steve
import torquer.trees

ids = {}
drawn = {"torquer/Arches-v0": torquer.arches.TASK, "torquer/Trees-v0": torquer.trees.task()}
for id, keys in gymnasium.registry.items():
    json.dumps(keys)
    made = {}
    for point in ("entry_point", "vector_entry_point"):
        if point in keys:
            module, name = keys[point].split(":")
            made[point] = getattr(importlib.import_module(module), name)
    given = keys.get("kwargs", {})
    tasks = {**torquer.envs.TASKS, **{name: torquer.steve.task(name) for name in torquer.steve.NAMES}}
    task = dataclasses.replace(tasks[given["name"]] if given else drawn[id], max_steps=7)
    one = made["entry_point"](**given, task=task)
    assert one.task.max_steps == 7
    ids[id] = [one.scene.name, isinstance(one, gymnasium.Env)]
    if "vector_entry_point" in made:
        many = made["vector_entry_point"](**given, task=task, num_envs=2)
        assert many.task.max_steps == 7 and many.num_envs == 2
        ids[id].append(isinstance(many, gymnasium.vector.VectorEnv))
        many.close()
        try:
            many.reset()
        except gymnasium.error.ClosedEnvironmentError as error:
            assert isinstance(error, torquer.Error)
        else:
            raise AssertionError("a closed vector has begun")
torquer.envs.register()
print(json.dumps(ids))
"""


def test_the_import_registers_every_task(tmp_path):
    (tmp_path / "gymnasium.py").write_text(GYMNASIUM)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        [sys.executable, "-B", "-c", CLIENT],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == {
        "torquer/TyPhantom-v0": ["ty_phantom", True, True],
        "torquer/NeuroArch-v0": ["neuro_arch", True, True],
        "torquer/Coronary-v0": ["coronary", True, True],
        "torquer/Arches-v0": ["arch_bovine", True, True],
        "torquer/Trees-v0": ["tree_3", True, True],
        "torquer/BasicWireNav-v0": ["basic_wire_nav", True],
        "torquer/BasicWireNavRealistic-v0": ["basic_wire_nav", True],
        "torquer/ArchVariety-v0": ["arch_III", True],
        "torquer/ArchVarietyRealistic-v0": ["arch_III", True],
        "torquer/DualDeviceNav-v0": ["dual_device_nav", True],
        "torquer/DualDeviceNavRealistic-v0": ["dual_device_nav", True],
    }


def pixels(picture, color):
    return np.argwhere((picture == color).all(axis=2))


def test_a_scene_without_xray_renders_the_wire_in_the_vessel():
    env = torquer.envs.make("ty_phantom", render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    for _ in range(20):
        env.step([1.0, 0.0])
    last = env.render()
    assert first.dtype == np.uint8 and first.shape == last.shape and max(first.shape) == 400
    # The wire is 40 mm longer. A wire along the picture covers a pixel for each.
    low, high = env.scene.bounds_mm
    px_per_mm = 399 / max(high - low)
    wire = (240, 240, 240)
    grown = len(pixels(last, wire)) - len(pixels(first, wire))
    assert grown == pytest.approx(40 * px_per_mm, rel=0.1)
    # All of it lies in the lumen.
    lumen = (96, 58, 58)
    for row, column in pixels(last, wire):
        near = first[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3].reshape(-1, 3)
        assert (near == lumen).all(axis=1).any() or (near == wire).all(axis=1).any()


def test_the_head_of_a_patient_is_at_the_top():
    env = torquer.envs.make("neuro_arch", render_mode="rgb_array")
    env.reset(seed=1)
    rows = pixels(env.render(), (240, 240, 240))[:, 0]
    # The wire comes from the groin. The target is in a carotid artery.
    target = pixels(env.render(), (80, 220, 120))[:, 0]
    assert rows.max() > 350 and target.mean() < rows.min()


def test_a_window_shows_each_step(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    pytest.importorskip("matplotlib")
    shown = []
    monkeypatch.setattr(torquer.envs.Window, "show", lambda self, picture: shown.append(picture.copy()))
    env = torquer.envs.make("ty_phantom", render_mode="human")
    env.reset(seed=1)
    for _ in range(3):
        env.step([1.0, 0.0])
    assert env.render() is None
    env.close()
    env.close()
    assert len(shown) == 4 and not np.array_equal(shown[0], shown[-1])
    with pytest.raises(torquer.Error, match="'ansi'; give None, 'rgb_array' or 'human'"):
        torquer.envs.make("ty_phantom", render_mode="ansi")
