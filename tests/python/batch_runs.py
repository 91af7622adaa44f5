"""Studies, and runs of torquer-batch, that tests of batches share."""

import collections
import csv
import json
import os
import pathlib
import subprocess
import sys
import time

import numpy as np
import pytest
import torquer
import zarr

PACKAGES = pathlib.Path(torquer.__file__).absolute().parents[1]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(PACKAGES)}
MOTION = """
[[motion]]
name = "push"
duration_s = 1
spread = 0.5
hands.guidewire = { speed_mm_s = 40, turn_rad_s = 1 }
"""


@pytest.fixture
def study(tmp_path):
    def write(text, name="study"):
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        return path

    return write


def cases(count):
    return f'scenes = ["ty_phantom"]\nseeds = {list(range(count))}\n{MOTION}'


def start(study, out, *more, **environment):
    return subprocess.Popen(
        [sys.executable, "-B", "-m", "torquer.batch", str(study), "--out", str(out), *map(str, more)],
        env={**ENVIRONMENT, **environment}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=out.parent,
    )


def finish(study, out, *more, **environment):
    process = start(study, out, *more, **environment)
    output, error = process.communicate(timeout=120)
    return process.returncode, output, error


def lines(out):
    path = out / "readings.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def wait_for(process, out, count):
    """Waits until this many cases are stored while the run continues."""
    for _ in range(30000):
        if lines(out) >= count:
            break
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    assert lines(out) >= count


def check_whole(out, count):
    """Each case is there once, with its shape, and all have the results of single runs."""
    records = [json.loads(line) for line in (out / "readings.jsonl").read_text().splitlines()]
    assert collections.Counter(record["key"] for record in records).most_common(1)[0][1] == 1
    assert len(records) == count
    assert {path.stem for path in (out / "shapes").iterdir()} == {record["key"] for record in records}
    for record in records[:: max(1, count // 20)]:
        case = zarr.open(str(out / "shapes" / f"{record['key']}.zip"), mode="r")
        tip = [record["readings"][f"tip_{axis}_mm"] for axis in "xyz"]
        assert np.array_equal(case["nodes_mm"][-1], tip)
        assert np.array_equal(case["series"][-1][3:6], tip)
    with (out / "readings.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == count
    assert "<svg" in (out / "report.html").read_text()
