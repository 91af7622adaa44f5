"""Cases from surfaces and centerlines of other programs: the same vessel from every kind of file, and refused ones."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import torquer
from torquer.importer import _given, case, surface
from vtkmodules.vtkIOGeometry import vtkOBJWriter
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter
from vtkmodules.vtkIOPLY import vtkPLYWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

# A trunk from z = 0 to 50 mm with two branches to z = 90 mm: start, end, radius in mm.
TRUNK, LEFT, RIGHT = ((0, 0, 0), (0, 0, 50), 5.0), ((0, 0, 50), (-24, 0, 88), 3.0), ((0, 0, 50), (22, 6, 84), 2.5)
STEP_MM = 0.7


def depth(points, tube):
    a, b = (np.array(end, float) for end in tube[:2])
    share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return tube[2] - np.linalg.norm(points - a - share[..., None] * (b - a), axis=-1)


@pytest.fixture(scope="module")
def vessel():
    """Closed surface, flat at z = 2."""
    low, counts = np.array([-30.0, -8.0, 2.0]), (135, 24, 90)
    k, j, i = np.meshgrid(*(np.arange(n) for n in counts), indexing="ij")
    points = np.stack([i, j, k], -1) * STEP_MM + low
    values = np.max([depth(points, tube) for tube in (TRUNK, LEFT, RIGHT)], axis=0)
    affine = np.diag([STEP_MM] * 3 + [1.0])
    affine[:3, 3] = low
    return surface.isosurface(np.clip(0.5 + values / 2, 0, 1).astype(np.float32), 0.5, affine)


def opened(mesh):
    """Without its flat end, and inside out."""
    kept = mesh.corners()[:, :, 2].max(axis=1) > 2.5
    return surface.Mesh(mesh.points, mesh.triangles[kept][:, ::-1])


def write_vtk(writer, path, mesh, title=None):
    writer.SetFileName(str(path))
    writer.SetInputData(surface.to_vtk(mesh))
    if title:
        writer.SetHeader(title)
    assert writer.Write()


def vmtk_file(path, lines):
    """A .vtp as vmtkcenterlines writes it: each line has its own points."""
    count = sum(len(points) for points, _ in lines)
    text = lambda values: " ".join(map(str, np.ravel(values)))
    points, radii = np.vstack([points for points, _ in lines]), np.concatenate([radii for _, radii in lines])
    path.write_text(
        f'<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="{count}" NumberOfLines="{len(lines)}"><PointData>'
        f'<DataArray type="Float64" Name="MaximumInscribedSphereRadius" format="ascii">{text(radii)}</DataArray></PointData>'
        f'<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">{text(points)}</DataArray></Points>'
        f'<Lines><DataArray type="Int64" Name="connectivity" format="ascii">{text(np.arange(count))}</DataArray>'
        f'<DataArray type="Int64" Name="offsets" format="ascii">{text(np.cumsum([len(p) for p, _ in lines]))}</DataArray>'
        "</Lines></Piece></PolyData></VTKFile>"
    )


def way(*tubes):
    """Points and radii along tubes, one after the other."""
    points = [np.linspace(tube[0], tube[1], 30)[k > 0 :] for k, tube in enumerate(tubes)]
    return np.vstack(points), np.concatenate([np.full(len(some), tube[2]) for some, tube in zip(points, tubes)])


def run(*arguments):
    command = [sys.executable, "-B", "-m", "torquer.importer", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_every_kind_of_surface_gives_the_same(vessel, tmp_path):
    open_one = opened(vessel)
    turned = surface.Mesh(vessel.points * [-0.1, -0.1, 0.1], vessel.triangles)
    surface.write_stl(tmp_path / "a.stl", vessel)
    write_vtk(vtkOBJWriter(), tmp_path / "b.obj", open_one)
    write_vtk(vtkPLYWriter(), tmp_path / "c.ply", vessel)
    write_vtk(vtkXMLPolyDataWriter(), tmp_path / "d.vtp", open_one)
    write_vtk(vtkPolyDataWriter(), tmp_path / "e.vtk", turned, "3D Slicer output. SPACE=RAS")
    for name in ("a.stl", "b.obj", "c.ply", "d.vtp", "e.vtk"):
        mesh, space, facts = _given.read_surface(tmp_path / name, "cm" if name == "e.vtk" else "mm", None)
        # An opened one lacks a layer of 0.7 mm of 83 mm.
        assert abs(mesh.volume_mm3() / vessel.volume_mm3() - 1) < 0.005, name
        assert np.allclose(mesh.points.min(axis=0), vessel.points.min(axis=0), atol=0.8), name
        edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all(), f"{name} is not closed"
        assert space == {"a.stl": "LPS", "e.vtk": "RAS"}.get(name, "LPS")
        assert any("assumed" in fact for fact in facts) == (name[0] in "bcd"), name
    with pytest.raises(torquer.Error, match="SPACE=RAS, but --space is LPS"):
        _given.read_surface(tmp_path / "e.vtk", "cm", "LPS")


def test_an_open_surface_becomes_a_case_that_runs(vessel, tmp_path):
    write_vtk(vtkXMLPolyDataWriter(), tmp_path / "open.vtp", opened(vessel))
    done = run(tmp_path / "open.vtp", "--mesh-unit", "mm", "--out", tmp_path / "patient")
    assert done.returncode == 0, done.stderr
    scene = torquer.Scene(str(tmp_path / "patient/patient.toml"))
    assert scene.centerlines == ["c00", "c01"] and {"flow", "fluoroscopy"} <= set(scene.effects)
    assert scene.centerline_mm("c00")[0][2] < 9, "the root is the widest end"
    assert sorted(os.listdir(tmp_path / "patient")) == ["centerlines", "patient.toml", "picture.png", "report.txt", "surface.stl"]
    assert "Open end of radius" in (tmp_path / "patient/report.txt").read_text()
    report = torquer.Simulation(scene).step(0.1, [[2, 0]])
    assert report.converged


def test_lines_of_vmtk_that_share_their_trunk_are_a_tree(tmp_path):
    # Their shared parts differ by less than a tenth of its radius.
    points, radii = way(TRUNK, LEFT)
    points[1:-1, 0] += 0.1
    vmtk_file(tmp_path / "lines.vtp", [way(TRUNK, RIGHT), (points, radii)])
    curves, facts = _given.read_lines(tmp_path / "lines.vtp", "mm", "LPS")
    assert facts[0].startswith("2 lines") and facts[0].endswith("tree of 2 branches.")
    assert np.allclose(curves[0].points[[0, -1]], [TRUNK[0], LEFT[1]]), "the first goes to the farthest tip"
    assert np.allclose(curves[1].points[[0, -1]], [TRUNK[1], RIGHT[1]], atol=4) and curves[1].parent == 0
    assert np.linalg.norm(curves[0].points - curves[1].points[0], axis=1).min() == 0, "it begins on the first"
    assert curves[1].radii.max() < 3, "within the trunk the branch has its own radius"
    # In RAS and cm, and from the other end.
    curves, _ = _given.read_lines(tmp_path / "lines.vtp", "cm", "RAS", [(240, 0, 880)])
    assert np.allclose(curves[0].points[0], (240, 0, 880)) and len(curves) == 2
    # Lines that end at the branch, as the tool for bifurcations gives them.
    vmtk_file(tmp_path / "parts.vtp", [way(TRUNK), way(LEFT), way(RIGHT)])
    assert len(_given.read_lines(tmp_path / "parts.vtp", "mm", "LPS")[0]) == 2
    vmtk_file(tmp_path / "apart.vtp", [way(TRUNK), way(((50, 0, 0), (60, 0, 0), 2.0))])
    with pytest.raises(torquer.Error, match=r"at \(50\.0, 0\.0, 0\.0\) mm meets no other"):
        _given.read_lines(tmp_path / "apart.vtp", "mm", "LPS")


def slicer_curve(path, points, system):
    """A curve as 3D Slicer saves it, with a point that was not placed."""
    turn = [-1, -1, 1] if system == "RAS" else [1, 1, 1]
    placed = [{"position": list(point * turn), "positionStatus": "defined"} for point in np.asarray(points, float)]
    points = [*placed, {"position": [0, 0, 500], "positionStatus": "undefined"}]
    markup = {"type": "Curve", "coordinateSystem": system, "controlPoints": points}
    path.write_text(json.dumps({"markups": [markup]}))


def test_edited_curves_are_a_tree_with_radii_of_the_surface(vessel, tmp_path):
    curves = tmp_path / "curves"
    curves.mkdir()
    # Two far points in LPS, and a start 2 mm beside the trunk's line.
    slicer_curve(curves / "b.mrk.json", [(0, 0, 4), (0, 0, 50), LEFT[1]], "LPS")
    slicer_curve(curves / "a.mrk.json", [(2, 0, 50), RIGHT[1]], "RAS")
    found, facts = _given.read_curves(curves, vessel)
    assert len(found) == 2 and found[1].parent == 0 and facts[0].startswith("2 curves")
    assert np.allclose(found[0].points[[0, -1]], [(0, 0, 4), LEFT[1]]) and np.allclose(found[1].points[-1], RIGHT[1])
    assert np.linalg.norm(found[0].points - found[1].points[0], axis=1).min() < 0.6, "it begins on the first"
    for curve, tube in zip(found, (LEFT, RIGHT)):
        beyond = (curve.points[:, 2] > 65) & (curve.points[:, 2] < 80)
        assert np.allclose(curve.radii[beyond], depth(curve.points[beyond], tube), atol=0.3), "it lies beside the middle"
    assert abs(found[0].radii[20] - 5) < 0.3
    assert np.allclose(_given.read_curves(curves, vessel, [LEFT[1]])[0][0].points[0], LEFT[1]), "another root"
    entries = case.entries_of(found)
    assert case.first_entry(entries).name == "c01 end", "the lowest"
    assert case.entry_at(entries, np.array(LEFT[1])).name == "c00 end"
    entries[0] = case.Entry("narrow", np.zeros(3), np.eye(3)[2], 0.3)
    with pytest.raises(torquer.Error, match="--entry=0,1,2: the nearest tip, narrow, has a radius of 0.30 mm, less than 0.36"):
        case.entry_at(entries, np.array([0, 1, 2]))


def test_refused_curves(vessel, tmp_path):
    with pytest.raises(torquer.Error, match=r"holds no curve \(.mrk.json\)"):
        _given.read_curves(tmp_path, vessel)
    slicer_curve(tmp_path / "a.mrk.json", [(0, 0, 4), (0, 0, 50), LEFT[1]], "LPS")
    good = (tmp_path / "a.mrk.json").read_text()
    for old, new, said in [
        ('"LPS"', '"IJK"', "field coordinateSystem is 'IJK', not LPS or RAS"), ("Curve", "Fiducial", "is not one curve"),
        ('"defined"', '"preview"', "field controlPoints has no two places"), ("{", "[", "is not one curve"),
        ('"type"', '"coordinateUnits": "pc", "type"', "field coordinateUnits is 'pc', not one of mm, m"),
    ]:
        (tmp_path / "a.mrk.json").write_text(good.replace(old, new))
        with pytest.raises(torquer.Error) as caught:
            _given.read_curves(tmp_path, vessel)
        assert f"{tmp_path}/a.mrk.json: {said}" in str(caught.value) and "save it again" in str(caught.value), new
    (tmp_path / "a.mrk.json").write_text(good)
    slicer_curve(tmp_path / "b.mrk.json", [(50, 0, 50), (60, 0, 50)], "LPS")
    with pytest.raises(torquer.Error, match=r"at \(50\.0, 0\.0, 50\.0\) mm meets no other one; move its first point onto"):
        _given.read_curves(tmp_path, vessel)


def test_refused_surfaces(vessel, tmp_path):
    surface.write_stl(tmp_path / "a.stl", vessel)
    vmtk_file(tmp_path / "lines.vtp", [way(TRUNK, LEFT)])
    (tmp_path / "cut.vtk").write_bytes(b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1\n")
    (tmp_path / "image.vtk").write_text(
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 1 1 1\nORIGIN 0 0 0\nSPACING 1 1 1\n"
    )
    for name, said in [
        ("lines.vtp", "holds 1 lines and no triangles; give it by --centerlines"), ("cut.vtk", "cannot be read"),
        ("image.vtk", "not vtkPolyData"), ("none.vtp", "none.vtp: cannot be read"), ("none.stl", "none.stl"),
    ]:
        with pytest.raises(torquer.Error) as caught:
            _given.read_surface(tmp_path / name, "mm", None)
        assert said in str(caught.value), name
    with pytest.raises(torquer.Error, match='mesh_unit = "mm"'):
        _given.read_surface(tmp_path / "a.stl", "m", None)
    for words, said in [
        ([tmp_path / "a.stl"], "give --mesh-unit"),
        ([tmp_path / "a.stl", "--mesh-unit", "mm", "--seed=1,2,3"], "--seed: is for a scan"),
        ([tmp_path, "--mesh-unit", "mm", "--seed=1,2,3"], "--mesh-unit: is for a surface"),
    ]:
        done = run(*words, "--out", tmp_path / "refused")
        assert done.returncode == 2 and said in done.stderr, done.stderr
    assert not (tmp_path / "refused").exists()


def test_triangles_that_cannot_be_used_are_named():
    corner = np.eye(3)
    with pytest.raises(torquer.Error, match="box: triangle 0 names point 3; there are points 0 to 2"):
        torquer.Surface.from_triangles(corner, [[0, 1, 3]], "box", "mm")
    with pytest.raises(torquer.Error, match="box: point 1 is not finite"):
        torquer.Surface.from_triangles(corner * [[1], [np.nan], [1]], [[0, 1, 2]], "box", "mm")
    with pytest.raises(torquer.Error, match="'?furlong'?.*one of: mm, m, cm, um, in"):
        torquer.Surface.from_triangles(corner, [[0, 1, 2]], "box", "furlong")
    with pytest.raises(torquer.Error, match="no triangles"):
        torquer.Surface.from_triangles(corner, np.zeros((0, 3), int), "box", "mm")
