"""Figures of scenes whose instruments lie on several curves."""

import csv
import json

import numpy as np
import pytest
import torquer
import torquer.envs
import torquer.export
from test_export import read_vtp

FORK = """name = "fork"
[vessel]
kind = "tubes"
wall_stiffness_N_mm2 = 1
[[vessel.tube]]
name = "stem"
points_mm = [[0, 0, 0], [100, 0, 0]]
radii_mm = [3]
[[vessel.tube]]
name = "left"
points_mm = [[100, 0, 0], [180, 40, 0]]
radii_mm = [3]
[entry]
centerline = "stem"
at_mm = 1
[[instrument]]
max_length_mm = 150
radius_mm = 0.3
rigidity_N_mm2 = 1
tip_mm = 10
tip_angle_deg = 90
inserted_at_start_mm = 50
"""

# Enters 20 mm behind the first wire, 1 mm beside it.
BUDDY = """[[instrument]]
name = "buddy"
max_length_mm = 150
radius_mm = 0.3
rigidity_N_mm2 = 1
tip_mm = 10
tip_angle_deg = 90
inserted_at_start_mm = 75.3
[instrument.entry]
centerline = "stem"
at_mm = 21
offset_mm = [1, 0]
"""


# Lies around the first wire, and reaches farther.
CATHETER = """[[instrument]]
name = "catheter"
max_length_mm = 150
radius_mm = 0.9
inner_radius_mm = 0.6
rigidity_N_mm2 = 1
inserted_at_start_mm = 75.3
"""


@pytest.fixture(scope="module")
def beside():
    return torquer.Scene.from_text(FORK + BUDDY)


@pytest.mark.parametrize("other", [BUDDY, CATHETER, CATHETER + "[effects.clearance]\n"])
def test_a_vector_has_points_of_the_instrument_that_the_task_moves(other):
    scene = torquer.Scene.from_text(FORK + other)
    for instrument in (0, 1):
        task = torquer.envs.Task("left", 60.0, instrument=instrument, segment_mm=0.5)
        env = torquer.envs.NavigationEnv(scene, task)
        observation, info = env.reset(options={"rotation_rad": 0.0})
        tip = env.simulation.tips_mm[instrument]
        points = observation[: 3 * 4].reshape(4, 3)
        gaps = np.linalg.norm(np.diff(np.vstack([np.zeros(3), points]), axis=0), axis=1)
        assert (gaps > 4).all() and (gaps < 5.6).all()
        nodes = env.simulation.instrument_nodes_mm(instrument)
        for point in points + tip:
            assert np.linalg.norm(nodes - point, axis=1).min() < 1e-3
        assert env.observation_space.contains(observation)


def test_the_way_to_the_target_begins_at_the_entry_of_the_instrument(beside):
    routes = [beside.route_mm("left", 60.0, 1.0, k) for k in range(2)]
    assert len(routes[0]) - len(routes[1]) == pytest.approx(20, abs=1)
    assert np.array_equal(routes[0], beside.route_mm("left", 60.0, 1.0))
    with pytest.raises(torquer.Error, match="no instrument 2"):
        beside.route_mm("left", 60.0, 1.0, 2)


def test_contacts_are_those_of_the_nodes_that_they_number(beside):
    simulation = torquer.Simulation(beside)
    simulation.step(0.1, simulation.hands)
    contacts = [simulation.instrument_contacts(k) for k in range(2)]
    assert simulation.contacts() == contacts[1]
    deepest = max(max(depths.values()) for depths in contacts)
    assert deepest == pytest.approx(simulation.max_penetration_mm)
    for k, depths in enumerate(contacts):
        nodes = simulation.instrument_nodes_mm(k)
        assert depths and all(0 < node < len(nodes) for node in depths)
        # A node in contact is within a segment of the wall.
        for node in depths:
            assert beside.clearance_mm(nodes[node : node + 1])[0] < 1.3
    with pytest.raises(torquer.Error, match="no instrument 2"):
        simulation.instrument_contacts(2)
    # The first wire passes the second one.
    hands = simulation.hands
    hands[0, 0] = 90
    simulation.step(1.0, hands)
    assert simulation.contacts() == simulation.instrument_contacts(0)


def test_contacts_of_an_instrument_end_at_its_tip():
    catheter = """[[instrument]]
name = "catheter"
max_length_mm = 150
radius_mm = 0.6
inner_radius_mm = 0.4
rigidity_N_mm2 = 1
inserted_at_start_mm = 20
"""
    simulation = torquer.Simulation(torquer.Scene.from_text(FORK + catheter))
    simulation.step(0.1, simulation.hands)
    count = len(simulation.instrument_nodes_mm(1))
    of_wire, of_catheter = (simulation.instrument_contacts(k) for k in range(2))
    assert simulation.contacts() == of_wire and of_wire
    assert of_catheter == {node: depth for node, depth in of_wire.items() if node < count}


def test_every_instrument_is_exported_with_the_forces_that_are_known(tmp_path):
    scene = torquer.Scene.from_text(FORK + BUDDY + "[effects.internal_forces]\n")
    simulation = torquer.Simulation(scene)
    simulation.step(0.1, simulation.hands)
    state = torquer.export.State.of(simulation)
    wire, buddy = (simulation.instrument_nodes_mm(k) for k in range(2))
    tension = simulation.forces()["tension_mN"]
    torquer.export.write([state], tmp_path / "both.vtp")
    arrays = read_vtp(tmp_path / "both.vtp")
    assert np.array_equal(np.reshape(arrays["Points"], (-1, 3)), np.concatenate([state.nodes_mm, wire]))
    assert arrays["offsets"] == [len(buddy), len(buddy) + len(wire)]
    assert np.array_equal(arrays["tension_mN"], [*tension, *[np.nan] * len(wire)], equal_nan=True)
    torquer.export.write([state], tmp_path / "both.csv")
    rows = list(csv.DictReader((tmp_path / "both.csv").open()))
    assert [row["instrument"] for row in rows] == ["buddy"] * len(buddy) + ["guidewire"] * len(wire)
    assert [int(row["node"]) for row in rows] == [*range(len(buddy)), *range(len(wire))]
    # A file of --states has the same nodes.
    fields = {"time_s": 0.1, "nodes_mm": state.nodes_mm.tolist(), "tension_mN": tension.tolist()}
    fields.update({"buddy.nodes_mm": buddy.tolist(), "guidewire.nodes_mm": wire.tolist()})
    (tmp_path / "states.jsonl").write_text(json.dumps(fields) + "\n")
    (read,) = torquer.export.read_states(tmp_path / "states.jsonl")
    torquer.export.write([read], tmp_path / "read.csv")
    names = [row["instrument"] for row in csv.DictReader((tmp_path / "read.csv").open())]
    assert names == [row["instrument"] for row in rows]
    try:
        mesh = torquer.export.to_meshio(state)
    except torquer.Error:
        return  # without python3-meshio
    assert len(mesh.points) == len(rows) and len(mesh.cells_dict["line"]) == len(rows) - 2
