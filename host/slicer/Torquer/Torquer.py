"""Module "Torquer" of 3D Slicer: makes a case from nodes by torquer-import, and shows it and the simulated wires.

Only this file touches Slicer. TorquerLib has all that can be done without.
"""

import os
import shutil
import tempfile
from typing import Any, Callable, Dict, List, Optional

import ctk
import numpy as np
import qt
import slicer
import vtk
from slicer.ScriptedLoadableModule import (
    ScriptedLoadableModule,
    ScriptedLoadableModuleLogic,
    ScriptedLoadableModuleTest,
    ScriptedLoadableModuleWidget,
)

from TorquerLib import case, states
from TorquerLib.case import Refused
from TorquerLib.run import Run

SOURCES = ("CT angiography", "Segment", "Surface model")
_FIDUCIALS = "vtkMRMLMarkupsFiducialNode"
_CURVES = "vtkMRMLMarkupsCurveNode"
# Curves with this attribute are simulated wires, and no centerlines.
_WIRE = "Torquer.Wire"
_POLL_MS = 200


class Torquer(ScriptedLoadableModule):
    """Title and help."""

    def __init__(self, parent: Any) -> None:
        ScriptedLoadableModule.__init__(self, parent)
        self.parent.title = "Torquer"
        self.parent.categories = ["Vascular"]
        self.parent.dependencies = []
        self.parent.contributors = ["Torquer project"]
        self.parent.helpText = (
            "Makes a case for the guidewire simulator Torquer from a CT angiography, a segment or a surface. "
            "It needs the command torquer-import on this machine."
        )
        self.parent.acknowledgementText = ""


class TorquerLogic(ScriptedLoadableModuleLogic):
    """Nodes in, nodes out."""

    def points_ras(self, node: Optional[Any]) -> List[List[float]]:
        """Placed points of a point list, in the world; none without a node."""
        points = []
        for number in range(node.GetNumberOfControlPoints() if node else 0):
            if node.GetNthControlPointPositionStatus(number) == slicer.vtkMRMLMarkupsNode.PositionDefined:
                point = [0.0, 0.0, 0.0]
                node.GetNthControlPointPositionWorld(number, point)
                points.append(point)
        return points

    def visible_curves_ras(self) -> Dict[str, Any]:
        """Points along each visible open curve that is no wire, by its name."""
        curves: Dict[str, Any] = {}
        for node in slicer.util.getNodesByClass(_CURVES):
            # Closed curves are of a class derived from that of open ones.
            if node.GetClassName() == _CURVES and node.GetDisplayVisibility() and not node.GetAttribute(_WIRE):
                name = node.GetName()
                if name in curves:
                    raise Refused(f"Curves: two visible ones have the name {name}; rename or hide one")
                curves[name] = slicer.util.arrayFromMarkupsCurvePoints(node, world=True)
        return curves

    def export(self, node: Any, path: str) -> None:
        """Writes a node in the world's frame. The node keeps its own file."""
        # Slicer keeps the format in this table, so each call needs a new one.
        if not slicer.util.exportNode(node, path, {}, world=True) or not os.path.isfile(path):
            raise Refused(f"{node.GetName()}: Slicer cannot write it to {path}; see Slicer's log, and check the folder's space")

    def export_segment(self, segmentation: Any, segment_id: str, path: str) -> None:
        """Writes a segment as a label map with the value 1, on the whole grid of its segmentation."""
        if segmentation.GetParentTransformNode() is not None:
            raise Refused(f"Segment: {segmentation.GetName()} is moved by a transform; harden it in the module Transforms")
        ids = vtk.vtkStringArray()
        ids.InsertNextValue(segment_id)
        labels = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLLabelMapVolumeNode", "Torquer labels")
        try:
            done = slicer.modules.segmentations.logic().ExportSegmentsToLabelmapNode(
                segmentation, ids, labels, None, slicer.vtkSegmentation.EXTENT_REFERENCE_GEOMETRY
            )
            if not done or labels.GetImageData() is None:
                raise Refused(f"Segment: {segmentation.GetName()} gives no label map; draw the segment, or choose another one")
            self.export(labels, path)
        finally:
            slicer.mrmlScene.RemoveNode(labels)

    def load_case(self, folder: str) -> Any:
        """Loads surface and centerlines; returns the model node."""
        files = case.case_files(folder)
        model = slicer.util.loadModel(files.surface)
        model.SetName(os.path.basename(os.path.normpath(folder)))
        display = model.GetDisplayNode()
        if display:
            display.SetOpacity(0.4)
        for path in files.curves:
            self._without_labels(slicer.util.loadMarkups(path))
        return model

    def load_states(self, path: str, frame: str, most: int) -> int:
        """Adds a curve for each instrument of at most `most` states; returns the number of states."""
        shapes = states.read(path, frame, most)
        for shape in shapes:
            for name, points in shape.lines_ras.items():
                node = slicer.mrmlScene.AddNewNodeByClass(_CURVES, f"{name} {shape.time_s:.2f} s")
                node.SetAttribute(_WIRE, name)
                node.SetCurveTypeToLinear()
                slicer.util.updateMarkupsControlPointsFromArray(node, np.array(points, float), world=True)
                node.SetLocked(True)
                self._without_labels(node)
        return len(shapes)

    @staticmethod
    def _without_labels(node: Any) -> None:
        """Hides the labels of a curve's many points."""
        node.CreateDefaultDisplayNodes()
        node.GetDisplayNode().SetPointLabelsVisibility(False)
        node.GetDisplayNode().SetPropertiesLabelVisibility(False)


class TorquerWidget(ScriptedLoadableModuleWidget):
    """Fields and buttons."""

    def setup(self) -> None:
        ScriptedLoadableModuleWidget.setup(self)
        self.logic = TorquerLogic()
        self.run: Optional[Run] = None
        self.place: Optional[case.Place] = None
        self.timer = qt.QTimer()
        self.timer.setInterval(_POLL_MS)
        self.timer.connect("timeout()", self.on_timer)
        self._setup_inputs(self._section("Import"))
        self._setup_import(self._section("Case"))
        self._setup_states(self._section("Wires"))
        self.layout.addStretch(1)
        self.on_source()
        self._set_running(False)

    def _section(self, title: str) -> Any:
        button = ctk.ctkCollapsibleButton()
        button.text = title
        self.layout.addWidget(button)
        return qt.QFormLayout(button)

    def _selector(self, node_class: str, tip: str) -> Any:
        selector = slicer.qMRMLNodeComboBox()
        selector.nodeTypes = [node_class]
        selector.noneEnabled = True
        # Only point lists can be made empty.
        selector.addEnabled = node_class == _FIDUCIALS
        selector.removeEnabled = False
        selector.setMRMLScene(slicer.mrmlScene)
        selector.setToolTip(tip)
        return selector

    def _button(self, text: str, action: Callable[..., None]) -> Any:
        button = qt.QPushButton(text)
        button.connect("clicked(bool)", action)
        return button

    def _setup_inputs(self, form: Any) -> None:
        self.source = qt.QComboBox()
        self.source.addItems(list(SOURCES))
        self.source.connect("currentIndexChanged(int)", self.on_source)
        self.volume = self._selector(
            "vtkMRMLScalarVolumeNode", "The CT angiography; for a segment or a model, the CT that X-ray pictures show (may be none)"
        )
        self.seeds = self._selector(_FIDUCIALS, "One or more points in the middle of wide arteries")
        self.segment = slicer.qMRMLSegmentSelectorWidget()
        self.segment.setMRMLScene(slicer.mrmlScene)
        self.model = self._selector("vtkMRMLModelNode", "Surface of the vessels, in mm; open or closed")
        self.use_curves = qt.QCheckBox()
        self.use_curves.setToolTip("Takes the visible open curves as centerlines, such as edited ones of an earlier case")
        self.root = self._selector(_FIDUCIALS, "The blood enters at the end next to a point (default: the widest); a point in each unconnected part")
        self.entry = self._selector(_FIDUCIALS, "One point: the wire enters at the end next to it (default: the lowest)")
        form.addRow("From:", self.source)
        form.addRow("Volume:", self.volume)
        form.addRow("Seeds:", self.seeds)
        form.addRow("Segment:", self.segment)
        form.addRow("Model:", self.model)
        form.addRow("Visible curves are centerlines:", self.use_curves)
        form.addRow("Inlet of the blood:", self.root)
        form.addRow("Entry of the wire:", self.entry)

    def _setup_import(self, form: Any) -> None:
        self.folder = ctk.ctkPathLineEdit()
        self.folder.filters = ctk.ctkPathLineEdit.Dirs
        self.name = qt.QLineEdit("my_patient")
        self.command = qt.QLineEdit("torquer-import")
        self.import_button = self._button("Import", self.on_import)
        self.cancel_button = self._button("Cancel", self.on_cancel)
        self.load_button = self._button("Load the case", self.on_load)
        self.status = qt.QLabel("")
        self.report = qt.QPlainTextEdit()
        self.report.readOnly = True
        self.open_button = self._button("Copy the commands that run it", self.on_open)
        form.addRow("Folder:", self.folder)
        form.addRow("Name:", self.name)
        form.addRow("Command:", self.command)
        for wide in (self.import_button, self.cancel_button, self.load_button, self.status, self.report, self.open_button):
            form.addRow(wide)

    def _setup_states(self, form: Any) -> None:
        self.states_path = ctk.ctkPathLineEdit()
        self.states_path.filters = ctk.ctkPathLineEdit.Files
        self.frame = qt.QComboBox()
        self.frame.addItems([case.LPS, case.RAS])
        self.frame.setToolTip("Coordinate system of the scene; LPS for a case of torquer-import")
        self.most = qt.QSpinBox()
        self.most.setRange(1, 1000)
        self.most.setValue(20)
        form.addRow("States (.jsonl):", self.states_path)
        form.addRow("System:", self.frame)
        form.addRow("Shapes at most:", self.most)
        form.addRow(self._button("Load wires", self.on_states))

    def on_source(self, *_: Any) -> None:
        """Enables the fields of the chosen kind of input."""
        kind = self.source.currentIndex
        for k, fields in enumerate(((self.seeds,), (self.segment,), (self.model, self.use_curves))):
            for field in fields:
                field.setEnabled(k == kind)

    def _show(self, error: Exception) -> None:
        self.status.text = "refused"
        self.report.setPlainText(str(error))
        slicer.util.errorDisplay(str(error))

    def _input_words(self, inputs: str) -> List[str]:
        """Writes the inputs into their folder; returns the words after the program."""
        more = (self.logic.points_ras(self.root.currentNode()), self.logic.points_ras(self.entry.currentNode()))
        kind = self.source.currentIndex
        if kind == 0:
            node = self._chosen("Volume", self.volume.currentNode())
            words = case.scan_words(os.path.join(inputs, "scan.nrrd"), self.logic.points_ras(self.seeds.currentNode()), *more)
            self.logic.export(node, words[0])
        elif kind == 1:
            node = self._chosen("Segment", self.segment.currentNode())
            words = case.label_words(os.path.join(inputs, "labels.nrrd"), *more)
            self.logic.export_segment(node, self._chosen("Segment", self.segment.currentSegmentID()), words[0])
        else:
            node = self._chosen("Model", self.model.currentNode())
            curves = os.path.join(inputs, "centerlines") if self.use_curves.checked else None
            words = case.surface_words(os.path.join(inputs, "surface.stl"), curves, *more)
            if curves:
                case.write_curves(curves, self.logic.visible_curves_ras())
            self.logic.export(node, words[0])
        if kind > 0 and self.volume.currentNode():
            words += case.body_words(os.path.join(inputs, "scan.nrrd"))
            self.logic.export(self.volume.currentNode(), words[-1])
        return words

    @staticmethod
    def _chosen(field: str, value: Any) -> Any:
        if not value:
            raise Refused(f"{field}: nothing is chosen; choose one")
        return value

    def on_import(self, *_: Any) -> None:
        """Writes the inputs and starts torquer-import."""
        if self.run is not None:
            return
        made = None
        try:
            # Slicer's own environment would give its libraries to another Python.
            environment = slicer.util.startupEnvironment()
            program = case.program_words(self.command.text, environment)
            place = case.new_place(self.folder.currentPath, self.name.text)
            os.mkdir(place.inputs)
            made = place.inputs
            words = self._input_words(place.inputs)
            self.run = Run([*program, *words, "--out", place.case], environment)
        except (Refused, OSError) as error:
            if made:
                shutil.rmtree(made, ignore_errors=True)
            self._show(error)
            return
        self.place = place
        self.report.setPlainText("")
        self._set_running(True)
        self.timer.start()

    def _set_running(self, is_running: bool) -> None:
        self.import_button.setEnabled(not is_running)
        self.cancel_button.setEnabled(is_running)
        if is_running:
            self.status.text = "started"

    def on_timer(self) -> None:
        """Shows the progress, and the result at the end."""
        run, place = self.run, self.place
        if run is None or place is None:
            return
        ended = run.poll()
        if run.step and not run.is_canceled:
            self.status.text = f"{run.step} .."
        if not ended:
            return
        self._finish()
        error = run.error()
        if error is not None:
            shutil.rmtree(place.inputs, ignore_errors=True)
            if run.is_canceled:
                self.status.text = error
            else:
                self._show(Refused(error))
            return
        if self._load(place.case):
            self.status.text = f"{place.case} is complete"
            self.report.setPlainText(run.message())

    def _finish(self) -> None:
        self.timer.stop()
        self.run = None
        self._set_running(False)

    def on_cancel(self, *_: Any) -> None:
        """Stops torquer-import; the timer then sees its end."""
        if self.run is not None:
            self.run.cancel()
            self.status.text = "stopping"

    def _load(self, folder: str) -> bool:
        try:
            self.logic.load_case(folder)
            return True
        except (Refused, OSError, RuntimeError) as error:
            self._show(error)
            return False

    def _case(self) -> str:
        return os.path.join(self.folder.currentPath, self.name.text)

    def on_load(self, *_: Any) -> None:
        """Loads the case that folder and name give."""
        if self._load(self._case()):
            with open(case.case_files(self._case()).report, encoding="utf-8", errors="replace") as file:
                self.report.setPlainText(file.read())
            self.status.text = f"{self._case()} is loaded"

    def on_open(self, *_: Any) -> None:
        """Shows the command lines of the simulator, and copies them."""
        try:
            lines = case.simulator_lines(self._case())
        except Refused as error:
            self._show(error)
            return
        slicer.app.clipboard().setText(lines)
        self.report.setPlainText(lines)
        self.status.text = "copied: run each line in its own terminal"

    def on_states(self, *_: Any) -> None:
        """Loads wire shapes as curves."""
        try:
            count = self.logic.load_states(self.states_path.currentPath, self.frame.currentText, self.most.value)
        except Refused as error:
            self._show(error)
            return
        self.status.text = f"{count} shapes are loaded"

    def cleanup(self) -> None:
        """Called by Slicer when the module ends or is loaded again."""
        if self.run is not None and self.place is not None:
            self.run.cancel()
            self._finish()
            shutil.rmtree(self.place.inputs, ignore_errors=True)


class TorquerTest(ScriptedLoadableModuleTest):
    """Slicer's own test of the module ("Reload and Test"): frames of points and curves."""

    def setUp(self) -> None:
        slicer.mrmlScene.Clear()

    def runTest(self, **_: Any) -> None:
        self.setUp()
        self.test_points_and_curves_keep_their_place()

    def test_points_and_curves_keep_their_place(self) -> None:
        """Three unlike coordinates, so that a swapped or turned axis shows."""
        logic = TorquerLogic()
        node = slicer.mrmlScene.AddNewNodeByClass(_FIDUCIALS, "seeds")
        slicer.util.updateMarkupsControlPointsFromArray(node, np.array([[12.5, 30.0, -148.0]]), world=True)
        self.assertEqual(case.point_word("--seed", logic.points_ras(node)[0]), "--seed=-12.5,-30,-148")
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "curve.mrk.json")
            with open(path, "w", encoding="utf-8") as file:
                file.write(case.curve_text([[1, 2, 3], [10, 20, 40]]))
            curve = slicer.util.loadMarkups(path)
        curve.SetCurveTypeToLinear()
        points = np.asarray(slicer.util.arrayFromMarkupsCurvePoints(curve, world=True))
        self.assertTrue(np.allclose(points[[0, -1]], [[1, 2, 3], [10, 20, 40]], atol=1e-4))
