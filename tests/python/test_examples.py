"""The examples with pictures run, print their results and draw them."""

import importlib
import os
import pathlib
import re
import struct
import subprocess
import sys

import pytest
import torquer

PACKAGES = pathlib.Path(torquer.__file__).absolute().parents[1]
EXAMPLES = pathlib.Path(torquer.__file__).parent / "examples"
SCRIPTS = sorted(path.stem for path in EXAMPLES.glob("[a-z]*.py"))


def run(name, folder, *more):
    """The lines that an example prints; its picture is a PNG of some size with more than one color."""
    picture = folder / f"{name}.png"
    done = subprocess.run(
        [sys.executable, "-B", "-m", f"torquer.examples.{name}", str(picture), *more],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(PACKAGES), "MPLBACKEND": "Agg", "MPLCONFIGDIR": str(folder)},
        capture_output=True, text=True, timeout=120, check=False,
    )
    assert done.returncode == 0, done.stderr
    data = picture.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    assert width >= 800 and height >= 400 and len(data) > 20_000
    lines = done.stdout.splitlines()
    assert lines[-1] == f"picture: {picture}"
    return lines


def numbers(lines, pattern):
    found = [match for line in lines if (match := re.search(pattern, line))]
    return [tuple(float(value) for value in match.groups()) for match in found]


def test_a_hand_pushes_harder_against_more_friction(tmp_path):
    found = numbers(run("friction_sweep", tmp_path), r"coefficient +([\d.]+): +([\d.]+) mN at the end")
    assert [coefficient for coefficient, _ in found] == [0, 0.05, 0.1, 0.2]
    forces = [force for _, force in found]
    assert forces == sorted(forces) and forces[-1] > 2 * forces[0] > 0


def test_a_tip_is_farther_behind_with_more_friction(tmp_path):
    found = numbers(run("torque_lag", tmp_path), r"the tip is +(-?\d+) degrees behind at the end, +(-?\d+) at most")
    assert len(found) == 3
    lags = [most for _, most in found]
    assert lags == sorted(lags) and lags[0] < lags[-1]
    # Without friction, whole turns of the hand are whole turns of the tip.
    assert abs(found[0][0]) <= 1


def test_finer_segments_come_nearer(tmp_path):
    lines = run("accuracy_against_time", tmp_path)
    found = numbers(lines, r"segments of ([\d.]+) mm: +[\d.]+ ms for each mm, mean distance +([\d.]+) um")
    assert len(found) == 6
    errors = [error for _, error in found]
    assert errors[0] > 5 * errors[-1]
    assert errors == sorted(errors, reverse=True)


def test_a_surface_of_a_users_own(tmp_path):
    found = numbers(run("own_surface", tmp_path), r"(\d+) mm in: tip at .* mm, (\d+) um into the wall")
    assert [mm for mm, _ in found] == [50, 100, 150]
    assert max(depth for _, depth in found) < 200


def test_a_policy_takes_its_first_update(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    example = importlib.import_module("torquer.examples.train_ppo")
    monkeypatch.setattr(example, "HELD_OUT", 2)
    picture = tmp_path / "curve.png"
    example.main(str(picture), 1)
    lines = capsys.readouterr().out.splitlines()
    assert numbers(lines, r"(\d+) steps: ") == [(16 * 128,)]
    assert len(numbers(lines, r"(\d+) of 2 reach the target, (\d+) safely; (\d+) mN at most")) == 4
    assert picture.read_bytes()[:4] == b"\x89PNG"


@pytest.mark.skipif("TORQUER_SOAK" not in os.environ, reason="teaching takes a minute: tests/run --soak")
def test_a_policy_is_taught(tmp_path):
    lines = run("train_ppo", tmp_path, "10")
    steps, rate, episodes, safely = numbers(
        lines, r"(\d+) steps: +(\d+) % of (\d+) episodes reach the target, +(\d+) % safely"
    )[-1]
    # Wires that are only pushed reach the target in a third of the episodes.
    assert steps == 10 * 16 * 128 and episodes >= 10 and rate >= 50 and safely <= rate
    found = numbers(lines, r"(\d+) of 30 reach the target, (\d+) safely; (\d+) mN at most")
    learned, pushed = found[:2], found[2:]
    assert len(learned) == len(pushed) == 2
    assert min(reached for reached, _, _ in learned) > max(reached for reached, _, _ in pushed)
    assert all(safe <= reached and 0 < force_mN < 200 for reached, safe, force_mN in found)


@pytest.mark.parametrize("name", SCRIPTS)
def test_examples_can_be_imported_and_document_their_use(name, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    example = importlib.import_module(f"torquer.examples.{name}")
    assert callable(example.main)
    assert f"torquer.examples.{name}" in example.__doc__ or f"torquer/examples/{name}.py" in example.__doc__
    # No action has run yet.
    assert capsys.readouterr().out == "" and not any(path.suffix == ".png" for path in tmp_path.iterdir())
