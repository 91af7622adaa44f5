"""Conversion of Guide3D: cameras, wires and a surface of known truth, with an offset and noise of known size."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
import torquer
from batch_runs import ENVIRONMENT
from scipy.spatial.transform import Rotation
from torquer.guide3d import _cameras, _convert, _curves, _registration
from torquer.guide3d._annotations import Frame

OFFSET_PX, CLICK_PX = 9.0, 1.2
TURN, SHIFT = np.radians([3.0, -2.0, 4.0]), np.array([2.0, -1.5, 3.0])
RADIUS_MM, WALL_MM = 5.0, 1.0


def camera(angle_deg, distance_mm):
    """Camera about the x axis, to which the rows of its picture are opposite."""
    forward = np.array([0, -math.sin(math.radians(angle_deg)), -math.cos(math.radians(angle_deg))])
    rotation = np.array([np.cross([-1, 0, 0], forward), [-1, 0, 0], forward])
    matrix = np.array([[4800.0, 0, 520], [0, 4750, 500], [0, 0, 1]])
    return _cameras.Camera(matrix, rotation, -rotation @ (-distance_mm * forward + [0, 0, 0]))


PAIR = _cameras.Pair(camera(-35, 1100), camera(35, 950))


def axis(share):
    """Axis of the vessel: a bend in space of about 190 mm."""
    turn = 2.6 * np.asarray(share)
    return np.stack([60 * np.sin(turn) - 15, 80 * (1 - 2 * np.asarray(share)) + 10 * np.cos(3 * turn), 30 * np.cos(turn)], axis=-1)


def beside(share, angle, distance):
    """Points beside the axis, at an angle about it."""
    way = axis(share + 1e-4) - axis(share - 1e-4)
    way /= np.linalg.norm(way, axis=-1)[..., None]
    first = np.cross(way, [0, 0, 1.0])
    first /= np.linalg.norm(first, axis=-1)[..., None]
    return axis(share) + distance * (np.cos(angle) * first.T + np.sin(angle) * np.cross(way, first).T).T


def surface(path, unit_mm):
    rings, around = 60, 24
    share, angle = np.meshgrid(np.linspace(0, 1, rings), np.arange(around) * 2 * np.pi / around, indexing="ij")
    points = beside(share.ravel(), angle.ravel(), RADIUS_MM)
    ends = len(points) + np.arange(2)
    points = np.vstack([points, axis(np.array([0.0, 1.0]))])
    faces = []
    for k in range(around):
        after = (k + 1) % around
        for ring in range(rings - 1):
            a, b, c, d = (ring * around + k, ring * around + after, (ring + 1) * around + after, (ring + 1) * around + k)
            faces += [(a, b, c), (a, c, d)]
        last = (rings - 1) * around
        faces += [(ends[0], after, k), (ends[1], last + k, last + after)]
    moved = (Rotation.from_rotvec(TURN).apply(points) + SHIFT) / unit_mm
    lines = ["solid tube"]
    for face in faces:
        lines.append("facet normal 0 0 0\nouter loop")
        lines += ["vertex {:.7g} {:.7g} {:.7g}".format(*moved[k]) for k in face]
        lines.append("endloop\nendfacet")
    path.write_text("\n".join(lines) + "\nendsolid\n")


def wire(number):
    """A wire along the wall, from the start of the vessel to its tip."""
    share = np.linspace(0.03, 0.75 + 0.03 * (number % 5), 400)
    return beside(share, 2.1 * number + 2.0 * share, RADIUS_MM - WALL_MM)


def clicks(number, seen_by, random, noise_px):
    """Clicks of a picture, tip first; one picture ends earlier."""
    pixels = seen_by.pixels(wire(number)[25 if seen_by is PAIR.cameras[1] else 0 :])[::-1]
    arcs = _curves.arcs_of(pixels)
    at = np.cumsum(random.uniform(10, 22, 200))
    points = _curves.at_arcs(pixels, np.append(0, at[at < arcs[-1]]))
    return points + random.normal(0, noise_px, points.shape)


def frame(number, noise_px):
    random = np.random.default_rng(number)
    return Frame(f"frame {number}", *(clicks(number, seen_by, random, noise_px) for seen_by in PAIR.cameras))


def camera_text(seen_by, offset_px):
    moved = seen_by.moved(-offset_px)
    rows = [",".join(map(repr, map(float, row))) for row in [*moved.matrix, *moved.rotation]]
    shift = [repr(float(value) / 10) for value in moved.shift]
    return "\n".join(["image size", "1024,1024", "", "camera matrix", *rows[:3], "", "rotation", *rows[3:], "", "translation", *shift, ""])


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """A folder as the published one, whose cameras are off."""
    folder = tmp_path_factory.mktemp("guide3d")
    (folder / "16710.txt").write_text(camera_text(PAIR.cameras[0], OFFSET_PX / 2))
    (folder / "16709.txt").write_text(camera_text(PAIR.cameras[1], -OFFSET_PX / 2))
    surface(folder / "mesh.stl", 10)
    videos = []
    for video in range(4):
        frames = []
        for k in range(4):
            one = frame(4 * video + k, CLICK_PX)
            frames.append({
                "frame_number": 10 * k,
                "camera1": {"image": "", "points": one.first.tolist()}, "camera2": {"image": "", "points": one.second.tolist()},
            })
        videos.append({"task": f"video-{video}", "frames": frames})
    # A pair whose tips are far apart.
    videos[1]["frames"][0]["camera1"]["points"][0][1] += 80
    (folder / "3d.json").write_text(json.dumps(videos))
    return folder


def read(path):
    found = {}
    for line in path.read_text().splitlines()[1:]:
        name, _, *point = line.split(",")
        found.setdefault(name, []).append([float(value) for value in point])
    return {name: np.array(points) for name, points in found.items()}


def off_mm(points, number):
    """Distances of points in the frame of the surface from a wire of known truth."""
    true = Rotation.from_rotvec(TURN).apply(wire(number)) + SHIFT
    return np.sqrt(((points[:, None, :] - true[None]) ** 2).sum(axis=2).min(axis=1))


def test_shapes_of_known_wires_are_found(published, tmp_path, monkeypatch):
    monkeypatch.setattr(_registration, "STARTS", 4)
    monkeypatch.setattr(_convert, "_NOISE_DRAWS", 2)
    said = torquer.guide3d.convert(published, tmp_path / "out")
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert "15 shapes, 1 pairs left out" in said and [one["pair"] for one in report["left_out"]] == ["video-1/0"]
    # The offset and the noise of the clicks, from the calibration videos.
    checks = report["epipolar_checks"]
    assert report["correction_px"] == pytest.approx(OFFSET_PX, abs=3 * 1.25 * math.sqrt(2) * CLICK_PX / math.sqrt(checks[0]["pairs"]))
    assert report["click_px"] == pytest.approx(CLICK_PX, rel=0.5)
    assert [check["use"] for check in checks[1:5]] == ["calibration", "test"] * 2
    assert all(check["same_side_percent"] == 100 for check in checks[1:5]) and abs(checks[-1]["median_px"]) < 0.05
    assert report["correction_mm"] == pytest.approx(OFFSET_PX * 1025 / 4775, rel=0.15)
    assert report["reprojection_rms_px"] < 1.2 * CLICK_PX
    assert all(0.05 < one["tip"] < 0.8 and 0.1 < one["along_wire"] < 1.5 for one in report["noise_mm"])
    wires = read(tmp_path / "out/calibration.csv") | read(tmp_path / "out/test.csv")
    assert list(read(tmp_path / "out/test.csv"))[0].startswith("video-1/")
    errors = []
    for name, points in wires.items():
        video, number = name.removeprefix("video-").split("/")
        number = 4 * int(video) + int(number) // 10
        off = off_mm(points, number)
        errors.append(float(np.sqrt((off**2).mean())))
        true = Rotation.from_rotvec(TURN).apply(wire(number)) + SHIFT
        # Errors at the tip and at the entry. One picture shows a wire only from 13 mm on, by clicks up to 5 mm apart.
        assert np.linalg.norm(points[-1] - true[-1]) < 2.5 and np.linalg.norm(points[0] - true[0]) < 22
        assert np.allclose(np.linalg.norm(np.diff(points, axis=0), axis=1), _curves.STEP_MM, atol=0.1)
    # Noise of the clicks, and the room that the wires leave to the registration.
    assert np.median(errors) < 1.0 and max(errors) < 2.0
    assert report["registration"][0]["violation_mm"] < 0.3
    text = (tmp_path / "out/report.md").read_text()
    assert "## Epipolar check" in text and "## Left out" in text and "SHA-256" in text
    # The shapes can be read by torquer-validate.
    from torquer.validate import shapes
    assert len(shapes.read(tmp_path / "out/test.csv")[0]) == 7


def test_without_noise_a_curve_is_exact():
    one = frame(2, 0)
    found = _curves.reconstruct(PAIR, one.first, one.second)
    true = wire(2)
    off = np.sqrt(((found.points[:, None, :] - true[None]) ** 2).sum(axis=2).min(axis=1))
    assert np.sqrt((off**2).mean()) < 0.3 and off.max() < 1.0 and found.reprojection_px < 0.4
    assert np.linalg.norm(found.points[-1] - true[-1]) < 0.3


def test_offset_and_noise_of_clicks_are_found():
    frames = [frame(number, CLICK_PX) for number in range(200)]
    wrong = _cameras.Pair(PAIR.cameras[0].moved(-OFFSET_PX / 2), PAIR.cameras[1].moved(OFFSET_PX / 2))
    check = _convert._check("all", "calibration", wrong, frames)
    assert 0.1 < check.median_error_px < 0.2 and check.same_side_percent == 100
    assert check.median_px == pytest.approx(OFFSET_PX, abs=3 * check.median_error_px)
    # The offset is a difference of two clicks.
    assert check.scatter_px / math.sqrt(2) == pytest.approx(CLICK_PX, rel=0.2)
    after = _convert._check("all", "calibration", wrong.corrected(check.median_px), frames)
    assert abs(after.median_px) < 0.02 and 30 < after.same_side_percent < 70


def test_planes_through_both_centers_are_those_of_projection():
    points = np.random.default_rng(1).normal(0, 40, (50, 3))
    first, second = (seen_by.pixels(points) for seen_by in PAIR.cameras)
    assert np.allclose(PAIR.points(first, second), points, atol=1e-6)
    assert np.abs(PAIR.offsets_px(first, second)).max() < 1e-6
    wrong = _cameras.Pair(PAIR.cameras[0].moved(-4), PAIR.cameras[1].moved(3))
    assert np.allclose(wrong.offsets_px(first, second), 7, atol=0.5)
    assert np.abs(wrong.corrected(7).offsets_px(first, second)).max() < 0.5
    step = 1e-4
    slopes = PAIR.cameras[0].slopes(points)
    for k in range(3):
        moved = PAIR.cameras[0].pixels(points + step * np.eye(3)[k]) - PAIR.cameras[0].pixels(points - step * np.eye(3)[k])
        assert np.allclose(slopes[:, :, k], moved / (2 * step), atol=1e-4)


def test_places_that_fit_alike_are_all_reported(monkeypatch):
    monkeypatch.setattr(_registration, "STARTS", 8)
    scene = torquer.Scene.from_text(
        'name = "tube"\n[vessel]\nkind = "straight_tube"\nlength_mm = 100\nradius_mm = 4\nwall_stiffness_N_mm2 = 1\n'
        "[entry]\npoint_mm = [5, 0, 0]\ndirection = [1, 0, 0]\n[[instrument]]\nmax_length_mm = 10\nradius_mm = 0.2\nrigidity_N_mm2 = 1\n"
    )
    x = np.linspace(10, 90, 41)
    # Wires on all sides of the tube fix everything but the turn about its axis and the way along it.
    wires = [np.stack([x, 3.55 * np.cos(angle + 0 * x), 3.55 * np.sin(angle + 0 * x)], axis=1) for angle in (0, 2, 4)]
    moved = [Rotation.from_rotvec([0, 0.05, 0.1]).apply(wire - [50, 0, 0]) + [51, 1, 2] for wire in wires]
    minima = _registration.register(scene, moved, 0.4445)
    assert len(minima) >= 2 and all(one.violation_mm < 0.05 for one in minima)
    turns = np.radians([one.turn_deg for one in minima])
    assert max(_registration.angle_deg(turn, turns[0]) for turn in turns) > 3
    for one in minima:
        placed = np.vstack([one.moved(wire) for wire in moved])
        assert np.hypot(placed[:, 1], placed[:, 2]).max() < 4 and one.outside_percent == 0


def test_a_bad_folder_is_refused_with_file_and_field(published, tmp_path):
    def refusal(name, change):
        folder = tmp_path / f"case{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        for file in published.iterdir():
            (folder / file.name).write_bytes(file.read_bytes())
        if change is None:
            (folder / name).unlink()
        else:
            (folder / name).write_text(change((folder / name).read_text()))
        with pytest.raises(torquer.Error) as refused:
            torquer.guide3d.convert(folder, tmp_path / "out")
        assert not (tmp_path / "out").exists()
        return str(refused.value)

    assert "has no mesh.stl (surface)" in refusal("mesh.stl", None) and "tudorjnu" in refusal("3d.json", None)
    assert "16709.txt:5: camera matrix is 'x'" in refusal("16709.txt", lambda text: "\n".join(["image size", "1,1", "", "camera matrix", "x"]))
    assert "section 'translation' is missing" in refusal("16710.txt", lambda text: text.split("translation")[0])
    assert "rotation is no rotation" in refusal("16710.txt", lambda text: text.replace("-1.0", "1.5"))
    assert "not valid JSON" in refusal("3d.json", lambda text: text[:-5])
    assert "[0].frames[0].camera2 is missing" in refusal("3d.json", lambda text: text.replace('"camera2"', '"camera3"', 1))
    assert "[0].task is missing" in refusal("3d.json", lambda text: text.replace('"task"', '"name"', 1))
    broken = refusal("3d.json", lambda text: text.replace('"points": [[', '"points": [["x", ', 1))
    assert "[0].frames[0].camera1.points[0] is ['x', " in broken and "pixels" in broken
    same = (published / "16709.txt").read_text()
    assert "both cameras see the same" in refusal("16710.txt", lambda text: same)


def test_the_command_refuses_what_it_does_not_know(tmp_path):
    def run(*words):
        done = subprocess.run([sys.executable, "-B", "-m", "torquer", "convert", *words], env=ENVIRONMENT, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 2 and "Traceback" not in done.stderr
        return done.stderr

    assert "nowhere: has no 3d.json" in run("guide3d", "nowhere")
    assert "leave it out after guide3d" in run("guide3d", "nowhere", "--unit", "cm")
    assert "only guide3d takes a third name" in run("a.jsonl", "b.csv", "c")
    (tmp_path / "guide3d-shapes").mkdir()
    assert "guide3d-shapes: exists already" in run("guide3d", ".")
