"""Fits of a scene's values: similarity of scaled scenes, known values back from noise, intervals, and refusals."""

import csv
import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
import torquer
from batch_runs import ENVIRONMENT
from torquer.identify import Experiment, identify, measured, report

SCENE = """name = "bend"
[vessel]
kind = "torus"
bend_radius_mm = 30
radius_mm = 4
angle_deg = 150
wall_stiffness_N_mm2 = 0.5
[entry]
centerline = "torus"
at_mm = 1
[[instrument]]
name = "wire"
max_length_mm = 90
radius_mm = 0.2
rigidity_N_mm2 = 0.5
tip_mm = 8
tip_angle_deg = 30
[relaxation]
segment_mm = 2
[effects.friction]
coefficient = 0.1
[effects.internal_forces]
"""
RIGIDITY, FRICTION = "instrument.wire.rigidity_N_mm2", "effects.friction.coefficient"
WALL, TIP = "vessel.wall_stiffness_N_mm2", "instrument.wire.tip_angle_deg"
FORCE = "wire.hand_force_mN"
# To and fro, so that friction changes its direction. Both ways fall between two rows.
WAY_MM = (10, 20, 28, 34, 40, 38.3, 36, 33, 35.1, 38)
TRUTH = {RIGIDITY: 0.62, FRICTION: 0.14}


def drawn(scene, values, noise_mN, rng, columns=(FORCE,), way_mm=WAY_MM):
    """A table that another simulation measures in other ticks, with noise."""
    simulation = torquer.Simulation(scene.with_values({**values, "relaxation.tolerance": 1e-8}))
    lines = [",".join(["time_s", "wire.insertion_mm", *columns])]
    for second, end_mm in enumerate(way_mm, 1):
        hands = simulation.hands
        for way in np.linspace(hands[0, 0], end_mm, 1 + int(np.ceil(abs(end_mm - hands[0, 0]) / 0.25)))[1:]:
            hands[0, 0] = way
            report = simulation.step(simulation.time_s + 0.01, hands)
            assert report.converged and not report.snapped
        found = {**simulation.readings(), **dict(zip(("tip_x_mm", "tip_y_mm", "tip_z_mm"), simulation.tips_mm[0]))}
        cells = [found[name] + noise_mN * rng.normal() for name in columns]
        lines.append(",".join([str(10 * second), str(end_mm), *(repr(float(cell)) for cell in cells)]))
    return "\n".join(lines) + "\n"


@pytest.fixture
def scene():
    return torquer.Scene.from_text(SCENE)


def table_of(scene, text, folder):
    path = folder / "measured.csv"
    path.write_text(text)
    return measured.read(scene, path)


def test_derivatives_obey_the_similarity_of_scaled_scenes(scene, tmp_path):
    # Rigidity and wall stiffness that grow by one factor leave every shape, and multiply every force. Friction has no
    # unit. By Euler's theorem, the derivatives times their values add up to 0 for tips, and to the force for forces.
    rng = np.random.default_rng(1)
    text = drawn(scene, {}, 0, rng, ("tip_x_mm", "tip_y_mm", FORCE))
    values = {RIGIDITY: 0.5, WALL: 0.5}
    rows = Experiment(scene, table_of(scene, text, tmp_path), list(values)).sensitivities([1, 1])
    sums, parts = {}, {}
    for one in rows:
        place = one["line"], one["reading"]
        sums[place] = sums.get(place, 0) + values[one["key"]] * one["derivative"]
        parts[place] = max(parts.get(place, 0), abs(values[one["key"]] * one["derivative"]))
    force = {int(k): float(row[FORCE]) for k, row in enumerate(csv.DictReader(text.splitlines()), 2)}
    assert len(sums) == 3 * len(WAY_MM)
    for (line, name), total in sums.items():
        expected = force[line] if name == FORCE else 0
        assert total == pytest.approx(expected, abs=2e-3 * max(abs(expected), parts[line, name]) + 1e-6)
    # The test sees friction: the force on the way back is another one.
    assert max(parts.values()) > 1e-2


def test_known_values_come_back_from_noisy_forces_within_their_intervals(scene, tmp_path):
    draws = 200 if "TORQUER_SOAK" in os.environ else 12
    rng = np.random.default_rng(5)
    exact = drawn(scene, TRUTH, 0, rng).splitlines()
    missed, widths = 0, []
    for _ in range(draws):
        rows = [line.rsplit(",", 1) for line in exact[1:]]
        text = "\n".join([exact[0], *(f"{front},{float(force) + 0.01 * rng.normal()!r}" for front, force in rows)])
        result = identify(Experiment(scene, table_of(scene, text, tmp_path), list(TRUTH)))
        assert result.measured == len(WAY_MM) and not result.snaps
        for one in result.values:
            missed += not one.low <= TRUTH[one.key] <= one.high
            widths.append((one.high - one.low) / TRUTH[one.key])
    # 95 % hold. More misses have a probability below 1 % for 24 intervals, and below 0.1 % for 400.
    assert missed <= (4 if draws == 12 else 34)
    if draws == 200:
        assert missed >= 8
    assert 0.005 < np.median(widths) < 0.5


def test_the_rest_angle_of_the_tip_comes_back_from_measured_shapes(scene, tmp_path):
    rng = np.random.default_rng(3)
    simulation = torquer.Simulation(scene.with_values({TIP: 44, "relaxation.tolerance": 1e-8}))
    shapes, rows = ["shape,point,x_mm,y_mm,z_mm"], ["time_s,insertion_mm,shape"]
    hands = simulation.hands
    for second, end_mm in enumerate((20, 32), 1):
        for way in np.linspace(hands[0, 0], end_mm, 100)[1:]:
            hands[0, 0] = way
            simulation.step(simulation.time_s + 0.01, hands)
        rows.append(f"{10 * second},{end_mm},s{second}")
        nodes = simulation.nodes_mm
        arcs = np.linspace(0.5, len(nodes) - 1.5, 40)  # not at nodes
        for k, point in enumerate(np.stack([np.interp(arcs, range(len(nodes)), nodes[:, axis]) for axis in range(3)], 1)):
            shapes.append(f"s{second},{k}," + ",".join(repr(float(x)) for x in point + rng.normal(0, 0.02, 3)))
    (tmp_path / "shapes.csv").write_text("\n".join(shapes))
    (tmp_path / "rows.csv").write_text("\n".join(rows))
    result = identify(Experiment(scene, measured.read(scene, tmp_path / "rows.csv", str(tmp_path / "shapes.csv")), [TIP]))
    (angle,) = result.values
    assert angle.low <= 44 <= angle.high and angle.high - angle.low < 3
    assert result.noise["shape"] == pytest.approx(0.02, rel=0.25)
    assert result.measured == 160


def test_values_that_the_measured_ones_do_not_determine_have_no_interval(scene, tmp_path):
    # Tips depend on the ratio of both alone.
    text = drawn(scene, {RIGIDITY: 0.6}, 1e-4, np.random.default_rng(2), ("tip_x_mm", "tip_y_mm"))
    result = identify(Experiment(scene, table_of(scene, text, tmp_path), [RIGIDITY, WALL]))
    assert [(one.low, one.high) for one in result.values] == [(None, None)] * 2
    assert result.correlation is None


HEAD = "time_s,wire.insertion_mm,wire.hand_force_mN\n"
ROWS = "1,10,1.0\n2,12,1.5\n3,14,2\n"


@pytest.mark.parametrize(
    ("text", "vary", "said"),
    [
        ("", [RIGIDITY], ":1: the column time_s is missing"),
        ("time_s,wire.hand_force_mN\n1,2\n", [RIGIDITY], ":1: no column moves an instrument"),
        ("time_s,insertion_mm,wire.insertion_mm,a\n1,2,2,1\n", [RIGIDITY], ":1: a hand has two columns"),
        ("time_s,time_s,insertion_mm\n1,1,2\n", [RIGIDITY], ":1: column 'time_s' is there 2 times"),
        ("# by hand\n\n" + HEAD + "1,10\n", [RIGIDITY], ":4: has 2 columns"),
        ('"",' + HEAD + '"1",1,10,1\n', [RIGIDITY], ":1: column 1 has no name; name it or remove it (in R"),
        (HEAD + "1,10\n", [RIGIDITY], ":2: has 2 columns, and the first line has 3"),
        (HEAD + "1,nan,1\n", [RIGIDITY], ":2: wire.insertion_mm is 'nan'"),
        (HEAD + "1,10,inf\n", [RIGIDITY], ":2: wire.hand_force_mN is 'inf'"),
        (HEAD + "2,10,1\n2,11,1\n", [RIGIDITY], ":3: time_s is 2, after 2"),
        (HEAD + "-1,10,1\n", [RIGIDITY], ":2: time_s is -1"),
        (HEAD + "1,10,\n", [RIGIDITY], "nothing was measured"),
        (HEAD + "1,10,NA\n", [RIGIDITY], "nothing was measured"),
        ("time_s,insertion_mm,shape\n1,2,s\n", [RIGIDITY], ":2: there is no shape 's'"),
        (HEAD.replace("hand_force", "hand_farce") + ROWS, [RIGIDITY], ":1: the scene has no reading 'wire.hand_farce_mN'; did you mean wire.hand_force_mN? it has tip_x_mm"),
        (HEAD + "1,10,1.0\n2,12,1.5\n", [RIGIDITY, FRICTION], "has 2 measured values for 2 keys"),
        (HEAD + ROWS, [], "no key is varied"),
        (HEAD + ROWS, ["instrument.wore.radius_mm"], "there is no instrument 'wore'; did you mean wire? there are: wire"),
        (HEAD + ROWS, ["effects.friction.slip"], "effects.friction.slip is not in the scene"),
        (HEAD + ROWS, ["vessel.kind"], "vessel.kind is 'torus'; vary a number"),
        (HEAD + ROWS, {"vessel.wall_stiffness_N_mm2": 0}, "is 0; give a start"),
    ],
)
def test_faults_are_refused_by_file_line_and_remedy(scene, tmp_path, text, vary, said):
    with pytest.raises(torquer.Error) as error:
        Experiment(scene, table_of(scene, text, tmp_path), vary)
    assert said in str(error.value)


def test_tables_of_other_programs_give_the_same_values(scene, tmp_path):
    plain = table_of(scene, HEAD + ROWS, tmp_path)
    for separator, above in ((";", "sep=;\n"), ("\t", ""), (",", "\n# by hand\n")):
        other = table_of(scene, above + (HEAD + ROWS).replace(",", separator), tmp_path)
        assert other.columns == plain.columns and other.values() == plain.values() == 3
        assert [row.line - plain.rows[k].line for k, row in enumerate(other.rows)] == [above.count("\n")] * 3
        for row, same in zip(other.rows, plain.rows):
            assert (row.time_s, row.readings) == (same.time_s, same.readings) and (row.hands == same.hands).all()


def test_a_lone_wire_without_a_name_is_varied_by_its_usual_one(tmp_path):
    scene = torquer.Scene.from_text(SCENE.replace('name = "wire"\n', ""))
    assert [one.name for one in scene.instruments] == ["guidewire"]
    table = table_of(scene, HEAD.replace("wire.", "guidewire.") + ROWS, tmp_path)
    experiment = Experiment(scene, table, ["instrument.guidewire.rigidity_N_mm2"])
    # Twice as stiff, the wire is another scene.
    assert experiment.scene_at([2]).text != experiment.scene_at([1]).text


def test_a_first_row_at_the_start_may_move_nothing_and_a_motion_needs_time(scene, tmp_path):
    still = Experiment(scene, table_of(scene, HEAD + "0,0,0\n" + ROWS, tmp_path), [RIGIDITY])
    assert len(still.residuals([1])) == 4
    moved = Experiment(scene, table_of(scene, HEAD + "0,5,0\n" + ROWS, tmp_path), [RIGIDITY])
    with pytest.raises(torquer.Error, match=r"measured.csv:2: the hands move by then, and no time has passed"):
        moved.residuals([1])


def test_a_value_that_runs_away_is_refused(scene, tmp_path):
    # No friction explains a hand that pulls the wire while it is pushed in.
    with pytest.raises(torquer.Error, match="runs to|coefficient"):
        identify(Experiment(scene, table_of(scene, HEAD + "1,10,-50\n2,20,-60\n3,30,-70\n", tmp_path), [FRICTION]))


def test_a_fitted_scene_finds_its_surface_from_any_folder(tmp_path):
    scene = torquer.Scene(torquer.scene_path("neuro_arch"))
    moved = tmp_path / "fitted.toml"
    moved.write_text(report.movable(scene).text)
    assert torquer.Scene(moved).centerlines == scene.centerlines
    # Every key that names a file is known here.
    listed = subprocess.run([pathlib.Path(torquer.__file__).absolute().parents[3] / "bin/torquer-simulator", "--list-keys", "--markdown"], capture_output=True, text=True, check=True).stdout
    section, named = "", set()
    for line in listed.splitlines():
        section = line.split("`")[1].strip("[]") if line.startswith("### `[") else section
        if line.startswith("| `") and "| text |" in line and "relative to" in line or line.startswith("| `centerlines`"):
            named.add(f"{section}.{line.split('`')[1]}")
    assert named == set(report._PATHS)


def command(*arguments):
    return subprocess.run([sys.executable, "-m", "torquer.identify", *map(str, arguments)], env=ENVIRONMENT, capture_output=True, text=True, timeout=300)


def test_the_command_writes_tables_a_picture_and_a_scene_that_loads(scene, tmp_path):
    (tmp_path / "bend.toml").write_text(SCENE)
    (tmp_path / "measured.csv").write_text(drawn(scene, TRUTH, 0.01, np.random.default_rng(7)))
    out = tmp_path / "result"
    arguments = ["--scene", tmp_path / "bend.toml", "--measured", tmp_path / "measured.csv", "--vary", RIGIDITY, "--vary", f"{FRICTION}=0.2", "--out", out]
    ran = command(*arguments)
    assert ran.returncode == 0, ran.stderr
    values = {one["key"]: one for one in json.loads((out / "table.json").read_text())["values"]}
    assert values[FRICTION]["start"] == 0.2
    for key, truth in TRUTH.items():
        assert values[key]["value"] == pytest.approx(truth, rel=0.1)
    fitted = torquer.Scene(out / "fitted.toml").text
    assert f"coefficient = {values[FRICTION]['value']!r}" in fitted
    assert (out / "residuals.png").read_bytes().startswith(b"\x89PNG")
    assert len((out / "residuals.csv").read_text().splitlines()) == 1 + len(WAY_MM)
    assert len((out / "sensitivities.csv").read_text().splitlines()) == 1 + 2 * len(WAY_MM)
    before = sorted(path.name for path in tmp_path.iterdir())
    again = command(*arguments)
    assert again.returncode == 2 and "exists already" in again.stderr
    wrong = command(*arguments[:-1], tmp_path / "other", "--vary", f"{WALL}=soft")
    assert wrong.returncode == 2 and "'soft' is not a number" in wrong.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == before
