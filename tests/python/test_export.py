"""Exported files, read back by independent readers."""

import base64
import csv
import json
import os
import pathlib
import struct
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import torquer
import torquer.export

SCENES = pathlib.Path(__file__).parents[2] / "host/scenes"
NODES = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [2.0, 0.3, -0.5]]


def line(time_s, **more):
    return json.dumps({"time_s": time_s, "nodes_mm": NODES, **more}) + "\n"


@pytest.fixture
def states_file(tmp_path):
    path = tmp_path / "states.jsonl"
    with_forces = {"contact_force_mN": [[1, 2, 3], [4, 5, 6], [7, 8, 9]], "tension_mN": [-1, 0, 2.5]}
    path.write_text(line(0.5, **with_forces) + line(1, **with_forces))
    return path


def convert(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "torquer", "convert", *map(str, arguments)], capture_output=True, text=True
    )


def decode(array):
    raw = base64.b64decode(array.text)
    (size,) = struct.unpack("<Q", raw[:8])
    assert size == len(raw) - 8
    kind = {"Float64": "d", "Int64": "q"}[array.get("type")]
    return list(struct.unpack(f"<{size // 8}{kind}", raw[8:]))


def read_vtp(path):
    root = ElementTree.parse(path).getroot()
    assert root.attrib == {
        "type": "PolyData", "version": "1.0", "byte_order": "LittleEndian", "header_type": "UInt64",
    }
    return {array.get("Name"): decode(array) for array in root.iter("DataArray")}


def test_a_series_for_paraview(states_file, tmp_path):
    done = convert(states_file, tmp_path / "wire.pvd")
    assert done.returncode == 0 and "2 states, 0.5 to 1.0 s" in done.stdout
    sets = list(ElementTree.parse(tmp_path / "wire.pvd").getroot().iter("DataSet"))
    assert [float(item.get("timestep")) for item in sets] == [0.5, 1]
    for item in sets:
        arrays = read_vtp(tmp_path / item.get("file"))
        assert arrays["Points"] == sum(NODES, [])
        assert arrays["connectivity"] == [0, 1, 2] and arrays["offsets"] == [3]
        assert arrays["tension_mN"] == [-1, 0, 2.5]
        assert arrays["contact_force_mN"] == list(range(1, 10))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["states.jsonl", "wire", "wire.pvd"]


def test_a_single_state_is_written(tmp_path):
    simulation = torquer.Simulation("ty_phantom")
    state = torquer.export.State.of(simulation)
    assert torquer.export.write(state, tmp_path / "wire.vtp").startswith("the state at 0.0 s")
    assert np.array_equal(np.reshape(read_vtp(tmp_path / "wire.vtp")["Points"], (-1, 3)), simulation.nodes_mm)
    for bad, problem in ((simulation, "State.of"), (simulation.nodes_mm, "ndarray is given"), ([state, 3], "list is given"), ([], "no state")):
        with pytest.raises(torquer.Error, match=f"other.vtp: .*{problem}"):
            torquer.export.write(bad, tmp_path / "other.vtp")
    assert not (tmp_path / "other.vtp").exists()


def test_a_series_is_whole_or_not_there(states_file, tmp_path):
    (tmp_path / "wire.pvd").mkdir()
    done = convert(states_file, tmp_path / "wire.pvd")
    assert done.returncode == 2 and "not an ordinary file" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["states.jsonl", "wire.pvd"]
    (tmp_path / "other").mkdir()
    done = convert(states_file, tmp_path / "other.pvd")
    assert done.returncode == 2 and "exists already" in done.stderr
    assert not (tmp_path / "other.pvd").exists() and not list((tmp_path / "other").iterdir())


def test_one_shape(states_file, tmp_path):
    assert convert(states_file, tmp_path / "wire.vtp").returncode == 0
    assert read_vtp(tmp_path / "wire.vtp")["Points"] == sum(NODES, [])
    assert convert(states_file, tmp_path / "wire.mrk.json").returncode == 0
    (markup,) = json.loads((tmp_path / "wire.mrk.json").read_text())["markups"]
    assert (markup["type"], markup["coordinateUnits"], markup["coordinateSystem"]) == ("Curve", "mm", "LPS")
    assert [point["position"] for point in markup["controlPoints"]] == NODES


def test_a_table(states_file, tmp_path):
    assert convert(states_file, tmp_path / "wire.csv").returncode == 0
    rows = list(csv.DictReader((tmp_path / "wire.csv").open()))
    assert len(rows) == 6
    assert rows[5] == {
        "time_s": "1.0", "node": "2", "x_mm": "2.0", "y_mm": "0.3", "z_mm": "-0.5",
        "contact_force_x_mN": "7.0", "contact_force_y_mN": "8.0", "contact_force_z_mN": "9.0",
        "tension_mN": "2.5",
    }


def test_a_simulation(tmp_path):
    simulation = torquer.Simulation(torquer.Scene(str(SCENES / "ty_phantom.toml")))
    hands = simulation.hands
    hands[0, 0] += 20.25
    simulation.step(0.1, hands)
    state = torquer.export.State.of(simulation)
    before = state.nodes_mm.copy()
    hands[0, 0] += 0.01  # keeps the number of nodes
    simulation.step(0.2, hands)
    assert np.array_equal(state.nodes_mm, before)
    torquer.export.write([state], tmp_path / "wire.vtp")
    assert read_vtp(tmp_path / "wire.vtp")["Points"] == before.ravel().tolist()


def test_meshio(states_file):
    states = torquer.export.read_states(states_file)
    try:
        import meshio  # noqa: F401
    except ImportError:
        with pytest.raises(torquer.Error, match="install the package python3-meshio"):
            torquer.export.to_meshio(states[0])
        return
    mesh = torquer.export.to_meshio(states[0])
    assert mesh.points.tolist() == NODES and mesh.cells_dict["line"].tolist() == [[0, 1], [1, 2]]


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "holds no state"),
        ("{", ":1: not valid JSON"),
        (line(1) + "[1]\n", ":2: not a JSON object"),
        ("[" * 100_000, ":1: not valid JSON"),
        ('{"nodes_mm": []}', ":1: field time_s is missing"),
        ('{"time_s": 1}', ":1: field nodes_mm is missing"),
        (line("x"), ":1: field time_s is x, not a number"),
        (line(True), ":1: field time_s is True, not a number"),
        (line(2) + line(2), ":2: field time_s is 2.0, not after 2.0"),
        ('{"time_s": 1, "nodes_mm": 7}', ":1: field nodes_mm is 7, not a list"),
        ('{"time_s": 1, "nodes_mm": []}', ":1: field nodes_mm has 0 entries"),
        ('{"time_s": 1, "nodes_mm": [[1,2,3],[1,2]]}', r":1: field nodes_mm[1] is [1, 2]"),
        ('{"time_s": 1, "nodes_mm": [[1,2,3],[1,2,"3"]]}', ":1: field nodes_mm[1] is"),
        ('{"time_s": 1, "nodes_mm": [[1,2,3],[1,2,1e999]]}', ":1: field nodes_mm holds a number"),
        ('{"time_s": 1, "nodes_mm": [[1,2,3],[1,2,NaN]]}', ":1: not valid JSON (NaN is not a number"),
        (line(1, tension_mN=[1, 2]), ":1: field tension_mN has 2 entries for 3 nodes"),
    ],
)
def test_refused_states(tmp_path, text, message):
    (tmp_path / "states.jsonl").write_text(text)
    done = convert(tmp_path / "states.jsonl", tmp_path / "out.csv")
    assert done.returncode == 2 and done.stdout == ""
    assert message in done.stderr and "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["states.jsonl"]


def test_refused_paths(states_file, tmp_path):
    done = convert(tmp_path / "none", tmp_path / "out.csv")
    assert done.returncode == 2 and "cannot be read (No such file" in done.stderr
    done = convert(states_file, tmp_path / "out.xyz")
    assert done.returncode == 2 and "give .pvd, .vtp, .mrk.json or .csv" in done.stderr
    done = convert(states_file, tmp_path / "no/out.csv")
    assert done.returncode == 2 and "cannot be written (No such file" in done.stderr


def test_links_and_files_of_the_user_stay(states_file, tmp_path):
    states = torquer.export.read_states(states_file)
    (tmp_path / "real").mkdir()
    (tmp_path / "link.vtp").symlink_to(tmp_path / "real/shape.vtp")
    mine = tmp_path / f".link.vtp.{os.getpid()}"
    mine.write_text("mine")
    (tmp_path / f"real/.shape.vtp.{os.getpid()}").symlink_to(mine)
    torquer.export.write(states, tmp_path / "link.vtp")
    assert (tmp_path / "link.vtp").is_symlink() and (tmp_path / "real/shape.vtp").is_file()
    assert mine.read_text() == "mine"
    (tmp_path / "series").symlink_to(tmp_path / "nowhere")
    with pytest.raises(torquer.Error, match="exists already"):
        torquer.export.write(states, tmp_path / "series.pvd")
    assert (tmp_path / "series").is_symlink()
