"""Batches: stored results survive any kill and do not run again; refusals and failures."""

import csv
import json
import multiprocessing
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import time

import distributed
import numpy as np
import pytest
import torquer
import torquer.batch
import zarr
from batch_runs import ENVIRONMENT, MOTION, PACKAGES, cases, check_whole, finish, lines, start, study, wait_for

def worker_processes(process):
    """Worker processes of a run with --workers, which multiprocessing started."""
    found = []
    for folder in pathlib.Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            command = (folder / "cmdline").read_bytes()
        except OSError:
            continue
        if parent == process.pid and b"spawn_main" in command:
            found.append(int(folder.name))
    return found


def test_a_case_equals_a_single_run_of_the_simulator(study, tmp_path):
    script = tmp_path / "moves.csv"
    # Excel writes a byte order mark first.
    script.write_text("\ufefftime_s,guidewire.insertion_mm,guidewire.rotation_rad\n0.5,20,0.5\n1,45,1\n1.5,70,-1\n")
    path = study(
        'scenes = ["ty_phantom"]\nshapes = "rows"\n[axes]\n"effects.friction.coefficient" = [0.05, 0.2]\n'
        f'"effects.internal_forces" = [true]\n[[motion]]\nname = "moves"\nscript = "{script.name}"\n'
    )
    out = tmp_path / "out"
    summary = torquer.batch.run(str(path), str(out))
    assert (summary.cases, summary.done, summary.failures) == (2, 2, [])
    shipped = pathlib.Path(torquer.scene_path("ty_phantom"))
    for record in map(json.loads, (out / "readings.jsonl").read_text().splitlines()):
        coefficient = record["case"]["effects.friction.coefficient"]
        text = shipped.read_text().replace("coefficient = 0.1", f"coefficient = {coefficient}")
        scene = tmp_path / "scene.toml"
        scene.write_text(text + "\n[effects.internal_forces]\n")
        states = tmp_path / "states.bin"
        subprocess.run(
            [PACKAGES.parents[1] / "bin/torquer-simulator", "--scene", scene, "--script", script, "--states", states],
            check=True, capture_output=True,
        )
        expected = torquer.read_states(states)
        kept = zarr.open(str(out / "shapes" / f"{record['key']}.zip"), mode="r")
        assert kept["first_node"][-1] == len(kept["nodes_mm"])
        for row in range(3):
            first, end = kept["first_node"][row : row + 2]
            assert np.array_equal(kept["nodes_mm"][first:end], expected["nodes_mm"][row])
        hand = kept.attrs["columns"].index("guidewire.hand_force_mN")
        force = [values[hand] for values in kept["series"][:]]
        assert record["readings"]["guidewire.hand_force_mN"] == force[-1]
        assert record["readings"]["largest.guidewire.hand_force_mN"] == max(force)


def test_a_reading_that_is_not_known_is_null_and_stays_stored(study, tmp_path):
    path = study(
        'scenes = ["ty_phantom"]\n[axes]\n"relaxation.budget_units" = [1]\n"relaxation.tolerance" = [1e-10]\n'
        f'"effects.wall_force.threshold_mN" = [30]\n{MOTION}'
    )
    out = tmp_path / "out"
    assert finish(path, out)[0] == 0
    text = (out / "readings.jsonl").read_text()
    readings = json.loads(text)["readings"]
    assert readings["unconverged_rows"] == readings["rows"] - 1  # the start is in equilibrium
    assert readings["wall_force_largest_mN"] is None and readings["largest.wall_force_event_mN"] is None
    assert "NaN" not in text and "nan" not in (out / "readings.csv").read_text().lower()
    # A second run reads the stored results.
    status, output, error = finish(path, out)
    assert status == 0, error
    assert (out / "readings.jsonl").read_text() == text


def test_stored_cases_are_not_run_again_and_changed_ones_are(study, tmp_path):
    out = tmp_path / "out"
    ran = []
    first = torquer.batch.run(str(study(cases(6))), str(out), on_case=ran.append)
    assert first.done == len(ran) == 6
    again = torquer.batch.run(str(study(cases(9))), str(out), on_case=ran.append)
    assert (again.stored_before, again.done) == (6, 3)
    slower = cases(6).replace("speed_mm_s = 40", "speed_mm_s = 30")
    assert torquer.batch.run(str(study(slower)), str(out)).stored_before == 0
    # A scene is identified by its content, not by its name; the same holds for a file that it
    # names.
    text = pathlib.Path(torquer.scene_path("drill_tube")).read_text()
    scene = study(text, "own")
    own = study(cases(1).replace("ty_phantom", "own.toml"))
    assert torquer.batch.run(str(own), str(out)).done == 1
    scene.write_text(f"# the same\n{text}")
    assert torquer.batch.run(str(own), str(out)).done == 0
    scene.write_text(text.replace("radii_mm = [3]", "radii_mm = [2.5]"))
    assert torquer.batch.run(str(own), str(out)).done == 1


TUBE = """name = "own"
[vessel]
kind = "surface"
file = "tube.obj"
mesh_unit = "mm"
wall_stiffness_N_mm2 = 10
[entry]
point_mm = [5, 0, 0]
direction = [1, 0.4, 0]
[[instrument]]
name = "guidewire"
max_length_mm = 90
radius_mm = 0.4
from_tip_mm = [0, 50]
rigidity_N_mm2 = [1, 1]
tip_mm = 15
tip_angle_deg = 45
"""


def write_tube(path, radius_mm):
    """A straight tube along x with open ends."""
    angles = 2 * np.pi * np.arange(24) / 24
    points = [(x, radius_mm * np.cos(a), radius_mm * np.sin(a)) for x in range(0, 101, 5) for a in angles]
    faces = [
        corners
        for ring in range(20)
        for k in range(24)
        for one, two, three, four in [(24 * ring + k, 24 * ring + (k + 1) % 24, 24 * ring + 24 + (k + 1) % 24, 24 * ring + 24 + k)]
        for corners in ((one, two, three), (one, three, four))
    ]
    text = "".join("v %r %r %r\n" % tuple(map(float, point)) for point in points)
    path.write_text(text + "".join("f %d %d %d\n" % tuple(k + 1 for k in face) for face in faces))


def test_a_surface_that_changes_while_processes_live(study, tmp_path):
    study(TUBE, "own")
    surface = tmp_path / "tube.obj"
    path = study(cases(2).replace("ty_phantom", "own.toml"))

    def readings(out):
        records = map(json.loads, (tmp_path / out / "readings.jsonl").read_text().splitlines())
        return {record["key"]: record["readings"] for record in records}

    write_tube(surface, 4)
    torquer.batch.run(str(path), str(tmp_path / "living"))
    pickled = pickle.dumps(torquer.Scene(str(tmp_path / "own.toml")))
    old = list(torquer._batch_study.cases(torquer._batch_study.read_study(str(path))))
    write_tube(surface, 2)
    # A case made with the former file is refused, and so is a scene pickled with it.
    torquer._batch_case._load.cache_clear()
    torquer._batch_case._load_with.cache_clear()
    with pytest.raises(torquer.Error, match="a file of the scene has changed since the case was made"):
        torquer._batch_case.run(old[0])
    with pytest.raises(torquer.Error, match="a file of the pickled scene own has changed since"):
        pickle.loads(pickled)
    assert torquer.batch.run(str(path), str(tmp_path / "living")).done == 2
    status, _, error = finish(path, tmp_path / "fresh")
    assert status == 0, error
    living, fresh = readings("living"), readings("fresh")
    assert len(living) == 4 and fresh.items() <= living.items()
    assert len({row["state_hash"] for row in living.values()}) == 4
    write_tube(surface, 4)
    again = list(torquer._batch_study.cases(torquer._batch_study.read_study(str(path))))
    assert [case.key for case in again] == [case.key for case in old]


def test_a_surface_that_changes_while_it_is_read(study, tmp_path, monkeypatch):
    study(TUBE, "own")
    write_tube(tmp_path / "tube.obj", 4)
    path = study(cases(1).replace("ty_phantom", "own.toml"))
    load = torquer._batch_case._load

    def slow(*of):
        write_tube(tmp_path / "tube.obj", 2)
        return load(*of)

    monkeypatch.setattr(torquer._batch_case, "_load", slow)
    summary = torquer.batch.run(str(path), str(tmp_path / "out"))
    assert summary.done == 0 and "a file of the scene has changed" in summary.failures[0]["message"]
    assert lines(tmp_path / "out") == 0


def test_killed_workers_lose_no_case(study, tmp_path):
    out = tmp_path / "out"
    process = start(study(cases(160)), out, "--workers", 2)
    for stored in (20, 80):
        wait_for(process, out, stored)
        found = worker_processes(process)
        assert found
        os.kill(found[0], signal.SIGKILL)
    output, error = process.communicate(timeout=120)
    assert process.returncode == 0, error
    assert output.startswith("160 cases done, 0 were stored before, 0 failed")
    check_whole(out, 160)


def test_a_run_that_is_killed_is_taken_up_again(study, tmp_path):
    path = study(cases(120))
    out = tmp_path / "out"
    process = start(path, out)
    wait_for(process, out, 15)
    process.kill()
    process.communicate()
    stored = lines(out)
    assert stored < 120
    # A cut-off line, a shape without its line, and partial files.
    with (out / "readings.jsonl").open("ab") as file:
        file.write(b'{"key": "cut')
    with (out / "torquer-batch.jsonl").open("ab") as file:
        file.write(json.dumps({"shape": "0" * 64}).encode() + b'\n{"sha')
    (out / "shapes" / f"{'0' * 64}.zip").write_bytes(b"half")
    for folder in (out, out / "shapes"):
        (folder / ".torquer-batch.part").write_bytes(b"half")
    status, output, error = finish(path, out)
    assert status == 0, error
    assert output.startswith(f"{120 - stored} cases done, {stored} were stored before, 0 failed")
    check_whole(out, 120)


@pytest.fixture
def cluster(tmp_path):
    """A scheduler and a worker, started as on the machines of a cluster."""
    file = tmp_path / "scheduler.json"
    log = (tmp_path / "cluster.log").open("w")
    common = ["--scheduler-file", str(file), "--no-dashboard"]

    def dask(program, *more):
        return subprocess.Popen(
            [sys.executable, "-B", "-m", f"distributed.cli.{program}", *common, *more],
            env=ENVIRONMENT, cwd=tmp_path, stdout=log, stderr=log,
        )

    scheduler = dask("dask_scheduler", "--host", "127.0.0.1", "--port", "0")
    for _ in range(1000):
        if file.exists() and file.read_text().endswith("}"):
            break
        time.sleep(0.02)
    worker = dask("dask_worker", "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", "--death-timeout", "5")
    yield scheduler, json.loads(file.read_text())["address"]
    for process in (worker, scheduler):
        process.kill()
        process.wait()
    log.close()


def test_a_cluster_whose_scheduler_is_lost(study, tmp_path, cluster):
    scheduler, address = cluster
    path = study(cases(100))
    out = tmp_path / "out"
    process = start(path, out, "--scheduler", address)
    wait_for(process, out, 10)
    scheduler.kill()
    output, error = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "the scheduler is gone (" in error and "the finished cases are stored; run the command again" in error
    stored = lines(out)
    assert 10 <= stored < 100
    status, output, error = finish(path, out, "--workers", 1)
    assert status == 0, error
    assert output.startswith(f"{100 - stored} cases done, {stored} were stored before, 0 failed")
    check_whole(out, 100)


def test_a_failing_case_is_listed_and_the_rest_continues(study, tmp_path):
    (tmp_path / "late.csv").write_text("time_s,guidewire.insertion_mm,guidewire.device\n0,10,\n1,20,sion_blue\n")
    path = study(f'scenes = ["ty_phantom"]\n{MOTION}\n[[motion]]\nname = "late"\nscript = "late.csv"\n', "partly")
    out = tmp_path / "out"
    status, output, error = finish(path, out)
    assert status == 1
    assert output.startswith("1 cases done, 0 were stored before, 1 failed")
    # Torquer's own lines alone, without Dask's log.
    assert [line.split(":")[0] for line in error.splitlines()] == ["2 of 2 cases, 1 failed", "failed"]
    assert f"failed: ty_phantom, late, seed = 1: {tmp_path}/late.csv:3: guidewire" in error
    (failure,) = map(json.loads, (out / "failures.jsonl").read_text().splitlines())
    assert failure["case"]["motion"] == "late"
    assert "Failures" in (out / "report.html").read_text()
    # A second run tries it again.
    assert finish(path, out)[1].startswith("0 cases done, 1 were stored before, 1 failed")


def listening(pids):
    """Addresses at which processes accept TCP connections, in the form of /proc/net."""
    inodes = set()
    for pid in pids:
        for entry in pathlib.Path(f"/proc/{pid}/fd").iterdir():
            try:
                inodes.add(os.readlink(entry))
            except OSError:
                continue
    rows = [line.split() for table in ("tcp", "tcp6") for line in pathlib.Path(f"/proc/net/{table}").read_text().splitlines()[1:]]
    return [row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in inodes]


@pytest.mark.parametrize("workers", [0, 1])
def test_no_port_is_open_to_other_machines(study, tmp_path, workers):
    found = []

    def look(_):
        found.extend(listening([os.getpid(), *(child.pid for child in multiprocessing.active_children())]))

    torquer.batch.run(str(study(cases(1))), str(tmp_path / "out"), workers=workers, on_case=look)
    assert found and {address.split(":")[0] for address in found} == {"0100007F"}


@pytest.mark.parametrize("how", ["file", "module"])
def test_a_script_without_a_guard_runs_with_worker_processes(study, tmp_path, how):
    study(cases(2))
    body = 'import torquer.batch\nprint(torquer.batch.run("study.toml", "out", workers=1).done)\n'
    (tmp_path / "begun.py").write_text(f"open('begun', 'a').write('x')\n{body}")
    arguments = {"file": ["begun.py"], "module": ["-m", "begun"]}[how]
    process = subprocess.Popen(
        [sys.executable, "-B", *arguments], env=ENVIRONMENT, cwd=tmp_path, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )
    try:
        output, error = process.communicate(timeout=120)
    finally:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
    assert process.returncode == 0 and output == "2\n", error
    # No worker process executed the script.
    assert (tmp_path / "begun").read_text() == "x"
    check_whole(tmp_path / "out", 2)


def test_command_line(study, tmp_path):
    out = tmp_path / "out"
    path = study(cases(2))
    status, output, _ = finish(path, out, "--json")
    assert status == 0 and json.loads(output)["done"] == 2
    assert finish(path, out, "--workers", "-1")[0] == 2
    with (out / "readings.jsonl").open("r+b") as file:
        whole = file.read()
        file.seek(0)
        file.write(b"{}\n" + whole)
    status, _, error = finish(path, out)
    (out / "readings.jsonl").write_bytes(whole)
    assert status == 2 and "readings.jsonl:1: is not a line of torquer-batch" in error
    status, _, error = finish(study(cases(3)), out, "--scheduler", "tcp://127.0.0.1:1")
    assert status == 2 and "--scheduler tcp://127.0.0.1:1: " in error
    running = start(study(cases(400).replace("duration_s = 1", "duration_s = 60"), "long"), out)  # for minutes
    wait_for(running, out, 3)
    status, _, error = finish(path, out)
    assert status == 2 and "another torquer-batch writes there" in error
    running.send_signal(signal.SIGINT)
    _, error = running.communicate(timeout=60)
    assert running.returncode == 130 and "run the command again" in error


def test_a_late_close_hides_no_interrupt(study, tmp_path, monkeypatch):
    close = distributed.Client.close

    def close_late(self, *arguments, **options):
        close(self, *arguments, **options)
        raise distributed.TimeoutError("timed out after 5 s")

    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(distributed.Client, "close", close_late)
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        torquer.batch.run(str(study(cases(2))), str(out), on_case=interrupt)
    monkeypatch.undo()
    assert torquer.batch.run(str(study(cases(2))), str(out)).stored_before == 1


def test_cases_that_are_not_valid_are_marked_and_left_out_of_plots(study, tmp_path):
    text = f'scenes = ["ty_phantom"]\nseeds = [1, 2]\n[axes]\n"relaxation.budget_units" = [1, 1000]\n{MOTION}'
    out = tmp_path / "out"
    assert torquer.batch.run(str(study(text)), str(out)).done == 4
    with open(out / "readings.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["invalid"] for row in rows] == ["not converged"] * 2 + [""] * 2
    page = (out / "report.html").read_text()
    assert "These 2 cases are not valid, so plots and readings below leave them out" in page
    both = torquer.batch.run(str(study('plots = "all"\n' + text)), str(out))
    assert both.stored_before == 4
    shown = (out / "report.html").read_text()
    assert "but plots and readings below have them" in shown
    # With all of them, the budget explains the tip's place, and a plot shows it.
    assert "relaxation.budget_units" in shown[shown.index("<svg") :] and "relaxation.budget_units" not in page[page.index("<svg") :]


def test_a_worker_of_another_build_refuses(study):
    (case,) = torquer._batch_study.cases(torquer._batch_study.read_study(str(study(cases(1)))))
    with pytest.raises(torquer.Error, match=f"this worker has the build {torquer.__build__} .*, but torquer-batch has 0123"):
        torquer.batch._work(case, "0123")
