"""Scripts of torquer-batch: the states of torquer-simulator --script, keys, refusals."""

import json
import pathlib
import subprocess

import numpy as np
import pytest
import torquer
import torquer.batch
import zarr
from batch_runs import PACKAGES, study

TRAY = """name = "tray"
[vessel]
kind = "ty_phantom"
wall_stiffness_N_mm2 = 0.05
[entry]
centerline = "main"
at_mm = 1
[[instrument]]
name = "wire"
device = "sion"
max_length_mm = 200
[[instrument]]
name = "catheter"
device = "microcatheter_1_8f"
max_length_mm = 200
inserted_at_start_mm = 20
[effects.internal_forces]
"""
EXCHANGES = """# A catheter and then a wire are exchanged.
time_s,catheter.insertion_mm,wire.insertion_mm,wire.rotation_rad,catheter.device,wire.device
0.5,5,30,0,,
1,-20,40,1,,
1.5,0,40,1,microcatheter_2_7f,
2,0,0,1,,
2.5,10,20,1,,sion_black
"""
XRAY = """time_s,guidewire.insertion_mm,lao_deg,xray,contrast,imaging_mode,pulses_per_s,shutter_left,table_left_mm,injector,injector_volume_mL
0.3,0,10,1,0,plain,10,0,0,arm,1
0.5,4,20,1,1,plain,30,0.2,5,inject,1
0.9,9,20,1,0,roadmap,30,0.2,5,inject,1
1,10,20,0,0,as_scene,0,0,0,off,-1
"""


def scripted(tmp_path, scene, rows, shapes="rows"):
    (tmp_path / "moves.csv").write_text(rows)
    return f'scenes = ["{scene}"]\nshapes = "{shapes}"\n[[motion]]\nname = "moves"\nscript = "moves.csv"\n'


def cases_of(path):
    return list(torquer._batch_study.cases(torquer._batch_study.read_study(str(path))))


@pytest.mark.parametrize(("scene", "rows"), [("tray.toml", EXCHANGES), ("coronary", XRAY)], ids=["exchanges", "xray"])
def test_each_row_has_the_state_and_readings_of_the_simulator(study, tmp_path, scene, rows):
    study(TRAY, "tray")
    path = study(scripted(tmp_path, scene, rows))
    out = tmp_path / "out"
    summary = torquer.batch.run(str(path), str(out))
    assert summary.failures == [] and summary.done == 1
    states, record = tmp_path / "states.bin", tmp_path / "record.json"
    subprocess.run(
        [
            PACKAGES.parents[1] / "bin/torquer-simulator", "--scene", tmp_path / scene if "." in scene else scene,
            "--script", tmp_path / "moves.csv", "--states", states, "--record", record,
        ],
        check=True, capture_output=True,
    )
    expected = torquer.read_states(states)
    (stored,) = map(json.loads, (out / "readings.jsonl").read_text().splitlines())
    assert int(stored["readings"]["state_hash"], 16) == int(expected["state_hash"][-1])
    kept = zarr.open(str(out / "shapes" / f"{stored['key']}.zip"), mode="r")
    series = dict(zip(kept.attrs["columns"], np.transpose(kept["series"][:])))
    assert np.array_equal(series["time_s"], expected["time_s"])
    for row, nodes in enumerate(expected["nodes_mm"]):
        first, end = kept["first_node"][row : row + 2]
        assert np.array_equal(kept["nodes_mm"][first:end], nodes)
    readings = json.loads(record.read_text())["readings"]
    assert {name: stored["readings"][name] for name in readings} == readings
    if scene == "coronary":
        assert readings["xray_pulses"] > 5 and readings["contrast_injected_mL"] > 0.5 and readings["injections"] == 1


def test_a_key_has_the_devices_of_the_script(study, tmp_path, monkeypatch):
    study(TRAY, "tray")
    path = study(scripted(tmp_path, "tray.toml", EXCHANGES, "none"))
    (case,) = cases_of(path)
    names = [pathlib.Path(name).stem for name in case.script.named]
    assert names == ["microcatheter_2_7f", "sion_black"] and set(case.script.named) < set(case.named)
    keys = {case.key}
    usual = torquer._batch_study._bytes_hash
    for name in names:
        with monkeypatch.context() as changed:
            changed.setattr(torquer._batch_study, "_bytes_hash", lambda file: usual(file) + name * (file.stem == name))
            keys.add(cases_of(path)[0].key)
            with pytest.raises(torquer.Error, match="a file of the scene has changed since the case was made"):
                torquer._batch_case.run(case)
    (tmp_path / "moves.csv").write_text(EXCHANGES.replace("sion_black", "sion_blue"))
    keys.add(cases_of(path)[0].key)
    assert len(keys) == 4


def test_a_device_that_changes_before_its_exchange(study, tmp_path, monkeypatch):
    study(TRAY, "tray")
    (case,) = cases_of(study(scripted(tmp_path, "tray.toml", EXCHANGES, "none")))
    usual = torquer._batch_study._bytes_hash

    class Changing(torquer.Simulation):
        def step_row(self, row):
            if row.exchanges:
                monkeypatch.setattr(torquer._batch_study, "_bytes_hash", lambda file: usual(file) + "changed")
            return super().step_row(row)

    monkeypatch.setattr(torquer._batch_case, "Simulation", Changing)
    with pytest.raises(torquer.Error, match="a file of the scene has changed since the case was made"):
        torquer._batch_case.run(case)


def test_hands_of_speeds_begin_at_their_start_and_stay_at_the_entry(study):
    study(TRAY, "tray")
    path = study(
        'scenes = ["tray.toml"]\n[axes]\n"instrument.catheter.inserted_at_start_mm" = [1, 20]\n[[motion]]\nname = "back"\n'
        "duration_s = 0.4\nrow_s = 0.2\nhands.catheter = { speed_mm_s = -10, turn_rad_s = 1 }\n"
    )
    texts = [case.script.text.splitlines() for case in cases_of(path)]
    assert [lines[0] for lines in texts] == ["time_s,catheter.insertion_mm,catheter.rotation_rad"] * 2
    rows = [np.loadtxt(lines[1:], delimiter=",") for lines in texts]
    assert np.allclose(rows[0], [[0, 0, 0], [0.2, -1, 0.2], [0.4, -1, 0.4]])
    assert np.allclose(rows[1], [[0, 0, 0], [0.2, -2, 0.2], [0.4, -4, 0.4]])


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("", ":1: empty; the first line must name the columns"),
        ("time_s,guidewire.speed\n1,2\n", ":1: a script for "), ("time_s,guidewire.devise\n1,2\n", "did you mean guidewire.device?"),
        ("time_s,lao_deg,lao_deg\n1,2,3\n", ":1: the column lao_deg appears twice"),
        ("guidewire.insertion_mm\n1\n", ":1: there is no column time_s"),
        ("time_s;lao_deg\n1;2\n", ":1: semicolons separate the columns"), ("time_s\tlao_deg\n1\t2\n", ":1: tabs separate"),
        ("time_s\r1\r", ":1: carriage returns alone end the lines"), ("sep=,\r\ntime_s\r\n1\r\n,\r\nx\r\n", ":5: time_s is 'x'; give a finite number"),
        ('"","time_s"\n"1",2\n', ":1: column 1 has no name; name it or remove it (in R: row.names = FALSE)"),
        ("time_s\n1\n1\n", ":3: time_s is '1', not later than the previous row"),
        ("# rows\ntime_s\n1,2\n", ":3: the row has 2 values, but the header 'time_s' names 1"),
        ("time_s\ninf\n", ":2: time_s is 'inf'; give a finite number"),
        ("time_s,xray\n0,2\n", ":2: xray is '2'; give 0 or 1"),
        ("time_s,guidewire.device\n0,\n1,sion_blu\n", ":3: guidewire.device is 'sion_blu', not a device of the library; did you mean sion_blue?"),
        ("time_s\n", ": there is no row below the header; give at least one"),
    ],
)
def test_a_script_that_makes_no_sense_is_refused(study, tmp_path, rows, said):
    (tmp_path / "moves.csv").write_bytes(rows.encode())
    path = study('scenes = ["ty_phantom"]\n[[motion]]\nname = "m"\nscript = "moves.csv"\n')
    with pytest.raises(torquer.Error) as refused:
        torquer.batch.run(str(path), str(tmp_path / "out"))
    assert str(refused.value).startswith(f"{tmp_path}/moves.csv") and said in str(refused.value)


def test_a_failed_exchange_names_its_line(study, tmp_path):
    study(TRAY, "tray")
    path = study(scripted(tmp_path, "tray.toml", "time_s,catheter.device\n0,\n1,microcatheter_2_7f\n"))
    (failure,) = torquer.batch.run(str(path), str(tmp_path / "out")).failures
    assert failure["message"].startswith(f"{tmp_path}/moves.csv:3: ") and "withdraw" in failure["message"]


def test_rows_are_refused_by_their_line_or_scene_and_change_nothing():
    scene = torquer.Scene.from_text(TRAY)
    simulation = torquer.Simulation(scene)
    first, second = scene.parse_script("time_s,wire.insertion_mm,catheter.device\n3,2,\n4,2,microcatheter_2_7f\n", "my.csv")
    assert (first.place, first.time_s, first.exchanges) == ("my.csv:2", 3, [])
    assert second.exchanges == [(1, "microcatheter_2_7f")]
    simulation.step_row(first)
    assert simulation.time_s == 0 and simulation.hands[0, 0] == 2
    before = simulation.state_hash
    with pytest.raises(torquer.Error, match="my.csv:3: catheter .*withdraw"):
        simulation.step_row(second)
    (other,) = torquer.Scene("ty_phantom").parse_script("time_s\n0\n")
    with pytest.raises(torquer.Error, match="hands has 1 entries, but tray has 2 instruments"):
        torquer.Simulation(scene).step_row(other)
    with pytest.raises(torquer.Error, match="not later than the previous command"):
        simulation.step_row(first)
    assert simulation.state_hash == before
    assert simulation.step_row(scene.parse_script("time_s\n0\n1\n")[1], after_tick=lambda tick: False).ticks == 1
