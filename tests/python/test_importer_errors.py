"""Scans of known truth, and the measures by which imported cases are compared with it."""

import sys

import numpy as np
import pytest
import torquer
from torquer.importer import _truth, case, errors
from torquer.importer.centerlines import Curve

RADIUS_MM = 3.0
# A tube along x in the scene, which is the head's direction of the patient.
TUBE = """name = "tube"
[vessel]
kind = "straight_tube"
length_mm = 30
radius_mm = 3
wall_stiffness_N_mm2 = 10
[patient_axes]
left = "+y"
posterior = "+z"
superior = "+x"
[entry]
centerline = "tube"
at_mm = 2
[[instrument]]
max_length_mm = 30
radius_mm = 0.2
rigidity_N_mm2 = 1
"""


@pytest.fixture(scope="module")
def truth():
    return _truth.Truth(torquer.Scene.from_text(TUBE))


def test_the_truth_lies_in_the_frame_of_the_patient(truth):
    assert np.allclose(truth.to_lps([[10, 1, 2]]), [[1, 2, 10]]) and np.allclose(truth.from_lps([[1, 2, 10]]), [[10, 1, 2]])
    wall = truth.wall_points(2000)
    middle = wall[(wall[:, 2] > 3) & (wall[:, 2] < 27)]
    assert len(middle) > 1000 and np.abs(np.hypot(middle[:, 0], middle[:, 1]) - RADIUS_MM).max() < 0.05


def test_a_scan_shows_lumen_tissue_and_bone(truth):
    scan = _truth.scan_of(truth, 0.8)

    def mean(points):
        k = np.round(scan.indices(np.array(points, float))).astype(int)
        return scan.values[k[:, 2], k[:, 1], k[:, 0]].mean()

    axis = np.array([[0, 0, z] for z in range(4, 27)])
    assert abs(mean(axis) - _truth.LUMEN) < 20
    # On the wall, half of a voxel is lumen; its curvature and the blur lower the value.
    assert abs(mean(axis + [RADIUS_MM, 0, 0]) - (_truth.LUMEN + _truth.TISSUE) / 2) < 40
    assert abs(mean(axis + [5, -5, 0]) - _truth.TISSUE) < 20
    assert scan.values.max() > 800, "bone"
    assert np.allclose(_truth.seed_of(truth)[:2], 0, atol=0.5)


def line(name, start, end, radius, parent=None):
    points = np.linspace(start, end, 30)
    return Curve(name, points, np.full(30, radius), parent)


def test_branches_and_ways_are_measured():
    trunk, left, right = line("c00", (0, 0, 0), (0, 0, 40), 3.0), line("c01", (0, 0, 20), (20, 0, 20), 2.0, 0), line(
        "c02", (0, 0, 30), (-8, 0, 30), 2.0, 0
    )
    assert errors.branches_found([trunk, left, right], [trunk, left]) == (2, 0)
    assert errors.branches_found([trunk, left], [trunk, left, right]) == (2, 1)
    assert errors.branch_of([trunk, left, right], (15, 0.5, 20)) == 1
    # The way from the trunk's end to the tip of the left branch is 20 and 20 mm. The way to the start is 40 mm.
    entry = case.Entry("c00 end", trunk.points[-1], np.array([0, 0, -1.0]), 3.0)
    assert abs(errors.way_of([trunk, left, right], entry) - 0.8 * 40) < 2
    entry = case.Entry("c01 end", left.points[-1], np.array([-1.0, 0, 0]), 2.0)
    assert abs(errors.way_of([trunk, left, right], entry) - 0.8 * 40) < 2


def test_tips_on_both_sides_of_a_branching_are_not_alike():
    curves = [line("c00", (0, 0, 0), (0, 0, 40), 3.0), line("c01", (0, 0, 20), (20, 0, 20), 2.0, 0)]

    def alike(one, other):
        runs = [errors.Run(np.zeros((0, 3)), np.array(tip, float)) for tip in (one, other)]
        return errors.went_alike(curves, *runs)

    # Below the branch, above it, and in it.
    assert alike((0, 0, 5), (0, 1, 15)) and alike((0, 0, 25), (0, 1, 38)) and alike((8, 0, 20), (19, 0, 20))
    assert not alike((0, 0, 5), (0, 0, 35)) and not alike((0, 0, 5), (15, 0, 20))
    # Beside each other at the branching.
    assert alike((0, 0, 19), (0, 0, 21))


def test_the_wire_bends_to_the_front_in_every_frame(truth):
    entry = case.Entry("c00 start", np.array([0, 0, 3.0]), np.array([0, 0, 1.0]), RADIUS_MM)
    vessel = errors.Vessel(errors.tables_of(truth.scene.text), truth.scene.folder, [], truth)
    start = errors.simulation(vessel, entry, 20)
    start.step(0.1, [[12, 0]])
    nodes = vessel.to_lps(start.nodes_mm)
    way = nodes[-1] - nodes[0]
    assert way[1] < -0.5 and abs(way[0]) < 0.1 and way[2] > 10, "the front is -y in LPS"


def test_options_are_checked(monkeypatch, capsys):
    for words, said in [
        (["--voxels", "5"], "--voxels 5: give sizes from 0.2 to 2 mm"), (["--voxels", "x"], "--voxels x: give sizes from 0.2 to 2 mm"),
        (["--voxels", "1", "--entry=1,2"], "--entry=1,2: give left, posterior and superior in mm"),
    ]:
        monkeypatch.setattr(sys, "argv", ["errors", *words])
        assert errors.main() == 2 and said in capsys.readouterr().err
