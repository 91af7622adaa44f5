"""Files for and from other programs, read and written by VTK, which ParaView and VMTK use."""

import numpy as np
import pytest
import torquer
import torquer.centerlines
import torquer.export
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLPolyDataWriter


def read(path):
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    return reader.GetOutput()


def test_vtk_reads_exported_files(tmp_path):
    text = open(torquer.scene_path("drill_tube"), encoding="utf-8").read() + "\n[effects.internal_forces]\n"
    simulation = torquer.Simulation(torquer.Scene.from_text(text, str(tmp_path)))
    hands = simulation.hands
    states = []
    for mm in range(1, 61):
        hands[0, 0] = mm
        simulation.step(0.05 * mm, hands)
        states.append(torquer.export.State.of(simulation))
    torquer.export.write(states, tmp_path / "wire.pvd")
    files = sorted((tmp_path / "wire").iterdir())
    assert len(files) == len(states) == 60
    for state, data in [*zip(states, map(read, files)), (states[-1], torquer.export.to_vtk(states[-1]))]:
        assert np.array_equal(vtk_to_numpy(data.GetPoints().GetData()), state.nodes_mm)
        assert data.GetNumberOfLines() == 1 and data.GetCell(0).GetNumberOfPoints() == len(state.nodes_mm)
        arrays = data.GetPointData()
        assert arrays.GetNumberOfArrays() == len(state.point_data) >= 5
        for name, values in state.point_data.items():
            assert np.array_equal(vtk_to_numpy(arrays.GetArray(name)), values)


@pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended"])
@pytest.mark.parametrize("compressor", ["None", "ZLib"])
@pytest.mark.parametrize("encoded", [False, True])
def test_centerlines_as_vmtk_writes_them(tmp_path, mode, compressor, encoded):
    random = np.random.default_rng(5)
    # More than one block of the compressor.
    lines = [np.cumsum(random.normal(size=(count, 3)), axis=0) for count in (2, 5000, 40)]
    radii = [random.uniform(0.5, 5, len(line)) for line in lines]
    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.concatenate(lines), deep=True))
    cells = vtkCellArray()
    first = 0
    for line in lines:
        cells.InsertNextCell(len(line))
        for k in range(len(line)):
            cells.InsertCellPoint(first + k)
        first += len(line)
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetLines(cells)
    radius = numpy_to_vtk(np.concatenate(radii), deep=True)
    radius.SetName("MaximumInscribedSphereRadius")
    data.GetPointData().AddArray(radius)
    writer = vtkXMLPolyDataWriter()
    writer.SetFileName(str(tmp_path / "centerlines.vtp"))
    writer.SetInputData(data)
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.SetEncodeAppendedData(encoded)
    assert writer.Write() == 1

    found = torquer.centerlines.read_vtp(tmp_path / "centerlines.vtp")
    assert len(found) == len(lines)
    for line, points_mm, radii_mm in zip(found, lines, radii):
        # The text format has 11 digits.
        assert np.allclose(line.points, points_mm, rtol=0, atol=1e-8 if mode == "Ascii" else 0)
        assert np.allclose(line.radii, radii_mm, rtol=0, atol=1e-8 if mode == "Ascii" else 0)
