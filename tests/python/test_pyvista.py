"""Wires and surfaces for pyvista. Debian has no package of it, so a stand-in takes its place."""

import sys
import types

import numpy as np
import pytest
import torquer
import torquer.export as export


class PolyData:
    """The arguments and attributes of pyvista.PolyData that are used, with cells as lists of points."""

    def __init__(self, var_inp, faces=None, lines=None):
        self.points = np.asarray(var_inp, float)
        assert self.points.ndim == 2 and self.points.shape[1] == 3
        self.lines, self.faces = self._cells(lines), self._cells(faces)
        self.point_data, self.field_data = {}, {}

    def _cells(self, padded):
        cells, rest = [], [] if padded is None else np.asarray(padded).tolist()
        while rest:
            count, *rest = rest
            cells.append(rest[:count])
            assert len(cells[-1]) == count and max(cells[-1]) < len(self.points)
            rest = rest[count:]
        return cells


@pytest.fixture
def pyvista(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", types.SimpleNamespace(PolyData=PolyData))


def pushed(scene):
    simulation = torquer.Simulation(scene)
    hands = simulation.hands
    hands[:, 0] += 5
    simulation.step(0.5, hands)
    return simulation


def test_a_wire_is_a_polyline_with_its_forces(pyvista):
    simulation = pushed(torquer.Scene("ty_phantom").with_values({"effects.internal_forces": True}))
    for mesh in (export.to_pyvista(simulation), export.to_pyvista(export.State.of(simulation))):
        assert (mesh.points == simulation.nodes_mm).all() and mesh.faces == []
        assert mesh.lines == [list(range(len(simulation.nodes_mm)))]
        forces = simulation.forces()
        assert (mesh.point_data["tension_mN"] == forces["tension_mN"]).all()
        assert (mesh.point_data["contact_force_mN"] == forces["contact_mN"]).all()
        assert mesh.field_data["time_s"] == [0.5]


def test_instruments_on_several_curves_are_several_lines(pyvista):
    simulation = pushed(torquer.Scene("buddy_wire"))
    mesh = export.to_pyvista(simulation)
    found = sorted((mesh.points[line] for line in mesh.lines), key=len)
    expected = sorted((simulation.instrument_nodes_mm(k) for k in range(3)), key=len)
    assert [len(line) for line in found] == [len(line) for line in expected]
    assert all(np.allclose(a, b, rtol=0, atol=1e-9) for a, b in zip(found, expected))
    assert len(mesh.points) == sum(map(len, expected))


def test_a_surface_is_made_of_triangles(pyvista):
    points = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]]
    triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    surface = torquer.Surface.from_triangles(points, triangles, "pyramid", "mm")
    mesh = export.to_pyvista(surface)
    assert (mesh.points == surface.points_mm).all() and mesh.lines == []
    assert mesh.faces == surface.triangles.tolist() and len(mesh.faces) == 4


def test_other_things_and_a_missing_pyvista_are_refused(pyvista, monkeypatch):
    with pytest.raises(torquer.Error, match="list is given; give a Simulation, a State of torquer.export, or a Surface"):
        export.to_pyvista([1])
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(torquer.Error, match="pyvista is missing; install it with pip install pyvista"):
        export.to_pyvista(torquer.Simulation("ty_phantom"))
