"""Shares of a study: jobs that do not know each other, and the collection of their results."""

import errno
import io
import json
import os
import shutil

import numpy as np
import pytest
import torquer
import torquer.batch
import zarr
from batch_runs import MOTION, cases, check_whole, finish, lines, start, study, wait_for
from torquer._batch_share import read_share, slurm_share


def records(out):
    found = map(json.loads, (out / "readings.jsonl").read_text().splitlines())
    return {record["key"]: record for record in found}


def tree(folder):
    """Files with their contents, except for the page, whose plots have random names, and its record."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path: path.read_bytes() for path in files if path.name not in ("report.html", "torquer-batch.jsonl")}


def array(number, first=0, last=2, step=1, count=3):
    values = {"ID": number, "MIN": first, "MAX": last, "STEP": step, "COUNT": count}
    return {f"SLURM_ARRAY_TASK_{name}": str(value) for name, value in values.items()}


def test_shares_are_together_the_whole_study(study, tmp_path):
    path = study(cases(10))
    whole, out = tmp_path / "whole", tmp_path / "out"
    torquer.batch.run(str(path), str(whole))
    # Two tasks of a job array at once, and the third by its number.
    tasks = [start(path, out, **array(number)) for number in (0, 2)]
    ended = [(task.communicate(timeout=120), task.returncode) for task in tasks]
    assert [status for _, status in ended] == [0, 0], ended
    assert ended[0][0][0].startswith("4 cases done, 0 were stored before, 0 failed: ")
    assert f"{out}/shares/1-of-3/report.html" in ended[0][0][0]
    status, output, error = finish(path, out, "--gather")
    assert status == 1 and output.startswith("7 cases gathered, 0 were stored before, 3 missing: "), error
    assert error.count("missing: ty_phantom, push, seed = ") == 3 and "seed = 1: no share has stored it yet" in error
    assert torquer.batch.run(str(path), str(out), share="2/3").done == 3
    found = torquer.batch.gather(str(path), str(out))
    assert (found.cases, found.stored_before, found.done, found.failures) == (10, 7, 3, [])
    check_whole(out, 10)
    assert records(out) == records(whole)
    assert (out / "readings.csv").read_text() == (whole / "readings.csv").read_text()
    for key in records(out):
        kept, expected = (zarr.open(str(folder / "shapes" / f"{key}.zip"), mode="r") for folder in (out, whole))
        assert np.array_equal(kept["series"], expected["series"], equal_nan=True) and kept.attrs["columns"] == expected.attrs["columns"]
    # A second time changes nothing. Neither a share nor the whole study runs a gathered case again.
    before = tree(out)
    assert torquer.batch.gather(str(path), str(out)).done == 0
    assert tree(out) == before
    shutil.rmtree(out / "shares")
    again = torquer.batch.run(str(path), str(out), share="1/2")
    assert (again.stored_before, again.done) == (5, 0)
    assert torquer.batch.run(str(path), str(out)).done == 0


def test_a_failed_case_of_a_share_keeps_its_message(study, tmp_path):
    (tmp_path / "moves.csv").write_text("time_s,guidewire.insertion_mm,guidewire.device\n0,10,\n1,20,sion_blue\n")
    path = study(f'scenes = ["ty_phantom"]\n{MOTION}\n[[motion]]\nname = "moves"\nscript = "moves.csv"\n')
    out = tmp_path / "out"
    for share in ("1/2", "2/2"):
        torquer.batch.run(str(path), str(out), share=share)
    (failure,) = torquer.batch.gather(str(path), str(out)).failures
    assert failure["case"]["motion"] == "moves" and "moves.csv:3: " in failure["message"]
    assert [json.loads(line) for line in (out / "failures.jsonl").read_text().splitlines()] == [failure]


def test_shares_of_another_study_or_build_are_refused(study, tmp_path, monkeypatch):
    out = tmp_path / "out"
    torquer.batch.run(str(study(cases(2))), str(out), share="1/2")
    torquer.batch.run(str(study(cases(3))), str(out), share="2/2")
    with pytest.raises(torquer.Error, match=f"{out}/shares/1-of-2: its cases are of another study; run this share again, or move"):
        torquer.batch.gather(str(study(cases(3))), str(out))
    assert lines(out) == 0
    # The remedy: the stored case is not run again.
    assert torquer.batch.run(str(study(cases(3))), str(out), share="1/2").stored_before == 1
    with monkeypatch.context() as other:
        for module in (torquer.batch, torquer._batch_study):
            other.setattr(module, "__build__", "0123")
        with pytest.raises(torquer.Error, match=f"1-of-2: its cases are of the build {torquer.__build__} of Torquer, but this is 0123;"):
            torquer.batch.gather(str(study(cases(3))), str(out))
    assert lines(out) == 0
    assert torquer.batch.gather(str(study(cases(3))), str(out)).failures == []
    check_whole(out, 3)


def test_shares_that_have_just_begun_and_other_files_are_left_alone(study, tmp_path):
    out = tmp_path / "out"
    path = study(cases(2))
    torquer.batch.run(str(path), str(out), share="1/2")
    (out / "shares/2-of-2").mkdir()
    (out / "shares/notes").write_text("mine")
    (out / "shares/own").mkdir()
    # A line that is being written.
    with (out / "shares/1-of-2/readings.jsonl").open("a") as file:
        file.write('{"key": "cut')
    before = tree(out / "shares")
    assert len(torquer.batch.gather(str(path), str(out)).failures) == 1
    assert tree(out / "shares") == before and lines(out) == 1


def test_a_share_that_lost_a_shape_is_refused_by_name(study, tmp_path):
    out = tmp_path / "out"
    path = study(cases(1))
    torquer.batch.run(str(path), str(out), share="1/1")
    (shape,) = (out / "shares/1-of-1/shapes").iterdir()
    shape.unlink()
    said = f"{shape}: No such file or directory; remove its line from {out}/shares/1-of-1/readings.jsonl, and run that share again"
    with pytest.raises(torquer.Error, match=said):
        torquer.batch.gather(str(path), str(out))
    assert lines(out) == 0


def test_a_gathering_that_is_killed_is_taken_up_again(study, tmp_path):
    path = study(cases(100))
    out = tmp_path / "out"
    torquer.batch.run(str(path), str(out), share="1/1")
    process = start(path, out, "--gather")
    wait_for(process, out, 15)
    process.kill()
    process.communicate()
    stored = lines(out)
    assert stored < 100
    status, output, error = finish(path, out, "--gather")
    assert status == 0, error
    assert output.startswith(f"{100 - stored} cases gathered, {stored} were stored before, 0 missing")
    check_whole(out, 100)


def test_a_share_is_read_from_text_or_from_slurm():
    assert read_share("3/64").folder == "3-of-64"
    keys = [str(k) for k in range(10)]
    for count in (1, 3, 12):
        parts = [read_share(f"{k}/{count}").of(keys) for k in range(1, count + 1)]
        assert sorted(key for part in parts for key in part) == keys
    for text in ("0/2", "3/2", "1", "1/0", "a/b", "-1/2", "1/2/3", "1/99999999", " 1/2"):
        with pytest.raises(torquer.Error, match=f"share {text}: give its number and their number"):
            read_share(text)
    assert slurm_share({}) is None
    assert slurm_share(array(0)) == "1/3"
    assert slurm_share(array(9, 5, 13, 4, 3)) == "2/3"
    for bad in (array(1, 1, 7, 1, 3), array(8, 5, 13, 4, 3), array(17, 5, 13, 4, 3), array(1, step=0), array("x"), {"SLURM_ARRAY_TASK_ID": "1"}):
        with pytest.raises(torquer.Error, match="SLURM_ARRAY_TASK_ID=.*; give this task's share by --share"):
            slurm_share(bad)


def test_command_line(study, tmp_path):
    out, path = tmp_path / "out", study(cases(1))
    status, _, error = finish(path, out, "--share", "2")
    assert status == 2 and "share 2: give its number" in error
    status, _, error = finish(path, out, "--share", "1/2", "--gather")
    assert status == 2 and "exclude each other" in error
    status, _, error = finish(path, out, **array(1, 1, 7, 1, 3))
    assert status == 2 and "not one range of numbers with a fixed step" in error
    assert not out.exists()
    # --share replaces the share of the job array. A share may be empty.
    status, output, error = finish(path, out, "--share", "2/2", **array(1, 1, 7, 1, 3))
    assert status == 0 and output.startswith("0 cases done"), error


class FailingOs:
    """The module os with one step that fails on a full disk, or at which the process ends."""

    def __init__(self, at, killed):
        self._left = at
        self._killed = killed

    def step(self, before=lambda: None):
        self._left -= 1
        if self._left == 0:
            before()
            if self._killed:
                os._exit(9)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def __getattr__(self, name):
        def call(*arguments, **options):
            if name in ("fsync", "mkdir", "rename", "unlink") or (name == "open" and arguments[1] & os.O_CREAT):
                self.step()
            return getattr(os, name)(*arguments, **options)

        return call if callable(getattr(os, name)) else getattr(os, name)

    def fdopen(self, descriptor, mode):
        if "+" not in mode:
            return os.fdopen(descriptor, mode)
        outer = self

        class File(io.BufferedRandom):
            def write(self, data):
                outer.step(lambda: (super(File, self).write(data[: len(data) // 2]), self.flush()))
                return super().write(data)

        return File(io.FileIO(descriptor, "r+"))


def gathers_with_a_fault(path, out, at, killed):
    """Exit status of a process that gathers: 0 without a fault, 1 after a message, 9 after a kill."""
    child = os.fork()
    if child == 0:
        try:
            torquer._batch_store.os = FailingOs(at, killed)
            torquer.batch.gather(str(path), str(out))
            os._exit(0)
        except torquer.Error as error:
            os._exit(1 if f"{out}: No space left on device" in str(error) else 2)
        finally:
            os._exit(3)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("killed", [False, True])
def test_a_fault_at_any_step_of_a_gathering_loses_nothing(study, tmp_path, monkeypatch, killed):
    monkeypatch.setattr(torquer._batch_report, "page", lambda *_: "page")
    path = study(cases(2))
    shares, out = tmp_path / "shares", tmp_path / "out"
    for share in ("1/2", "2/2"):
        torquer.batch.run(str(path), str(shares), share=share)
    expected = {**records(shares / "shares/1-of-2"), **records(shares / "shares/2-of-2")}
    status, at = None, 0
    while status != 0:
        at += 1
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(shares, out)
        status = gathers_with_a_fault(path, out, at, killed)
        assert status in (0, 9 if killed else 1), at
        kept = out / "readings.jsonl"
        whole = [line for line in kept.read_text().splitlines(True) if line.endswith("\n")] if kept.exists() else []
        for key in (json.loads(line)["key"] for line in whole):
            assert zarr.open(str(out / "shapes" / f"{key}.zip"), mode="r").attrs["case"] == expected[key]["case"]
        assert torquer.batch.gather(str(path), str(out)).failures == []
        assert records(out) == expected and {file.stem for file in (out / "shapes").iterdir()} == set(expected)
        assert lines(out) == 2 and not [file for file in out.rglob("*.part")]
    assert at > 30
