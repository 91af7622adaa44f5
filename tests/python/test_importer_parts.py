"""Cases from rings, from vessels of several parts, with near ties between their ends, and inputs that are no vessels."""

import pathlib
import re
import tomllib

import numpy as np
import pytest
import torquer
from torquer.importer import _given, case, centerlines, errors, scan, surface
from torquer.importer.__main__ import _findings, _label_mesh, arguments_of, import_case
from torquer.importer.centerlines import Curve

KEYS = pathlib.Path(__file__).parents[2] / "host/scenes/README.md"
# Two legs, equally low and as wide as the trunk above them: start, end and radius in mm.
LEGS = [((0, 0, 27), (0, 0, 49), 3.0), ((0, 0, 27), (14, 0, 4), 3.0), ((0, 0, 27), (-14, 0, 4), 3.0)]
LONG, SHORT = ((6, 6, 6), (6, 6, 40), 3.0), ((20, 6, 6), (20, 6, 26), 2.5)


def depth(points, tube):
    a, b = (np.array(end, float) for end in tube[:2])
    share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return tube[2] - np.linalg.norm(points - a - share[..., None] * (b - a), axis=-1)


def grid(*counts):
    """Places of voxels of 1 mm, of the shape (slices, rows, columns, 3)."""
    k, j, i = np.meshgrid(*(np.arange(n) for n in counts), indexing="ij")
    return np.stack([i, j, k], -1).astype(float)


def label_file(path, inside, number=1):
    scan.write_nifti(path, (number * inside).astype(np.uint8), np.eye(4))
    return path


def imported(path, *words):
    """Runs the import; its report."""
    return import_case(arguments_of([str(path), *words, "--out", str(path.parent / "case")]))


def test_a_ring_becomes_a_case_that_runs(tmp_path):
    off = grid(12, 32, 32) - [16, 16, 6]
    ring = np.hypot(np.hypot(off[..., 0], off[..., 1]) - 10, off[..., 2]) < 4
    imported(label_file(tmp_path / "ring.nii.gz", ring), "--label", "1")
    scene = torquer.Scene(str(tmp_path / "case/case.toml"))
    assert "flow" in scene.effects
    lines = [scene.centerline_mm(name) - [16, 16, 6] for name in scene.centerlines]
    assert all(np.abs(np.hypot(line[:, 0], line[:, 1]) - 10).max() < 2 for line in lines)
    length = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines)
    assert 0.8 < length / (2 * np.pi * 10) < 1.05
    assert torquer.Simulation(scene).step(0.1, [[1, 0]]).converged


def curve(name, start, end, radius, parent=None):
    points = np.linspace(start, end, 60)
    return Curve(name, points, np.full(60, float(radius)), parent)


def test_the_blood_enters_at_a_free_end():
    trunk, left = curve("c00", (0, 0, 0), (0, 0, 60), 3), curve("c01", (0, 0, 30), (40, 0, 30), 2, 0)
    assert [one.name for one in case.entries_of([trunk, left])] == ["c00 start", "c00 end", "c01 end"]
    assert 'inlet = "c00"\n#' in case.scene_text("a", "a", [trunk, left], case.entry_of(trunk, True))
    # Two curves from one place, as in a ring or with given lines.
    wide = curve("c01", (0, 0, 0), (0, 40, 0), 4, 0)
    assert [one.name for one in case.entries_of([trunk, wide])] == ["c01 end", "c00 end"]
    flow = tomllib.loads(case.scene_text("a", "a", [trunk, wide], case.entry_of(wide, False)))["effects"]["flow"]
    assert (flow["inlet"], flow["inlet_end"]) == ("c01", "end")
    # An end that lies on another curve is an outlet for neither blood nor wires.
    back = curve("c01", (0, 0, 30), (0.3, 0, 50), 2, 0)
    assert [one.name for one in case.entries_of([trunk, back])] == ["c00 start", "c00 end"]


def test_numbers_of_a_scene_are_within_the_limits_of_its_keys():
    limits = {
        name: (float(low), float(high))
        for name, low, high in re.findall(r"^\| `([\w.]+)` \| number from (\S+) to (\S+) \|", KEYS.read_text(), re.M)
    }
    checked = set()
    for scale in (0.005, 1, 15):
        curves = [curve("c00", (0, 0, 0), (0, 0, 60), 4 * scale), curve("c01", (0, 0, 30), (40, 0, 30), 3 * scale, 0)]
        tables = tomllib.loads(case.scene_text("a", "a", curves, case.entry_of(curves[0], True)))
        for table in [tables["vessel"], *tables["effects"].values()]:
            for key, value in table.items():
                if key in limits:
                    low, high = limits[key]
                    assert low <= value <= high, (scale, key, value)
                    checked.add(key)
    assert {"target_radius_mm", "inlet_mL_s", "rate_mL_s", "voxel_mm"} <= checked
    assert case.size_facts([curve("c00", (0, 0, 0), (0, 0, 60), 24)]) == []
    assert "radius above 39.0 mm, more than an aorta" in case.size_facts([curve("c00", (0, 0, 0), (0, 0, 60), 39)])[0]


def test_no_number_is_a_negative_zero():
    text = case.wire_text(True, np.array([0, 0, -1.0]), 100) + case._list([-1e-9, -0.004, 0.004])
    assert not re.search(r"-0\.0+\b", text) and "0.000000" in text


def test_two_unconnected_vessels_become_a_case_with_flow_in_both(tmp_path):
    points = grid(46, 13, 27)
    path = label_file(tmp_path / "two.nii.gz", (np.maximum(depth(points, LONG), depth(points, SHORT)) > 0), 4)
    # Volumes of cylinders with two half balls; voxels of 1 mm are up to a fifth off.
    long_ml, short_ml = (np.pi * r**2 * (length + 4 / 3 * r) / 1000 for r, length in ((3.0, 34), (2.5, 20)))

    def named(said):
        ml, *place = re.search(r"(\S+) mL at \((\S+), (\S+), (\S+)\) mm[.,]", said).groups()
        return float(ml), np.array(place, float)

    said = imported(path, "--label", "4")
    both = re.search(r"^Parts: 2 without connection, each with its own inlet of the blood: (.*? mm), (.*? mm\.)", said, re.M)
    for text, tube, true_ml in ((f"{both[1]},", LONG, long_ml), (both[2], SHORT, short_ml)):
        ml, place = named(text)
        assert abs(ml / true_ml - 1) < 0.25 and abs(depth(place, tube)) < 0.8
    report = (tmp_path / "case/report.txt").read_text()
    assert both[0] in report and re.search(r"^Label 4: \d\.\d\d mL\.$", report, re.M)
    curves = centerlines.read(tmp_path / "case/centerlines")
    assert [(one.name, one.parent) for one in curves] == [("c00", None), ("c01", None)]
    assert depth(curves[0].points, LONG).min() > 0 and depth(curves[1].points, SHORT).min() > 0
    flow = tomllib.loads((tmp_path / "case/case.toml").read_text())["effects"]["flow"]
    (other,) = flow["other_inlet"]
    assert flow["inlet"] == "c00" and other["centerline"] == "c01"
    # As the cubes of the radii.
    for one, flow_mL_s in zip(curves, (flow["inlet_mL_s"], other["mL_s"])):
        assert abs(flow_mL_s / (80 * (np.median(one.radii[:10]) / 12) ** 3) - 1) < 0.01
    assert torquer.Simulation(str(tmp_path / "case/case.toml")).step(0.1, [[1, 0]]).converged
    # One part alone.
    (tmp_path / "case").rename(tmp_path / "first")
    said = imported(path, "--label", "4", "--root=20,6,26")
    ml, place = named(said[said.index("Left out: 1 part without connection to the vessel of") :].partition(" mL: ")[2])
    assert abs(ml / long_ml - 1) < 0.25 and abs(depth(place, LONG)) < 0.8 and "--root" in said
    (only,) = centerlines.read(tmp_path / "case/centerlines")
    for points in (surface.from_stl(tmp_path / "case/surface.stl").points, only.points):
        assert depth(points, SHORT).min() > -1


def test_an_entry_in_one_part_has_its_target_and_flow():
    # The first part has no branch beside the trunk; the second one has two.
    first = curve("c00", (0, 0, 0), (0, 0, 60), 6)
    second = [curve("c01", (50, 0, 0), (50, 0, 60), 4), curve("c02", (50, 0, 30), (90, 0, 30), 3, 1), curve("c03", (50, 0, 40), (50, 30, 40), 3, 1)]
    curves = [first, *second]
    entries = case.entries_of(curves)
    assert [one.name for one in entries if one.is_inlet] == ["c00 start", "c01 start"]
    assert [one.name for one in entries] == ["c00 start", "c00 end", "c01 start", "c01 end", "c02 end", "c03 end"]
    assert case.first_entry(entries).name == "c02 end", "the lowest that is no inlet"
    effects = tomllib.loads(case.scene_text("a", "a", curves, entries[5]))["effects"]
    assert effects["assessment"]["target_centerline"] == "c02" and effects["flow"]["inlet"] == "c00"
    assert effects["contrast"]["rate_mL_s"] == 1.0 and effects["flow"]["other_inlet"][0]["centerline"] == "c01"
    effects = tomllib.loads(case.scene_text("a", "a", curves, entries[1]))["effects"]
    assert "assessment" not in effects, "the only curve of its part"
    assert abs(effects["contrast"]["rate_mL_s"] - 80 * (6 / 12) ** 3 / 4) < 0.01


def test_the_wire_of_a_case_runs_in_the_part_of_its_entry():
    first, second = curve("c00", (0, 0, 0), (0, 0, 60), 6), curve("c01", (50, 0, 0), (50, 0, 100), 4)
    # Four fifths of the longest way in that part.
    assert abs(errors.way_of([first, second], case.entry_of(first, True)) - 0.8 * (60 - 2.5 * 6)) < 2


def test_labels_of_several_values_are_one_vessel():
    points = grid(46, 13, 13)
    # A tube whose halves have two values, as from TotalSegmentator, and a thread beside it.
    values = (depth(points, LONG) > 0) * np.where(points[..., 2] < 20, 51, 52)
    values[10:40, 11, 11] = 60
    true_ml = np.count_nonzero((values == 51) | (values == 52)) / 1000
    read = scan.Scan(values.astype(np.int16), np.eye(4), [], "labels.nii.gz")
    mesh, facts = _label_mesh(read, [51, 52])
    assert len(surface.parts(mesh)) == 1 and abs(mesh.volume_mm3() / 1000 / true_ml - 1) < 0.1
    assert facts == [f"Label 51, 52: {true_ml:.2f} mL."]
    half, _ = _label_mesh(read, [52])
    assert half.volume_mm3() < 0.7 * mesh.volume_mm3() and half.points[:, 2].min() > 18
    with pytest.raises(torquer.Error, match="labels.nii.gz: the label is nowhere thicker than two voxels"):
        _label_mesh(read, [60])
    values[10:40, 1:11:2, 11] = 60
    read = scan.Scan(values.astype(np.int16), np.eye(4), [], "labels.nii.gz")
    found = re.fullmatch(r"The surface has (\d+) % less, because vessels of two voxels or less are lost; .*", _label_mesh(read, [51, 52, 60])[1][1])
    threads = np.count_nonzero(values == 60) / np.count_nonzero(values)
    assert threads < float(found[1]) / 100 < threads + 0.1


def test_parts_of_a_surface():
    points = grid(46, 13, 27)
    # A hollow within the long tube, which faces inward, is no part. Neither is noise.
    inside = np.maximum(depth(points, LONG), depth(points, SHORT)) / 2
    inside[25:27, 5:8, 5:8] = -0.5
    inside[40, 6, 20] = 0.01
    mesh = surface.isosurface(np.clip(0.5 + inside, 0, 1).astype(np.float32), 0.5, np.eye(4))
    found = surface.parts(mesh)
    assert len(found) == 3 and [len(one.points) > 100 for one in found] == [True, True, False]
    assert depth(found[0].points, LONG).min() > -1 and depth(found[1].points, SHORT).min() > -1
    kept, facts = surface.wanted(mesh, [(20, 6, 26)])
    assert depth(kept.points, SHORT).min() > -1 and "1 part without" in facts[0]
    assert surface.wanted(found[0]) == (found[0], [])
    # A fragment is left out, unless it is next to a seed or the entry.
    inside[:, :, 17:][inside[:, :, 17:] < 0.7] = -0.5
    mesh = surface.isosurface(np.clip(0.5 + inside, 0, 1).astype(np.float32), 0.5, np.eye(4))
    volumes = [one.volume_mm3() for one in surface.parts(mesh)]
    assert 10 < volumes[1] < 0.1 * volumes[0]
    assert len(surface.parts(surface.wanted(mesh)[0])) == 1
    assert len(surface.parts(surface.wanted(mesh, near_mm=[(20, 6, 26)])[0])) == 2


def test_a_surface_of_two_parts_has_the_parts_of_its_curves(tmp_path):
    points = grid(46, 13, 27)
    inside = np.maximum(depth(points, LONG), depth(points, SHORT))
    surface.write_stl(tmp_path / "two.stl", surface.isosurface(np.clip(0.5 + inside / 2, 0, 1).astype(np.float32), 0.5, np.eye(4)))
    (tmp_path / "lines").mkdir()
    centerlines.write(tmp_path / "lines/short", [Curve("c00", np.linspace(SHORT[0], SHORT[1], 20), np.full(20, 2.0), None)])
    assert "Left out: 1 part" in imported(tmp_path / "two.stl", "--mesh-unit", "mm", "--centerlines", str(tmp_path / "lines/short"))
    assert depth(surface.from_stl(tmp_path / "case/surface.stl").points, SHORT).min() > -1
    # Curves in both parts, of which one begins at a root.
    both = [Curve("c00", np.linspace(LONG[0], LONG[1], 34), np.full(34, 2.0), None), Curve("c01", np.linspace(SHORT[0], SHORT[1], 20), np.full(20, 2.0), None)]
    centerlines.write(tmp_path / "lines/both", both)
    mesh, _, _ = _given.read_surface(tmp_path / "two.stl", "mm", None)
    curves, facts = _given.read_curves(tmp_path / "lines/both", mesh, [SHORT[1]])
    assert [np.allclose(one.points[0], start, atol=0.1) for one, start in zip(curves, (LONG[0], SHORT[1]))] == [True, True]
    assert [one.parent for one in curves] == [None, None] and " are 2 trees of 2 branches; " in facts[0]


def test_inputs_without_a_vessel_are_refused(tmp_path):
    ball = label_file(tmp_path / "ball.nii.gz", np.linalg.norm(grid(30, 30, 30) - 15, axis=-1) < 11, 3)
    for words, said in [
        (["--label", "3"], r"ball\.nii\.gz: no centerline was found in the surface"),
        (["--label", "3", "--root=1,2,3"], r"ball\.nii\.gz: no centerline was found in the surface"),
        (["--label", "0"], r"--label 0: is the background; labels in \S+ball\.nii\.gz: 3"),
        (["--label", "5"], r"--label 5: no voxel of \S+ has this value; labels in \S+: 3"),
    ]:
        with pytest.raises(torquer.Error, match=said):
            imported(ball, *words)
    assert [path.name for path in tmp_path.iterdir()] == ["ball.nii.gz"]


def test_a_case_that_the_simulator_refuses_is_explained_by_the_input(tmp_path):
    (tmp_path / "q.toml").write_text('name = "q"\n')
    arguments = arguments_of(["vessel.stl", "--mesh-unit", "cm", "--out", "q"])
    with pytest.raises(torquer.Error, match=r"^vessel\.stl: .* Check --mesh-unit.*--root and --entry.* It says: q\.toml:1: vessel") as caught:
        _findings(tmp_path, "q", arguments)
    assert str(tmp_path) not in str(caught.value)
    with pytest.raises(torquer.Error, match="the widest end of the vessel has a radius of 0.30 mm, and the thinnest wire needs 0.36"):
        case.first_entry(case.entries_of([curve("c00", (0, 0, 0), (0, 0, 60), 0.3)]))


def test_planes_are_decimated_without_fans():
    mesh = surface.isosurface(np.ones((40, 40, 40), np.float32), 0.5, np.eye(4))
    fewer = surface.decimate(mesh, 3000)
    assert abs(fewer.volume_mm3() / mesh.volume_mm3() - 1) < 1e-3
    # Collapses spread over a plane, since a point that gathers them makes the time grow with the square.
    assert len(fewer.triangles) < 3100 and np.bincount(fewer.triangles.ravel()).max() < 25


def test_a_line_that_left_its_vessel_returns_to_the_middle():
    inside = depth(grid(46, 13, 13), LONG) / 2
    mesh = surface.isosurface(np.clip(0.5 + inside, 0, 1).astype(np.float32), 0.5, np.eye(4))
    line = np.array([[6, 6, z] for z in range(8, 39)], float)
    # A loop through the wall, as where two turns of a vessel touch.
    line[12:18, 0] += 4.0
    assert depth(line, LONG).min() < -0.9
    centered = centerlines._centered(line, centerlines._Wall(mesh))
    assert np.abs(depth(centered, LONG) - 3).max() < 0.5


def test_the_order_of_a_file_chooses_no_end():
    points = grid(54, 10, 38) - [19, 5, 0]
    inside = np.max([depth(points, tube) for tube in LEGS], axis=0)
    affine = np.eye(4)
    affine[:2, 3] = (-19, -5)
    mesh = surface.smooth(surface.isosurface(np.clip(0.5 + inside / 2, 0, 1).astype(np.float32), 0.5, affine))
    ordered = surface.in_order(mesh)
    for turn in (1, 2):
        random = np.random.default_rng(turn)
        order, to = random.permutation(len(mesh.triangles)), random.permutation(len(mesh.points))
        points = np.empty_like(mesh.points)
        points[to] = mesh.points
        same = surface.in_order(surface.Mesh(points, np.roll(to[mesh.triangles[order]], turn, axis=1)))
        assert (same.corners() == ordered.corners()).all()
    assert abs(same.volume_mm3() - mesh.volume_mm3()) < 1e-6
    notes = []
    curves = centerlines.find(same, None, notes)
    # All three are as wide; the legs are lowest. The right one has the root, so the wire enters the left one.
    assert np.linalg.norm(curves[0].points[0] - LEGS[2][1]) < 4
    entry = case.first_entry(case.entries_of(curves), notes)
    assert depth(entry.point_mm, LEGS[1]) > 2 and entry.point_mm[0] > 6
    assert len(notes) == 1 and notes[0].startswith("Root: 3 tips are about as wide (") and "--root" in notes[0]


def test_equally_low_ends_are_named():
    entries = [case.Entry(f"c0{n} end", np.array([x, 0, z]), np.eye(3)[2], 3.0) for n, (x, z) in enumerate([(0, 90), (8, 0), (-7, 1.5), (-20, 9)])]
    notes = []
    assert case.first_entry(entries, notes).name == "c02 end"
    assert notes == [
        "Entry: 2 ends are equally low, within 2 mm: c01 end, c02 end. The rightmost was taken, c02 end; --entry chooses another one."
    ]
