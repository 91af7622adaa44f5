"""The module for 3D Slicer, on stand-ins for Slicer's interface (slicer_mocks.py): no Slicer is at hand here."""

import ast
import importlib.util
import json
import os
import pathlib
import sys
import time

import numpy as np
import pytest
import slicer_mocks
import torquer.export
from slicer_mocks import Node

FOLDER = pathlib.Path(__file__).parents[2] / "host/slicer/Torquer"
IMPORTER = f"{sys.executable} -B -m torquer.importer"
# A tube in RAS. All coordinates differ, so that a turned or swapped axis shows.
START, END, RADIUS = np.array([12.0, 31.0, -48.0]), np.array([20.0, 11.0, 9.0]), 5.0
MOVED = np.array([3.0, 5.0, 7.0])
FIDUCIALS, CURVE = "vtkMRMLMarkupsFiducialNode", "vtkMRMLMarkupsCurveNode"


@pytest.fixture
def slicer(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    return slicer_mocks.installed(monkeypatch)


@pytest.fixture
def module(slicer):
    spec = importlib.util.spec_from_file_location("Torquer", FOLDER / "Torquer.py")
    out = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(out)
    return out


@pytest.fixture
def widget(module, tmp_path):
    out = module.TorquerWidget()
    out.setup()
    out.folder.currentPath = str(tmp_path)
    yield out
    out.cleanup()


def fake_importer(path, lines):
    """A command that keeps its arguments and its environment, and then runs these lines of shell."""
    path.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" "$FROM_SLICER" >{path}.seen\n{lines}\n')
    path.chmod(0o755)
    return str(path)


def seen(path):
    return pathlib.Path(f"{path}.seen").read_text().splitlines()


def finish(widget, seconds=60.0):
    """Fires the timer until the command has ended; returns the shown steps."""
    steps = []
    until = time.monotonic() + seconds
    while widget.timer.active:
        assert time.monotonic() < until, widget.report.plainText
        widget.timer.handlers["timeout()"]()
        steps.append(widget.status.text)
        time.sleep(0.01)
    return steps


def tube():
    """A closed tube as a model node, whose transform moves it by MOVED."""
    along = (END - START) / np.linalg.norm(END - START)
    across = np.cross(along, [1, 0, 0])
    across /= np.linalg.norm(across)
    count, rings = 24, 15
    angles = 2 * np.pi * np.arange(count) / count
    circle = RADIUS * (np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * np.cross(along, across))
    points = np.vstack([START + (END - START) * k / (rings - 1) + circle for k in range(rings)] + [START, END])
    next_ = (np.arange(count) + 1) % count
    sides = [
        [k * count + i, k * count + next_[i], (k + 1) * count + i] for k in range(rings - 1) for i in range(count)
    ] + [[k * count + next_[i], (k + 1) * count + next_[i], (k + 1) * count + i] for k in range(rings - 1) for i in range(count)]
    last = rings * count
    caps = [[last, next_[i], i] for i in range(count)]
    caps += [[last + 1, last - count + i, last - count + next_[i]] for i in range(count)]
    node = Node("vtkMRMLModelNode", "vessel", points - MOVED, MOVED)
    node.triangles = sides + caps
    return node


def test_sources_are_python_3_9_and_parts_need_no_slicer():
    for path in FOLDER.rglob("*.py"):
        tree = ast.parse(path.read_text(), str(path), feature_version=(3, 9))
        names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        assert path.name == "Torquer.py" or not names & {"slicer", "qt", "ctk", "vtk", "numpy", "torquer"}, path
    # Slicer takes every file beside the module's for a module.
    assert [path.name for path in FOLDER.glob("*.py")] == ["Torquer.py"]


def test_slicers_own_test_passes(module):
    module.TorquerTest("runTest").runTest()
    parent = type("Parent", (), {})()
    module.Torquer(parent)
    assert parent.title == "Torquer" and parent.categories


def test_a_volume_with_seeds_becomes_the_command(widget, slicer, tmp_path):
    widget.command.text = fake_importer(tmp_path / "import", "echo 'Reading the scan ..' >&2; sleep 0.3; echo refused >&2; exit 2")
    widget.volume.node = Node("vtkMRMLScalarVolumeNode", "CTA")
    widget.seeds.node = Node(FIDUCIALS, "F", [[12.5, 30, 148], [-1.25, 4, -1480.5], [9, 9, 9]], moved_mm=[0, 0, 2])
    widget.seeds.node.status[2] = slicer_mocks.PREVIEW
    widget.root.node, widget.entry.node = Node(FIDUCIALS, "R", [[1, -2, 3]]), Node(FIDUCIALS, "E", [[-4, 0, 6]])
    widget.import_button.click()
    assert not widget.import_button.enabled and (tmp_path / "my_patient.input/scan.nrrd").is_file()
    steps = finish(widget)
    assert "Reading the scan .." in steps
    inputs, out = str(tmp_path / "my_patient.input/scan.nrrd"), str(tmp_path / "my_patient")
    places = ["--seed=-12.5,-30,150", "--seed=1.25,-4,-1478.5", "--root=-1,2,3", "--entry=4,0,6"]
    assert seen(tmp_path / "import") == [inputs, *places, "--out", out, "startup"]
    assert slicer.util.exported == [(widget.volume.node, inputs)]
    # The message is shown as it is. The folder of inputs is gone, so the name is free again.
    assert slicer.util.shown_errors == ["refused"] and widget.report.plainText == "refused"
    assert widget.import_button.enabled and not (tmp_path / "my_patient.input").exists()


def test_a_segment_becomes_a_label_map(widget, slicer, tmp_path):
    widget.command.text = fake_importer(tmp_path / "import", "kill -9 $$")
    widget.source.choose(1)
    assert widget.segment.enabled and not widget.seeds.enabled and not widget.model.enabled
    widget.segment.node, widget.segment.segment = Node("vtkMRMLSegmentationNode", "S"), "Segment_1"
    widget.import_button.click()
    finish(widget)
    labels = str(tmp_path / "my_patient.input/labels.nrrd")
    assert seen(tmp_path / "import") == [labels, "--label", "1", "--out", str(tmp_path / "my_patient"), "startup"]
    (node, _), = slicer.util.exported
    assert node.GetClassName() == "vtkMRMLLabelMapVolumeNode" and node.image == ["Segment_1"]
    assert slicer.mrmlScene.nodes == [], "the label map was only for the file"
    assert slicer.util.shown_errors == ["the command ended with status -9 and without a message; run it in a terminal"]
    widget.segment.segment = "Segment_2"
    widget.import_button.click()
    assert "S gives no label map; draw the segment" in slicer.util.shown_errors[-1]
    widget.segment.node.moved_mm += 1
    widget.import_button.click()
    assert "S is moved by a transform; harden it" in slicer.util.shown_errors[-1]
    assert slicer.mrmlScene.nodes == [] and not (tmp_path / "my_patient.input").exists()


@pytest.mark.parametrize("kind", [1, 2])
def test_a_volume_beside_a_segment_or_a_model_is_the_body(widget, slicer, tmp_path, kind):
    widget.command.text = fake_importer(tmp_path / "import", "exit 2")
    widget.source.choose(kind)
    assert widget.volume.enabled
    widget.volume.node = Node("vtkMRMLScalarVolumeNode", "CT")
    widget.segment.node, widget.segment.segment = Node("vtkMRMLSegmentationNode", "S"), "Segment_1"
    widget.model.node = tube()
    widget.import_button.click()
    body = str(tmp_path / "my_patient.input/scan.nrrd")
    assert slicer.util.exported[-1] == (widget.volume.node, body)
    finish(widget)
    words = seen(tmp_path / "import")
    assert words[words.index("--body") + 1] == body


def test_cancel_stops_the_command(widget, slicer, tmp_path):
    # The command ends by the signal as torquer-import does, with status 130.
    wait = "trap 'echo stopped >&2; exit 130' TERM; echo 'Lumen ..' >&2; while :; do sleep 0.02; done"
    widget.command.text = fake_importer(tmp_path / "import", wait)
    widget.source.choose(2)
    widget.model.node = tube()
    widget.import_button.click()
    until = time.monotonic() + 30
    while widget.status.text != "Lumen .." and time.monotonic() < until:
        widget.timer.handlers["timeout()"]()
    assert widget.cancel_button.enabled
    widget.cancel_button.click()
    finish(widget)
    assert widget.status.text == "canceled" and slicer.util.shown_errors == []
    assert widget.import_button.enabled and not (tmp_path / "my_patient.input").exists()


def test_a_model_with_edited_curves_becomes_a_case_in_the_same_place(widget, slicer, tmp_path):
    widget.command.text = IMPORTER
    widget.source.choose(2)
    widget.model.node = tube()
    widget.use_curves.checked = True
    bend = (START + END) / 2 + [0.0, 0.8, 0.0]
    edited = Node(CURVE, "c00 (edited)", np.array([START + 0.1 * (END - START), bend, END - 0.1 * (END - START)]) - MOVED, MOVED)
    hidden, closed, wire = Node(CURVE, "hidden"), Node("vtkMRMLMarkupsClosedCurveNode", "closed"), Node(CURVE, "wire")
    hidden.visible = False
    wire.SetAttribute("Torquer.Wire", "guidewire")
    slicer.mrmlScene.nodes += [edited, hidden, closed, wire]
    # Without it the wire enters at the other end.
    widget.entry.node = Node(FIDUCIALS, "E", [START])
    widget.import_button.click()
    finish(widget)
    assert slicer.util.shown_errors == [] and widget.status.text == f"{tmp_path}/my_patient is complete"
    assert "1 curves of" in widget.report.plainText and "SPACE" not in widget.report.plainText
    assert os.listdir(tmp_path / "my_patient.input/centerlines") == ["000_c00__edited_.mrk.json"]
    # Truth from the nodes alone: LPS is RAS with the first two signs turned.
    scene = torquer.Scene(str(tmp_path / "my_patient/my_patient.toml"))
    line = np.asarray(scene.centerline_mm("c00"))
    ends = (edited.points[[0, -1]] + MOVED) * [-1, -1, 1]
    assert np.allclose(line[[0, -1]], ends, atol=1e-3) and np.linalg.norm(line - bend * [-1, -1, 1], axis=1).min() < 0.6
    assert np.linalg.norm(np.array(scene.bounds_mm).mean(axis=0) - (START + END) / 2 * [-1, -1, 1]) < 0.5
    assert np.dot(entry_of(scene), (END - START) * [-1, -1, 1]) > 0, "from the chosen end"
    # The nodes that were loaded lie where the model and the curve lie.
    model, curve = slicer.mrmlScene.nodes[-2:]
    assert model.GetName() == "my_patient" and model.display.opacity < 1
    corners = (widget.model.node.points + MOVED)[widget.model.node.triangles]
    assert np.allclose(model.points.mean(axis=0), corners.mean(axis=(0, 1)), atol=0.5)
    assert curve.GetName() == "c00" and np.allclose(curve.points[[0, -1]], edited.points[[0, -1]] + MOVED, atol=1e-3)
    assert curve.display.shown == [("points", False), ("properties", False)]
    widget.open_button.click()
    assert slicer_mocks.Clipboard.copied == widget.report.plainText
    assert widget.report.plainText.splitlines()[0] == f"torquer-simulator --scene {tmp_path}/my_patient/my_patient.toml"
    # The name is used now. Nothing is overwritten.
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    widget.import_button.click()
    assert slicer.util.shown_errors == [f"Name: {tmp_path}/my_patient exists already; remove it, or give another name"]
    assert before == {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    # A case with a missing file does not load.
    (tmp_path / "my_patient/surface.stl").unlink()
    widget.load_button.click()
    assert "my_patient/surface.stl is missing" in slicer.util.shown_errors[-1] and widget.status.text == "refused"


def entry_of(scene):
    (line,) = [line for line in scene.text.splitlines() if line.startswith("direction =")]
    return json.loads(line.split("=")[1])


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda w: setattr(w.folder, "currentPath", ""), "Folder: is empty"),
        (lambda w: setattr(w.folder, "currentPath", "/no/where"), "Folder: there is no folder /no/where; make it"),
        (lambda w: setattr(w.name, "text", "a b"), "Name: 'a b' has other characters"),
        (lambda w: setattr(w.command, "text", "no-such-program"), "Command: there is no program no-such-program; install"),
        (lambda w: setattr(w.command, "text", "'"), "Command: \"'\" cannot be read"),
        (lambda w: setattr(w.command, "text", " "), "Command: is empty"),
        (lambda w: setattr(w.volume, "node", None), "Volume: nothing is chosen"),
        (lambda w: setattr(w.seeds, "node", None), "Seeds: the point list has no placed point"),
        (lambda w: setattr(w.seeds, "node", Node(FIDUCIALS, "F", [[0, 0, 1e7]])), "--seed: the point [0.0, 0.0, 10000000.0] is no"),
        (lambda w: setattr(w.entry, "node", Node(FIDUCIALS, "F", [[0, 0, 1], [1, 2, 3]])), "--entry: the point list has 2 points"),
        (lambda w: w.source.choose(2), "Model: nothing is chosen"),
        (lambda w: (w.source.choose(2), setattr(w.model, "node", tube()), setattr(w.use_curves, "checked", True)), "Curves: no open"),
    ],
)
def test_refused_fields(widget, slicer, tmp_path, change, said):
    widget.command.text = fake_importer(tmp_path / "import", "exit 0")
    widget.volume.node, widget.seeds.node = Node("vtkMRMLScalarVolumeNode", "CTA"), Node(FIDUCIALS, "F", [[0, 0, 1]])
    change(widget)
    widget.import_button.click()
    (shown,) = slicer.util.shown_errors
    assert shown.startswith(said) and widget.report.plainText == shown and not widget.timer.active
    assert sorted(os.listdir(tmp_path)) == ["import"]


def state(time_s, nodes, **more):
    return json.dumps({"time_s": time_s, "status": 0, "nodes_mm": nodes, **more}) + "\n"


def test_states_become_locked_curves(widget, slicer, tmp_path):
    path = tmp_path / "states.jsonl"
    widget.states_path.currentPath = str(path)
    path.write_text("".join(state(k / 10, [[1, 2, 3], [4, 5, 6 + k]]) for k in range(11)))
    widget.most.setValue(3)
    widget.on_states()
    nodes = slicer.mrmlScene.nodes
    assert [node.GetName() for node in nodes] == ["wire 0.00 s", "wire 0.50 s", "wire 1.00 s"]
    # A scene in LPS, so that Slicer's first two coordinates have the other sign.
    assert np.allclose(nodes[1].points, [[-1, -2, 3], [-4, -5, 11]])
    assert all(node.is_linear and node.is_locked and node.GetAttribute("Torquer.Wire") for node in nodes)
    widget.frame.currentIndex = 1
    # The instrument "out" has not entered the vessel.
    own = {"wire.nodes_mm": [[1, 2, 3], [4, 5, 6]], "tube.nodes_mm": [[7, 8, 9], [1, 1, 1]], "out.nodes_mm": [[0, 0, 0]]}
    path.write_text(state(2, [[0, 0, 0], [1, 1, 1]], **own))
    widget.on_states()
    assert [node.GetName() for node in nodes[3:]] == ["wire 2.00 s", "tube 2.00 s"]
    assert np.allclose(nodes[3].points, [[1, 2, 3], [4, 5, 6]]) and slicer.util.shown_errors == []


def test_refused_states(widget, slicer, tmp_path):
    path = tmp_path / "states.jsonl"
    widget.states_path.currentPath = str(path)
    widget.on_states()
    two = [[1, 2, 3], [1, 2, 4]]
    for text, said in [
        ("", f"{path}: holds no state"),
        ("TQSTATES\x02", f"{path}: has binary states"),
        ("{}\n", f"{path}:1: field time_s is missing"),
        (state(0, two) + "{", f"{path}:2: not valid JSON"),
        (state(0, [[1, 2]]), f"{path}:1: field nodes_mm is [[1, 2]]"),
        (state("x", two), f"{path}:1: field time_s is x"),
        (state(0, [[1, 2, float("nan")], [1, 2, 4]]), f"{path}:1: field nodes_mm"),
    ]:
        path.write_text(text)
        widget.on_states()
        assert said in slicer.util.shown_errors[-1] and "write the file again" in slicer.util.shown_errors[-1], text
    assert "is no file" in slicer.util.shown_errors[0] and len(slicer.util.shown_errors) == 8 and slicer.mrmlScene.nodes == []


def test_states_of_the_simulator_are_read(slicer, tmp_path):
    """Same points as the reader of the package."""
    from TorquerLib import states

    path = tmp_path / "states.jsonl"
    nodes = np.arange(30.0).reshape(10, 3)
    path.write_text(state(0.5, nodes.tolist()))
    (shape,) = states.read(str(path), "RAS", 5)
    (read,) = torquer.export.read_states(path)
    assert np.array_equal(shape.lines_ras["wire"], read.nodes_mm) and shape.time_s == read.time_s
    assert states.chosen(3, 1) == [2] and states.chosen(2, 5) == [0, 1]
