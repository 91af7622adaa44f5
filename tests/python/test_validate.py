"""Measured shapes beside wires: synthetic shapes with known answer and noise, and closed forms."""

import csv
import json
import math
import subprocess
import sys

import numpy as np
import pytest
import torquer
from batch_runs import ENVIRONMENT
from torquer._command import Progress
from torquer.validate import fit as fits
from torquer.validate import shapes
from torquer.validate.__main__ import validate
from torquer.validate.paths import Lumen

WIRE = """[entry]
centerline = "{curve}"
at_mm = 1
[[instrument]]
max_length_mm = 90
radius_mm = 0.2
rigidity_N_mm2 = 0.5
tip_mm = 8
tip_angle_deg = 40
[relaxation]
segment_mm = 2
"""
# A trunk with a branch on each side.
FORK = """name = "fork"
[vessel]
kind = "tubes"
wall_stiffness_N_mm2 = 5
[[vessel.tube]]
name = "trunk"
points_mm = [[0, 0, 0], [40, 0, 0], [70, 16, 0]]
bend_radius_mm = 30
radii_mm = 3
[[vessel.tube]]
name = "branch"
points_mm = [[34, 0, 0], [44, -4, 0], [66, -22, 6]]
bend_radius_mm = 20
radii_mm = 2.5
""" + WIRE.format(curve="trunk")
BEND_MM, RADIUS_MM = 30.0, 4.0
TORUS = f"""name = "torus"
[vessel]
kind = "torus"
bend_radius_mm = {BEND_MM}
radius_mm = {RADIUS_MM}
angle_deg = 150
wall_stiffness_N_mm2 = 50
""" + WIRE.format(curve="torus").replace("tip_angle_deg = 40", "tip_angle_deg = 0").replace("tip_mm = 8\n", "")
NOISE_MM = 0.2


def pushed(scene, rotation_rad, length_mm):
    simulation = torquer.Simulation(scene)
    hands = simulation.hands
    hands[0, 1] = rotation_rad
    simulation.step(0.1, hands)
    while hands[0, 0] < length_mm:
        hands[0, 0] = min(length_mm, hands[0, 0] + 1)
        simulation.step(simulation.time_s + 0.1, hands)
    return simulation.nodes_mm


def along(nodes, step_mm=2.0):
    arcs = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    at = np.append(np.arange(0, arcs[-1] - step_mm / 2, step_mm), arcs[-1])
    return np.stack([np.interp(at, arcs, nodes[:, axis]) for axis in range(3)], axis=1)


def write(path, named, header="shape,point,x_mm,y_mm,z_mm"):
    lines = [header]
    for name, points in named.items():
        lines += [f"{name},{k},{x:.6f},{y:.6f},{z:.6f}" for k, (x, y, z) in enumerate(points)]
    path.write_text("\n".join(lines) + "\n")
    return path


def rows_of(scene, points, name="shape"):
    shape = shapes.Shape(name, points)
    lumen = Lumen(scene, points, fits.wire_of(scene).tip_radius_mm)
    done = fits.fit(fits.with_name(scene), lumen, shape)
    return {row.method: row for row in done.rows}, done


def measured_of(scene, points):
    return fits.measure(shapes.Shape("shape", points), Lumen(scene, points, 0.2))


def bend_of(direction, rotation_deg):
    """Direction in which the tip is bent: the first normal is the axis with the least component, across the direction."""
    direction = np.array(direction, float)
    first = np.eye(3)[int(np.abs(direction).argmin())]
    first -= first @ direction * direction
    first /= np.linalg.norm(first)
    angle = math.radians(rotation_deg)
    return math.cos(angle) * first + math.sin(angle) * np.cross(direction, first)


@pytest.fixture(scope="module")
def fork():
    return torquer.Scene.from_text(FORK)


@pytest.fixture(scope="module")
def truth(fork):
    """A wire at a rotation between those of the grid, with noise at each point."""
    nodes = pushed(fork, math.radians(200), 60.0)
    points = along(nodes)
    return nodes, points + np.random.default_rng(3).normal(0, NOISE_MM, points.shape)


@pytest.fixture(scope="module")
def fitted(fork, truth):
    return rows_of(fork, truth[1])


def test_a_known_wire_is_found_within_its_noise(fork, truth, fitted):
    rows, done = fitted
    nodes, _ = truth
    row = rows["wire_pushed"]
    assert not row.refused and row.measured_mm == pytest.approx(60, abs=1.0)
    # Each entry measures the rotation from another normal, so the directions of the bent tip are compared.
    assert bend_of(measured_of(fork, truth[1]).direction, row.rotation_deg) @ bend_of((1, 0, 0), 200) > math.cos(math.radians(25))
    assert row.wire_mm == pytest.approx(60, abs=1.5)
    # The noise has three components; what the fit adds to it is below half of it.
    assert row.rms_mm < 1.25 * math.sqrt(3) * NOISE_MM and row.largest_mm < 5 * NOISE_MM
    # It begins at the first point, whose noise is below four standard deviations.
    assert fits.largest_apart_mm(done.curves["wire_pushed"], nodes) < 4 * NOISE_MM
    assert fits.largest_apart_mm(done.curves["wire_laid"], nodes) < 4 * NOISE_MM
    assert row.compared_mm > 45 and row.points >= 14
    # Ways without a model of a wire lie farther off.
    assert min(rows["middle"].rms_mm, rows["shortest"].rms_mm) > 1.5 * row.rms_mm


def test_a_given_tip_is_held_with_little_force(fitted):
    row = fitted[0]["wire_held"]
    assert not row.refused and row.tip_mm < 1 and row.hold_mN < 200 and row.rms_mm < 1


def test_other_equilibria_are_counted(fitted):
    row = fitted[0]["wire_pushed"]
    # The bent tip leads into either branch, by the rotation.
    assert row.other_branch_runs > 0 and row.equilibria >= 2
    assert row.other_branch_runs <= row.apart_runs < row.runs


def test_the_reported_points_choose_nothing(fork, truth, fitted):
    moved = truth[1].copy()
    odd = shapes.Shape("", moved).reported()
    moved[odd] += np.random.default_rng(5).normal(0, 0.3, (len(odd), 3))
    rows = rows_of(fork, moved)[0]
    for method in ("wire_pushed", "wire_laid", "wire_held"):
        ours, theirs = rows[method], fitted[0][method]
        assert (ours.rotation_deg, ours.wire_mm, ours.measured_mm, ours.choosing_rms_mm) == (
            theirs.rotation_deg, theirs.wire_mm, theirs.measured_mm, theirs.choosing_rms_mm,
        )
        assert ours.rms_mm > theirs.rms_mm


def circle(radius, angles, start=0.0):
    """Arc about the center of the torus, (0, bend, 0)."""
    return np.stack([radius * np.sin(angles), BEND_MM - radius * np.cos(angles), np.full_like(angles, start)], axis=1)


def test_ways_of_a_torus_have_their_closed_forms():
    scene = torquer.Scene.from_text(TORUS)
    span = math.radians(110)
    ends = circle(BEND_MM, np.radians([20.0, 130.0]))
    lumen = Lumen(scene, circle(BEND_MM, np.radians(np.linspace(15, 135, 30))), 0.2)
    middle = lumen.way(ends[0], ends[1], True)
    assert np.abs(np.linalg.norm(middle - [0, BEND_MM, 0], axis=1) - BEND_MM).max() < 0.15
    assert fits.arcs_of(middle)[-1] == pytest.approx(BEND_MM * span, rel=0.01)
    # A string about the inner wall: two tangents and an arc.
    inner = BEND_MM - RADIUS_MM + 0.2
    string = 2 * math.sqrt(BEND_MM**2 - inner**2) + inner * (span - 2 * math.acos(inner / BEND_MM))
    assert fits.arcs_of(lumen.way(ends[0], ends[1], False))[-1] == pytest.approx(string, rel=0.01)
    # Steps of the grid at 45 and 54 degrees make ways at most 9 % too long.
    assert string * 0.99 < lumen.length_mm(ends[0], ends[1]) < 1.1 * string


def test_a_straight_wire_lies_on_the_outer_wall_of_a_torus():
    """Closed form: a long wire without rest curvature bends least on the outer wall, at R + r less its radius.

    It touches that wall some way from its ends, where it leaves it.
    """
    radius, gap = 1.5, 0.5
    text = TORUS.replace("radius_mm = 4.0", f"radius_mm = {radius}").replace("angle_deg = 150", "angle_deg = 320")
    outer = BEND_MM + radius - 0.2
    points = circle(outer - gap, np.radians(np.linspace(10, 210, 31)))
    rows, done = rows_of(torquer.Scene.from_text(text.replace("max_length_mm = 90", "max_length_mm = 150")), points)
    for method in ("wire_pushed", "wire_laid"):
        wire = done.curves[method]
        distances = np.linalg.norm(wire - [0, BEND_MM, 0], axis=1)
        assert distances.max() == pytest.approx(outer, abs=0.01)
        assert np.abs(distances[round(0.37 * len(wire)) : round(0.45 * len(wire))] - outer).max() < 0.1
        assert gap < rows[method].rms_mm < 2 * (radius - 0.2)  # the room of the wire
    # The middle line is nearer to the center by the rest of the radius. Only its ends are those of the shape.
    assert 0.8 * (radius - 0.2 - gap) < rows["middle"].rms_mm < 1.06 * (radius - 0.2 - gap)
    assert rows["wire_pushed"].outside_percent == 0 and rows["wire_pushed"].left_out_mm == 0


def test_the_length_of_a_noisy_curve_is_not_that_of_its_zigzag():
    turns = np.linspace(0, 2 * math.pi, 61)
    helix = np.stack([20 * np.cos(turns), 20 * np.sin(turns), 8 * turns], axis=1)
    length = 2 * math.pi * math.hypot(20, 8)
    noisy = helix + np.random.default_rng(1).normal(0, 0.5, helix.shape)
    assert fits.arcs_of(noisy)[-1] > 1.05 * length
    curve = shapes.Curve(shapes.Shape("helix", noisy))
    assert curve.arcs[-1] == pytest.approx(length, rel=0.012)
    noises = []
    for seed in range(30):
        points = helix + np.random.default_rng(seed).normal(0, 0.5, helix.shape)
        noises.append(shapes.Curve(shapes.Shape("helix", points)).noise_mm)
    # The smooth curve follows some of the noise: 8 % with 31 points.
    assert np.median(noises) == pytest.approx(0.5, rel=0.12)
    exact = shapes.Curve(shapes.Shape("helix", helix))
    assert exact.arcs[-1] == pytest.approx(length, rel=1e-3) and exact.noise_mm < 0.02


def test_a_wire_shorter_than_its_shape_is_refused():
    tube = 'name = "tube"\n[vessel]\nkind = "straight_tube"\nlength_mm = 40\nradius_mm = 3\nwall_stiffness_N_mm2 = 5\n'
    scene = torquer.Scene.from_text(tube + WIRE.format(curve="tube") + "[effects.outlets]\n")
    straight = np.linspace([2, 0, 0], [46, 0, 0], 23)
    rows, _ = rows_of(scene, straight)
    assert "mm shorter than the shape" in rows["wire_pushed"].refused
    assert rows["wire_pushed"].rms_mm is None and rows["wire_pushed"].refused_runs > 0
    short = fits.with_name(scene).with_values({"instrument.guidewire.max_length_mm": 20, "effects.outlets": False})
    rows, _ = rows_of(short, straight[:18])
    assert "max_length_mm is 20" in rows["wire_held"].refused and "raise it" in rows["wire_held"].refused
    # A shape beside the vessel gives no figures, and its reason.
    rows, _ = rows_of(scene, np.vstack([straight[:18] + [0, 8, 0], [[6, 0, 0]]]))
    assert all(row.refused and row.rms_mm is None for row in rows.values())


STRAIGHT = np.linspace([2, 0, 0], [36, 0, 0], 18)


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda text: text.replace("z_mm", "z"), [":1: the columns are", "x_mm, y_mm, z_mm is missing"]),
        (lambda text: text.replace("point,", "shape,", 1), [":1: column 'shape' is there 2 times"]),
        (lambda text: text.replace("a,3,", "a,2,"), [":5: point is 2, after 2", "order the points"]),
        (lambda text: text.replace("a,3,", "a,three,"), [":5: point is 'three'"]),
        (lambda text: text.replace("a,3,8.0", "a,3,nan#"), [":5: x_mm is 'nan#00000'", "finite number"]),
        (lambda text: text.replace("a,3,8.000000", "a,3,inf"), [":5: x_mm is 'inf'"]),
        (lambda text: text.replace("a,3,8.000000", "a,3,8,0"), [":5: has 6 columns"]),
        (lambda text: text.replace("a,3,8.000000", "a,3,6.000000"), [":5: shape a repeats the point of line 4"]),
        (lambda text: text.replace("a,3,8.000000", "a,3,2e9"), [":5: a coordinate is 2e+09 mm", "check the unit"]),
        (lambda text: text.replace("a,3,", "b,3,"), [":6: shape a goes on after another shape"]),
        (lambda text: "\n".join(text.split("\n")[:6]), [":2: shape a has 5 points", "12 to 2000"]),
        (lambda text: text.split("\n")[0], ["holds no shape"]),
        (lambda text: "", [":1: the columns are"]),
        (lambda text: text.replace("a,3,", " ,3,"), [":5: shape is ''"]),
    ],
)
def test_a_bad_table_is_refused_with_its_place(tmp_path, change, said):
    path = write(tmp_path / "shapes.csv", {"a": STRAIGHT})
    path.write_text(change(path.read_text()))
    with pytest.raises(torquer.Error) as refused:
        shapes.read(path)
    assert str(path) in str(refused.value)
    for part in said:
        assert part in str(refused.value)


def test_tables_of_other_programs_are_read(tmp_path):
    path = write(tmp_path / "shapes.csv", {"a": STRAIGHT / 10}, "shape,point,x_cm,y_cm,z_cm")
    text = path.read_text().replace("shape,", "\ufeffshape,", 1).replace("\n", "\r\n")
    path.write_bytes("\r\n".join(f'{line.replace(",", ";")};"note; more"' for line in text.strip().split("\r\n")).encode())
    (shape,), unused = shapes.read(path)
    assert np.allclose(shape.points, STRAIGHT, atol=1e-5) and unused == ["note; more"]


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "sep=;\n" + text.replace(",", ";"),
        lambda text: "sep=,\r\n" + text.replace("\n", "\r\n"),
        lambda text: text.replace(",", "\t"),
        lambda text: "\n# by a camera, at 20 C\n\n" + text,
        lambda text: "sep=|\n" + text.replace(",", "|"),
    ],
)
def test_tables_with_any_separator_are_read_below_what_programs_add(tmp_path, change):
    path = write(tmp_path / "shapes.csv", {"a": STRAIGHT})
    plain = path.read_text()
    path.write_bytes(change(plain).encode())
    (shape,), unused = shapes.read(path)
    assert np.allclose(shape.points, STRAIGHT, atol=1e-5) and unused == []
    # A fault has its line in the file, below the lines above the names.
    text = change(plain.replace("a,3,", "a,three,"))
    path.write_bytes(text.encode())
    line = 1 + [line.find("three") >= 0 for line in text.split("\n")].index(True)
    with pytest.raises(torquer.Error, match=f"shapes.csv:{line}: point is 'three'"):
        shapes.read(path)


@pytest.mark.parametrize("coding", ["utf-16-le", "utf-16-be"])
def test_a_table_in_utf_16_without_its_mark_is_named(tmp_path, coding):
    path = write(tmp_path / "shapes.csv", {"a": STRAIGHT})
    path.write_bytes(path.read_text().encode(coding))
    with pytest.raises(torquer.Error, match="the text is UTF-16; save it as UTF-8"):
        shapes.read(path)


def test_scenes_that_cannot_be_compared_are_refused(fork):
    with pytest.raises(torquer.Error, match="effects.point_load acts on the tip.*remove it"):
        fits.wire_of(fork.with_values({"effects.point_load.force_mN": 1, "effects.point_load.force_direction": [1, 0, 0]}))
    catheter = '[[instrument]]\nname = "catheter"\nmax_length_mm = 50\ninner_radius_mm = 0.3\nradius_mm = 0.5\nrigidity_N_mm2 = 1\n'
    with pytest.raises(torquer.Error, match="has the instruments guidewire, catheter; keep the one that was measured"):
        fits.wire_of(torquer.Scene.from_text(FORK.replace("[relaxation]", catheter + "[relaxation]")))


def command(tmp_path, *words):
    return subprocess.run(
        [sys.executable, "-B", "-m", "torquer.validate", *map(str, words)], env=ENVIRONMENT, cwd=tmp_path, capture_output=True, text=True,
    )


def test_the_command_writes_tables_and_pictures(tmp_path, truth, monkeypatch):
    scene = tmp_path / "fork.toml"
    scene.write_text(FORK)
    beside = truth[1][:20] + [0, 40, 0]
    path = write(tmp_path / "shapes.csv", {"one/1": truth[1], "beside": beside})
    done = command(tmp_path, "--scene", scene, "--shapes", path, "--out", "result")
    assert done.returncode == 0, done.stderr
    assert "wire_pushed: median RMS 0." in done.stdout and "1 shapes, 1 refused" in done.stdout
    out = tmp_path / "result"
    assert sorted(file.name for file in out.iterdir()) == [
        "shape_000_one_1.png", "shape_001_beside.png", "table.csv", "table.json", "table.md",
    ]
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in out.glob("*.png"))
    everything = json.loads((out / "table.json").read_text())
    with (out / "table.csv").open() as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(everything["rows"]) == 2 * len(fits.METHODS)
    assert float(table[0]["rms_mm"]) == everything["rows"][0]["rms_mm"]
    assert table[5]["rms_mm"] == "" and everything["rows"][5]["rms_mm"] is None and everything["rows"][5]["refused"]
    assert len(everything["sources"]["shapes_sha256"]) == 64 and everything["medians"][0]["shapes"] == 1
    text = (out / "table.md").read_text()
    assert "## Refused" in text and "## Sources" in text and "| one/1 | wire_held |" in text
    # Nothing is overwritten.
    again = command(tmp_path, "--scene", scene, "--shapes", path, "--out", "result")
    assert again.returncode == 2 and "result: exists already; remove it" in again.stderr and "Traceback" not in again.stderr
    far = write(tmp_path / "far.csv", {"far": truth[1] + 900})
    for words, said in (
        (("none.toml", path, "two"), "none.toml"),
        ((scene, "none.csv", "two"), "none.csv: cannot be read"),
        ((scene, path, "no/two"), "no/two: there is no folder"),
        ((scene, far, "two"), "far.csv: no place of the lumen"),
    ):
        monkeypatch.chdir(tmp_path)
        with pytest.raises(torquer.Error) as refused:
            validate(*map(str, words), Progress())
        assert said in str(refused.value)
        assert not (tmp_path / "two").exists() and not list(tmp_path.glob(".two*"))
