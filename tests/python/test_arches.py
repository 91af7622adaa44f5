"""Random aortic arches, and environments that draw another one at each reset."""

import dataclasses
import pickle

import numpy as np
import pytest
import torquer
import torquer.arches
import torquer.envs

FAST = dataclasses.replace(torquer.arches.TASK.for_training(), max_steps=9)


def nearest(points_mm, place_mm):
    distances = np.linalg.norm(points_mm - place_mm, axis=1)
    return int(distances.argmin()), float(distances.min())


def to_wall_mm(scene, place_mm, way):
    """Distance of the wall from a place in the lumen."""
    return next(mm for mm in np.arange(1, 30, 0.02) if scene.clearance_mm([place_mm + mm * way])[0] < 0)


def drop_in_diameters(scene):
    """Distance of the trunk's origin below the top of the aorta, on the outer wall, in diameters of the left common
    carotid artery. The lumen's clearance shows the walls."""
    aorta = scene.centerline_mm("aorta", 0.25)
    top = int(aorta[:, 2].argmax())
    at, _ = nearest(aorta, scene.centerline_mm("brachiocephalic", 1.0)[0])
    # Out of the arch is away from the chord between two places beside this one.
    chord = (aorta[at - 8] + aorta[at + 8]) / 2
    out = (aorta[at] - chord) / np.linalg.norm(aorta[at] - chord)
    # No vessel begins at the inner wall, so that it shows the radius.
    top_mm, at_mm = to_wall_mm(scene, aorta[top], np.array([0, 0, -1.0])), to_wall_mm(scene, aorta[at], -out)
    drop_mm = aorta[top, 2] + top_mm - (aorta[at, 2] + at_mm * out[2])
    # Shortly beyond the arch, before the artery becomes narrower.
    artery = scene.centerline_mm("lcca", 0.25)
    k = next(k for k, place in enumerate(artery) if nearest(aorta, place)[1] > top_mm + 6)
    side = np.cross(artery[k + 1] - artery[k], [1.0, 0, 0])
    return drop_mm / (2 * to_wall_mm(scene, artery[k], side / np.linalg.norm(side)))


def test_types_have_the_drop_of_their_definition():
    for kind, lowest, highest in (("I", 0, 1), ("II", 1, 2), ("III", 2, 3.2)):
        drops = [drop_in_diameters(torquer.arches.draw(seed, [kind])) for seed in range(8)]
        assert lowest < min(drops) and max(drops) < highest and max(drops) - min(drops) > 0.25, kind


def test_the_left_carotid_of_a_bovine_arch_begins_at_the_trunk():
    for seed in range(20):
        scene = torquer.arches.draw(seed)
        origin = scene.centerline_mm("lcca", 1.0)[0]
        parent = "brachiocephalic" if scene.name == "arch_bovine" else "aorta"
        for other in ("brachiocephalic", "aorta"):
            _, distance_mm = nearest(scene.centerline_mm(other, 0.25), origin)
            assert (distance_mm < 0.3) == (other == parent)


def test_seeds_and_types_choose_the_arch():
    hashes = {torquer.arches.draw(seed).content_hash for seed in range(20)}
    assert len(hashes) == 20
    assert torquer.arches.draw(3).content_hash in hashes
    assert {torquer.arches.draw(seed).name for seed in range(20)} == {f"arch_{kind}" for kind in torquer.arches.TYPES}
    for bad in ([], ["IV"], "II"):
        with pytest.raises(torquer.Error, match="types are .*give"):
            torquer.arches.draw(1, bad)
        with pytest.raises(torquer.Error, match="types are .*give"):
            torquer.arches.make(bad)
    for seed in (-7, 1.5, "seven"):
        with pytest.raises(torquer.Error, match=f"seed is {seed!r}; give a whole number"):
            torquer.arches.draw(seed)


def test_each_reset_draws_an_arch():
    env = torquer.arches.make(task=FAST)
    seen = []
    for seed in range(12):
        observation, info = env.reset(seed=seed)
        assert env.observation_space.contains(observation)
        place_mm = env.scene.route_mm(info["target"], info["target_at_mm"])[-1]
        assert observation[24:27] == pytest.approx(place_mm - env.simulation.tips_mm[0], abs=1e-3)
        for _ in range(3):
            observation, *_ = env.step([1.0, 0.5])
            assert env.observation_space.contains(observation)
        seen.append((env.scene.name, env.simulation.state_hash))
    assert len(set(seen)) == 12 and len({name for name, _ in seen}) == 4
    # The seed decides, also in a copy.
    other = pickle.loads(pickle.dumps(env))
    other.reset(seed=4)
    for _ in range(3):
        other.step([1.0, 0.5])
    assert (other.scene.name, other.simulation.state_hash) == seen[4]
    # Without a seed, the arches go on.
    other.reset()
    assert other.simulation.scene.content_hash not in {torquer.arches.draw(np.random.default_rng(4)).content_hash}
    bovine = torquer.arches.make(["bovine"], FAST)
    for seed in range(3):
        bovine.reset(seed=seed)
        assert bovine.scene.name == "arch_bovine"


def test_a_scene_without_room_in_the_bounds_is_refused():
    base = torquer.Scene("ty_phantom")
    longer = base.with_values({"instrument.guidewire.max_length_mm": 5000.0})
    drawn = [base, base, longer]
    env = torquer.envs.NavigationEnv(lambda random: drawn.pop(0), torquer.envs.TASKS["ty_phantom"])
    observation, _ = env.reset(seed=1)
    with pytest.raises(torquer.Error, match="ty_phantom has observations outside .*draw scenes of a similar size"):
        env.reset()


def test_the_view_shows_the_arch_of_the_episode():
    env = torquer.arches.make(task=FAST, render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    env.reset(seed=2)
    assert first.ndim == 3 and (first.shape != env.render().shape or (first != env.render()).mean() > 0.02)
