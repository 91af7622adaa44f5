"""Stand-ins for the modules slicer, qt, ctk and vtk of 3D Slicer, as far as the module Torquer uses them.

Names and parameters are those of Slicer 5: another name, or another number of arguments, raises an error. A widget takes
only the properties that it has.
"""

import json
import os
import sys
import types
import unittest

import numpy as np

DEFINED, PREVIEW = 2, 1


class Node:
    """A node with points in its own frame, which a transform moves in the world. All in RAS."""

    def __init__(self, kind, name, points=(), moved_mm=(0, 0, 0)):
        self._kind, self._name, self._attributes = kind, name, {}
        self.points, self.moved_mm = np.array(points, float).reshape(-1, 3), np.array(moved_mm, float)
        self.triangles, self.visible, self.display, self.image = [], True, None, None
        self.status = [DEFINED] * len(self.points)
        self.is_linear = self.is_locked = False

    def GetClassName(self):
        return self._kind

    def GetName(self):
        return self._name

    def SetName(self, name):
        self._name = name

    def GetAttribute(self, name):
        return self._attributes.get(name)

    def SetAttribute(self, name, value):
        assert isinstance(value, str)
        self._attributes[name] = value

    def GetDisplayVisibility(self):
        return int(self.visible)

    def GetParentTransformNode(self):
        return object() if self.moved_mm.any() else None

    def CreateDefaultDisplayNodes(self):
        self.display = self.display or Display()

    def GetDisplayNode(self):
        return self.display

    def GetImageData(self):
        return self.image

    def GetNumberOfControlPoints(self):
        return len(self.points)

    def GetNthControlPointPositionStatus(self, n):
        return self.status[n]

    def GetNthControlPointPosition(self, n, point):
        point[:] = list(self.points[n])

    def GetNthControlPointPositionWorld(self, n, worldxyz):
        worldxyz[:] = list(self.points[n] + self.moved_mm)

    def SetCurveTypeToLinear(self):
        self.is_linear = True

    def SetLocked(self, locked):
        self.is_locked = bool(locked)


class Display:
    def __init__(self):
        self.shown = []

    def SetOpacity(self, opacity):
        self.opacity = opacity

    def SetPointLabelsVisibility(self, visibility):
        self.shown.append(("points", visibility))

    def SetPropertiesLabelVisibility(self, visibility):
        self.shown.append(("properties", visibility))


class Scene:
    def __init__(self):
        self.nodes = []

    def Clear(self, removeSingletons=0):
        self.nodes = []

    def AddNewNodeByClass(self, className, nodeBaseName=""):
        self.nodes.append(Node(className, nodeBaseName))
        return self.nodes[-1]

    def RemoveNode(self, n):
        self.nodes.remove(n)


class Util:
    """slicer.util, with a list of the files that were written."""

    def __init__(self, scene):
        self._scene, self.exported, self.shown_errors = scene, [], []

    def getNodesByClass(self, className, scene=None):
        # As vtkMRMLScene does, also nodes of derived classes.
        closed = {"vtkMRMLMarkupsCurveNode": ["vtkMRMLMarkupsClosedCurveNode"]}.get(className, [])
        return [node for node in self._scene.nodes if node.GetClassName() in (className, *closed)]

    def arrayFromMarkupsCurvePoints(self, markupsNode, world=False):
        return markupsNode.points + (markupsNode.moved_mm if world else 0)

    def updateMarkupsControlPointsFromArray(self, markupsNode, narray, world=False):
        assert isinstance(narray, np.ndarray) and narray.shape[1:] == (3,)
        markupsNode.points = narray - (markupsNode.moved_mm if world else 0)
        markupsNode.status = [DEFINED] * len(narray)

    def exportNode(self, node, filename, properties={}, world=False):
        # Slicer keeps the format in `properties`, so that a second file in one table has the format of the first.
        ending = os.path.splitext(filename)[1]
        if properties.setdefault("fileFormat", ending) != ending:
            return False
        self.exported.append((node, filename))
        if ending == ".stl":
            write_stl(filename, (node.points + (node.moved_mm if world else 0)) * [-1, -1, 1], node.triangles)
        elif ending == ".nrrd":
            with open(filename, "w") as file:
                file.write("NRRD0004\nspace: left-posterior-superior\n")
        return True

    def loadModel(self, filename, properties={}):
        data = open(filename, "rb").read()
        turn = [-1, -1, 1] if b"SPACE=LPS" in data[:80] else [1, 1, 1]
        rows = np.frombuffer(data, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")]), offset=84)
        node = Node("vtkMRMLModelNode", "surface", rows["corners"].reshape(-1, 3) * turn)
        node.display = Display()
        self._scene.nodes.append(node)
        return node

    def loadMarkups(self, filename, properties={}):
        (markup,) = json.load(open(filename))["markups"]
        turn = {"LPS": [-1, -1, 1], "RAS": [1, 1, 1]}[markup["coordinateSystem"]]
        points = [point["position"] for point in markup["controlPoints"]]
        name = os.path.basename(filename)[: -len(".mrk.json")]
        node = Node(f"vtkMRMLMarkups{markup['type']}Node", name, np.array(points) * turn)
        self._scene.nodes.append(node)
        return node

    def startupEnvironment(self):
        return dict(os.environ, FROM_SLICER="startup")

    def errorDisplay(self, text, windowTitle=None, parent=None, standardButtons=None, **kwargs):
        self.shown_errors.append(text)


def write_stl(path, points_lps, triangles):
    """As Slicer writes it: the header names the system."""
    rows = np.zeros(len(triangles), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")]))
    rows["corners"] = points_lps[np.array(triangles, int)]
    with open(path, "wb") as file:
        file.write(b"3D Slicer output. SPACE=LPS".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes())


class SegmentationsLogic:
    """Exports the segments that have a name in `drawn`."""

    def __init__(self):
        self.drawn = {"Segment_1"}

    def ExportSegmentsToLabelmapNode(
        self, segmentationNode, segmentIDs, labelmapNode, referenceVolumeNode=None, extentComputationMode=1, colorTableNode=None
    ):
        assert isinstance(segmentIDs, StringArray) and extentComputationMode == 5
        labelmapNode.image = segmentIDs.values if set(segmentIDs.values) <= self.drawn else None
        return True


class StringArray:
    def __init__(self):
        self.values = []

    def InsertNextValue(self, f):
        self.values.append(f)


class Widget:
    """Any widget: a signal's handlers by its signature, and the properties of its class alone."""

    SIGNALS = ()
    PROPERTIES = {}

    def __init__(self, parent=None):
        self.__dict__.update(self.PROPERTIES, handlers={}, enabled=True)

    def __setattr__(self, name, value):
        assert name in self.__dict__, f"{type(self).__name__} has no property {name}"
        self.__dict__[name] = value

    def connect(self, signal, handler):
        assert signal in self.SIGNALS, f"{type(self).__name__} has no signal {signal}"
        self.handlers[signal] = handler

    def setEnabled(self, enabled):
        self.enabled = enabled

    def setToolTip(self, text):
        assert isinstance(text, str)


def _text(self, text=""):
    Widget.__init__(self)
    self.text = text


class Button(Widget):
    SIGNALS, PROPERTIES, __init__ = ("clicked(bool)",), {"text": ""}, _text

    def click(self):
        if self.enabled:
            self.handlers["clicked(bool)"](False)


class Line(Widget):
    PROPERTIES, __init__ = {"text": ""}, _text


class PlainText(Widget):
    PROPERTIES = {"plainText": "", "readOnly": False}

    def setPlainText(self, text):
        self.plainText = text


class Combo(Widget):
    SIGNALS, PROPERTIES = ("currentIndexChanged(int)",), {"currentIndex": 0, "items": []}

    def addItems(self, texts):
        self.items = texts

    @property
    def currentText(self):
        return self.items[self.currentIndex]

    def choose(self, index):
        self.currentIndex = index
        self.handlers["currentIndexChanged(int)"](index)


class Check(Widget):
    PROPERTIES = {"checked": False}


class Spin(Widget):
    PROPERTIES = {"value": 0}

    def setRange(self, minimum, maximum):
        pass

    def setValue(self, val):
        self.value = val


class PathLine(Widget):
    Dirs, Files = 1, 2
    PROPERTIES = {"filters": 0, "currentPath": ""}


class NodeCombo(Widget):
    PROPERTIES = {"nodeTypes": [], "noneEnabled": False, "addEnabled": True, "removeEnabled": True, "node": None}

    def setMRMLScene(self, scene):
        assert isinstance(scene, Scene)

    def currentNode(self):
        return self.node


class SegmentCombo(NodeCombo):
    PROPERTIES = {"node": None, "segment": ""}

    def currentSegmentID(self):
        return self.segment


class Timer(Widget):
    SIGNALS, PROPERTIES = ("timeout()",), {"active": False}

    def setInterval(self, msec):
        pass

    def start(self):
        self.active = True

    def stop(self):
        self.active = False


class Layout:
    def __init__(self, parent=None):
        pass

    def addRow(self, *words):
        assert len(words) in (1, 2)

    def addWidget(self, widget):
        pass

    def addStretch(self, stretch=0):
        pass


class Module:
    def __init__(self, parent):
        self.parent = parent


class ModuleWidget:
    def __init__(self, parent=None):
        self.layout = Layout()

    def setup(self):
        pass


class ModuleLogic:
    def __init__(self, parent=None):
        pass


class Clipboard:
    copied = None

    def setText(self, text):
        Clipboard.copied = text


def module(name, **members):
    out = types.ModuleType(name)
    out.__dict__.update(members)
    return out


def installed(monkeypatch):
    """Puts the stand-ins where "import slicer" finds them; returns slicer."""
    scene, space = Scene(), types.SimpleNamespace
    logic = SegmentationsLogic()
    slicer = module(
        "slicer", mrmlScene=scene, util=Util(scene), app=space(clipboard=lambda: Clipboard()),
        modules=space(segmentations=space(logic=lambda: logic)), vtkSegmentation=space(EXTENT_REFERENCE_GEOMETRY=5),
        vtkMRMLMarkupsNode=space(PositionDefined=DEFINED, PositionPreview=PREVIEW), qMRMLNodeComboBox=NodeCombo,
        qMRMLSegmentSelectorWidget=SegmentCombo,
    )
    base = module(
        "slicer.ScriptedLoadableModule", ScriptedLoadableModule=Module, ScriptedLoadableModuleWidget=ModuleWidget,
        ScriptedLoadableModuleLogic=ModuleLogic, ScriptedLoadableModuleTest=type("Test", (unittest.TestCase,), {}),
    )
    widgets = {"QComboBox": Combo, "QCheckBox": Check, "QLineEdit": Line, "QLabel": Line, "QPlainTextEdit": PlainText}
    more = {"QPushButton": Button, "QSpinBox": Spin, "QTimer": Timer, "QFormLayout": Layout}
    ctk = module("ctk", ctkCollapsibleButton=Button, ctkPathLineEdit=PathLine)
    for one in (slicer, base, module("qt", **widgets, **more), ctk, module("vtk", vtkStringArray=StringArray)):
        monkeypatch.setitem(sys.modules, one.__name__, one)
    return slicer
