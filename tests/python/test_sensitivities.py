"""Derivatives of a simulation's states by values of its scene, against differences of whole runs."""

import copy
import pickle

import numpy as np
import pytest
import torquer

SCENE = """name = "small"
[vessel]
kind = "ty_phantom"
wall_stiffness_N_mm2 = 0.5
[entry]
centerline = "main"
at_mm = 1
[[instrument]]
name = "guidewire"
max_length_mm = 200
radius_mm = 0.2
tip_mm = 10
tip_angle_deg = 30
rigidity_N_mm2 = 0.02
inserted_at_start_mm = 110
[relaxation]
tolerance = 1e-9
[effects.friction]
coefficient = 0.2
[effects.wall_force]
threshold_mN = 10
"""
TIP = "instrument.guidewire.tip_angle_deg"
FRICTION = "effects.friction.coefficient"


@pytest.fixture(scope="module")
def scene():
    return torquer.Scene.from_text(SCENE)


def drive(simulation, millimeters, steps=20):
    hands = simulation.hands
    for _ in range(steps):
        hands[0, 0] += millimeters / steps
        simulation.step(simulation.time_s + 0.1, hands)
    return simulation


def to_and_fro(scene, keys=()):
    simulation = torquer.Simulation(scene)
    simulation.track_sensitivities(keys)
    return drive(drive(simulation, 4), -2)


@pytest.mark.parametrize("key, value, step", [(TIP, 30.0, 3e-3), (FRICTION, 0.2, 2e-4)])
def test_derivatives_are_those_of_whole_runs(scene, key, value, step):
    found = to_and_fro(scene, [key]).sensitivities()[key]
    assert found.unknown is None and found.key == key and found.value == value
    more, less = (to_and_fro(scene.with_values({key: value + sign * step})) for sign in (1, -1))
    for ours, theirs in ((found.nodes_mm, [more.nodes_mm, less.nodes_mm]), (found.tips_mm, [more.tips_mm, less.tips_mm])):
        expected = (theirs[0] - theirs[1]) / (2 * step)
        assert np.abs(expected).max() * value > 1e-3
        assert np.abs(ours - expected).max() < 1e-2 * np.abs(expected).max()
    upper, lower = more.readings(), less.readings()
    for name in ("wall_force_sum_mN", "wall_force_tip_mN"):
        expected = (upper[name] - lower[name]) / (2 * step)
        assert found.readings[name] == pytest.approx(expected, rel=2e-2, abs=1e-6), name


def test_unknown_derivatives_are_none(scene):
    simulation = torquer.Simulation(scene.with_values({"relaxation.budget_units": 5}))
    simulation.track_sensitivities([TIP])
    drive(simulation, 20, 1)
    found = simulation.sensitivities()[TIP]
    assert found.unknown and found.nodes_mm is None and found.tips_mm is None and found.readings is None
    assert found.unknown_since_s == 0.1 and found.first_unknown == found.unknown and "unknown_since_s=0.1" in repr(found)
    drive(simulation, 1, 3)
    later = simulation.sensitivities()[TIP]
    assert later.unknown_since_s == 0.1 and later.first_unknown == found.unknown
    known = to_and_fro(scene, [TIP]).sensitivities()[TIP]
    assert known.unknown_since_s is None and known.first_unknown is None


def test_tracking_begins_at_the_start_and_copies_keep_it(scene):
    simulation = to_and_fro(scene)
    assert simulation.sensitivities() == {}
    with pytest.raises(torquer.Error, match="call Restart first|restart"):
        simulation.track_sensitivities([TIP])
    with pytest.raises(torquer.Error, match="no number with the key"):
        torquer.Simulation(scene).track_sensitivities(["instrument.guidewire.rigidity"])
    tracked = to_and_fro(scene, [TIP])
    assert tracked.state_hash == simulation.state_hash
    same = copy.copy(tracked).sensitivities()[TIP]
    assert np.array_equal(same.nodes_mm, tracked.sensitivities()[TIP].nodes_mm)
    assert pickle.loads(pickle.dumps(tracked)).sensitivities() == {}
