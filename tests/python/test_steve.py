"""Tasks of stEVE_bench. Expected values are those of its published sources."""

import dataclasses
import json
import math
import pathlib
import pickle
import tomllib

import numpy as np
import pytest
import torquer
import torquer.envs
import torquer.steve as steve

CURVES = pathlib.Path(torquer.scene_path("neuro_arch")).parent / "meshes/neuro_arch/centerlines"
ALL = [(name, realistic) for name in steve.NAMES for realistic in (False, True)]


def fast(name, **changes):
    return dataclasses.replace(steve.task(name, training=True), **changes)


def curves():
    """Points and radii of each centerline in the files."""
    found = {}
    for path in CURVES.glob("*.mrk.json"):
        curve = json.loads(path.read_text())["markups"][0]
        radii = next(each for each in curve["measurements"] if each["name"] == "Radius")["controlPointValues"]
        points = np.array([point["position"] for point in curve["controlPoints"]])
        found[path.name.split(".")[0]] = points, np.array(radii)
    return found


def test_limits_are_those_of_the_definition():
    for name in steve.NAMES:
        env = steve.SteveEnv(name)
        count = 2 if name == "DualDeviceNav" else 1
        assert env.action_space.high == pytest.approx(np.tile([35, 3.14], (count, 1)))
        assert (env.action_space.low == -env.action_space.high).all()
        assert (env.task.within_mm, env.task.max_steps) == (5, 1000)
        assert env.task.step_s == pytest.approx(1 / 7.5)
        longest = [each.max_length_mm for each in env.scene.instruments]
        assert longest == ([900, 900] if count == 2 else [450])
        # None is inside at the start.
        env.reset(seed=1)
        assert (env.simulation.hands[:, 0] == 0).all()


def test_devices_and_friction_are_those_of_the_definition():
    wire, pair = steve.SteveEnv("ArchVariety"), steve.SteveEnv("DualDeviceNav")
    assert tomllib.loads(steve.SteveEnv("BasicWireNav").scene.text)["instrument"] == tomllib.loads(wire.scene.text)["instrument"]
    found = tomllib.loads(wire.scene.text)
    assert found["effects"]["friction"]["coefficient"] == 0.1
    assert tomllib.loads(pair.scene.text)["effects"]["friction"]["coefficient"] == 0.001
    guidewire = found["instrument"][0]
    # Moduli of 17 and 80 MPa, diameters of 0.7 and 0.89 mm. I of a round section is pi d^4 / 64.
    assert guidewire["rigidity_N_mm2"] == pytest.approx([0.20036, 0.20036, 2.46390], rel=1e-4)
    assert guidewire["radius_mm"] == pytest.approx([0.35, 0.35, 0.445])
    assert guidewire["torsional_rigidity_ratio"] == pytest.approx(1 / 1.49, rel=1e-3)
    assert (guidewire["tip_mm"], guidewire["tip_angle_deg"]) == pytest.approx((12.1 * 0.4 * math.pi, 72), rel=1e-4)
    microwire, microcatheter = tomllib.loads(pair.scene.text)["instrument"]
    assert microwire["radius_mm"] == pytest.approx([0.18] * 3)
    assert microcatheter["radius_mm"] == pytest.approx([0.3, 0.3, 0.35])
    assert microcatheter["inner_radius_mm"] == pytest.approx(0.285)
    # 1 MPa, 0.6 and 0.7 mm outside, 0.57 mm inside.
    assert microcatheter["rigidity_N_mm2"] == pytest.approx([0.00118006, 0.00118006, 0.00660424], rel=1e-4)


def test_a_realistic_task_differs_only_in_its_devices_and_effects():
    for name in steve.NAMES:
        texts = [tomllib.loads(steve.SteveEnv(name, realistic).scene.text) for realistic in (False, True)]
        for text in texts:
            del text["instrument"], text["effects"], text["relaxation"]
        assert texts[0] == texts[1]
        coefficients, tips = zip(
            *[
                (torquer_scene["effects"]["friction"]["coefficient"], torquer_scene["instrument"][0]["tip_angle_deg"])
                for torquer_scene in (tomllib.loads(steve.SteveEnv(name, realistic).scene.text) for realistic in (False, True))
            ]
        )
        assert coefficients[1] == 0.08 != coefficients[0] and tips[0] == tips[1]


def test_targets_lie_outside_of_all_other_vessels():
    files = curves()
    for name, others in (("BasicWireNav", {"curve_00", "curve_02"}), ("DualDeviceNav", set(files))):
        env = steve.SteveEnv(name, task=fast(name))
        drawn = set()
        for seed in range(40):
            _, info = env.reset(seed=seed)
            drawn.add(info["target"])
        assert len(drawn) == 4
        for vessel, low, high in env.task.other_targets:
            points, _ = files[vessel]
            arcs = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
            for end, inwards in ((low, 0.5), (high, -0.5)):
                place = np.array([np.interp(end + inwards, arcs, points[:, axis]) for axis in range(3)])
                for other in others - set(drawn):
                    line, radii = files[other]
                    assert (np.linalg.norm(line - place, axis=1) > radii - 0.5).all(), (name, vessel, end, other)


def test_arches_have_the_branches_of_the_definition():
    env = steve.SteveEnv("ArchVariety", task=fast("ArchVariety"), arch_count=3)
    seen, drawn = set(), set()
    for seed in range(40):
        _, info = env.reset(seed=seed)
        seen.add(env.scene.content_hash)
        drawn.add(info["target"])
    assert len(seen) == 3
    assert drawn == {"brachiocephalic", "lcca", "rcca", "lsa", "rsa"}
    env = steve.SteveEnv("ArchVariety", task=fast("ArchVariety"))
    names = set()
    # The kept arches are those of the seeds 0 to 2.
    for seed in range(100, 112):
        env.reset(seed=seed)
        names.add(env.scene.name)
        seen.add(env.scene.content_hash)
    assert len(seen) == 15 and names == {"arch_I", "arch_II", "arch_III"}


def test_a_step_moves_the_hands_at_the_speeds():
    env = steve.SteveEnv("DualDeviceNav", task=fast("DualDeviceNav"))
    env.reset(seed=1)
    before = env.simulation.hands
    time_s = env.simulation.time_s
    env.step([[35, -3.14], [7.5, 0.75]])
    assert env.simulation.hands - before == pytest.approx(np.array([[35, -3.14], [7.5, 0.75]]) / 7.5)
    assert env.simulation.time_s - time_s == pytest.approx(1 / 7.5)
    before = env.simulation.hands
    observation, *_ = env.step([[350, 314], [-35, 0]])
    # Beyond the limits it is clipped, and nothing leaves the entry backwards.
    assert env.simulation.hands - before == pytest.approx(np.array([[35 / 7.5, 3.14 / 7.5], [-1, 0]]))
    assert observation["last_action"] == pytest.approx(np.array([[1, 1], [-1, 0]]))


@pytest.mark.parametrize("name,axes,turn,tilt", [
    ("BasicWireNav", ((0, 1, 0), (0, 0, -1), (-1, 0, 0)), 0, 0),
    ("ArchVariety", ((1, 0, 0), (0, 1, 0), (0, 0, 1)), 25, 0),
    ("DualDeviceNav", ((0, 1, 0), (0, 0, -1), (-1, 0, 0)), 20, 5),
])
def test_observations_are_places_in_the_picture(name, axes, turn, tilt):
    env = steve.SteveEnv(name, task=fast(name))
    first, info = env.reset(seed=3)
    assert (first["tracking"][0] == first["tracking"][1]).all() and (first["last_action"] == 0).all()
    others = [[0, 0]] * (len(env.action_space.high) - 1)
    for _ in range(4):
        before, *_ = env.step([[30, 1], *others])
    after, *_ = env.step([[30, -1], *others])
    assert (after["tracking"][1] == before["tracking"][0]).all()

    def picture(points_mm):
        left, back, head = np.array(axes) @ np.transpose(points_mm)
        about_head, about_left = math.radians(turn), math.radians(tilt)
        deep = math.cos(about_left) * back + math.sin(about_left) * head
        up = math.cos(about_left) * head - math.sin(about_left) * back
        return np.array([math.cos(about_head) * left + math.sin(about_head) * deep, up]).T

    lines = picture(np.vstack([env.scene.centerline_mm(each, 2.0) for each in env.scene.centerlines]))
    low, high = lines.min(axis=0), lines.max(axis=0)
    low, high = low - 0.1 * abs(low), high + 0.1 * abs(high)
    tip = env.simulation.tips_mm[0]
    target = env.scene.route_mm(info["target"], info["target_at_mm"])[-1]
    for seen, place in ((after["tracking"][0, 0], tip), (after["target"], target)):
        assert seen == pytest.approx(2 * (picture(place) - low) / (high - low) - 1, abs=1e-5)
    # The second point is 2 mm behind the tip. Here this is the last segment of 2 mm, or a part of the one before.
    nodes = env.simulation.nodes_mm
    arcs = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    behind = [np.interp(arcs[-1] - 2, arcs, nodes[:, axis]) for axis in range(3)]
    assert after["tracking"][0, 1] == pytest.approx(2 * (picture(behind) - low) / (high - low) - 1, abs=1e-5)


def test_the_reward_is_the_published_one():
    env = steve.SteveEnv("BasicWireNav", task=fast("BasicWireNav"))
    _, info = env.reset(seed=1)
    start_mm = left_mm = info["remaining_mm"]
    assert info["path_ratio"] == 0
    for _ in range(5):
        _, reward, terminated, _, info = env.step([[35, 0]])
        assert reward == pytest.approx(0.001 * (left_mm - info["remaining_mm"]) - 0.005, abs=1e-9)
        left_mm = info["remaining_mm"]
    assert not terminated and info["path_ratio"] == pytest.approx(1 - left_mm / start_mm) and info["path_ratio"] > 0.03
    there = steve.SteveEnv("BasicWireNav", task=fast("BasicWireNav", within_mm=1e4))
    _, before = there.reset(seed=1)
    _, reward, terminated, _, info = there.step([[35, 0]])
    assert terminated and info["success"]
    assert reward == pytest.approx(1 + 0.001 * (before["remaining_mm"] - info["remaining_mm"]) - 0.005, abs=1e-9)


def test_an_end_of_the_vessel_is_found():
    env = steve.SteveEnv("BasicWireNav", True, task=fast("BasicWireNav", within_mm=0, max_steps=150))
    _, info = env.reset(seed=1)
    while not info["at_end"]:
        *_, truncated, info = env.step([[35, 0]])
        assert not truncated
    # The wire has gone round the arch to the heart. The ascending aorta has a diameter of 25 mm there.
    heart = curves()["curve_00"][0][0]
    assert np.linalg.norm(env.simulation.tips_mm[0] - heart) < 15


def test_nothing_is_pushed_past_an_end_of_the_vessel(monkeypatch):
    env = steve.SteveEnv("DualDeviceNav", task=fast("DualDeviceNav", within_mm=0))
    env.reset(seed=1)
    for _ in range(8):
        _, _, _, _, info = env.step([[35, 0], [15, 0]])
    assert not info["at_end"]
    first, second = env.simulation.hands[:, 0]
    monkeypatch.setattr(steve._Ends, "has", lambda self, place_mm: True)
    _, _, _, _, info = env.step([[35, 0], [20, 0]])
    assert info["at_end"]
    # The one behind follows, but not beyond the first.
    assert env.simulation.hands[:, 0] == pytest.approx([first, second + 20 / 7.5])
    for _ in range(12):
        env.step([[35, 0], [35, 0]])
    assert first - 35 / 7.5 < env.simulation.hands[1, 0] + 1e-6 <= first + 2e-6
    assert env.simulation.hands[0, 0] == first
    env.step([[-35, 0], [0, 0]])
    assert env.simulation.hands[0, 0] == pytest.approx(first - 35 / 7.5)


@pytest.mark.parametrize("name,realistic", ALL)
def test_an_environment_keeps_the_conditions_of_gymnasium(name, realistic):
    env = steve.SteveEnv(name, realistic, task=fast(name, max_steps=6))

    def episode(env, seed):
        seen = [env.reset(seed=seed)]
        random = np.random.default_rng(seed)
        while True:
            seen.append(env.step(random.uniform(env.action_space.low, env.action_space.high)))
            observation, reward, terminated, truncated, _ = seen[-1]
            assert env.observation_space.contains(observation) and math.isfinite(reward)
            if terminated or truncated:
                return seen

    first = episode(env, 5)
    assert env.observation_space.contains(first[0][0]) and len(first) == 7 and first[-1][3]
    with pytest.raises(torquer.Error, match="the episode has ended"):
        env.step(np.zeros(env.action_space.shape))
    other = pickle.loads(pickle.dumps(env))
    again = episode(other, 5)
    assert repr(first) == repr(again)
    assert repr(episode(env, 6)[0]) != repr(first[0])
    for bad in (np.zeros(3), np.full(env.action_space.shape, math.nan)):
        env.reset(seed=1)
        with pytest.raises(torquer.Error, match="the action is"):
            env.step(bad)
    env.close()
    with pytest.raises(torquer.envs.ClosedEnvironmentError):
        env.reset()


def test_an_unknown_task_is_refused():
    with pytest.raises(torquer.Error, match="there is no task 'Basic' of stEVE_bench; did you mean BasicWireNav. there are: BasicWireNav, "):
        steve.SteveEnv("Basic")
    with pytest.raises(torquer.Error, match="there are: BasicWireNav, "):
        steve.task("Basic")


def test_a_view_is_rendered():
    env = steve.SteveEnv("BasicWireNav", render_mode="rgb_array", task=fast("BasicWireNav"))
    env.reset(seed=1)
    picture = env.render()
    assert picture.dtype == np.uint8 and picture.ndim == 3
