"""Standard streams of the commands that are closed, full, limited or without a reader. There is no traceback, and the
exit status is true."""

import os
import resource
import subprocess
import sys

import pytest
from batch_runs import ENVIRONMENT, cases, check_whole, study

COMMANDS = {"torquer": "torquer", "torquer-batch": "torquer.batch", "torquer-identify": "torquer.identify", "torquer-import": "torquer.importer", "torquer-trainees": "torquer.trainees", "torquer-validate": "torquer.validate"}
FULL = os.open("/dev/full", os.O_WRONLY | os.O_CLOEXEC)


def without_reader():
    reader, writer = os.pipe()
    os.close(reader)
    return writer


def run(command, *words, closed=(), limited=False, **streams):
    """Status and standard error of a command; streams not named are pipes. closed: numbers of streams."""

    def prepare():
        if limited:
            resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
        for number in closed:
            os.close(number)

    done = subprocess.run(
        [sys.executable, "-B", "-m", COMMANDS[command], *map(str, words)], env=ENVIRONMENT, preexec_fn=prepare, timeout=60,
        **{"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams},
    )
    return done.returncode, (done.stdout or b"").decode(), (done.stderr or b"").decode()


BAD = ["full", "no reader", "closed", "limited", "read only"]
# One way of writing serves all commands: the first has every kind of bad stream, the others have one.
COMMANDS_AND_BAD = [(command, bad) for command in COMMANDS for bad in (BAD if command == "torquer" else ["full"])]


def streams(bad, stream, number, tmp_path):
    """Setup that makes stream number `stream` of a run unwritable."""
    if bad == "closed":
        return {"closed": (number,)}
    if bad == "limited":
        return {"limited": True, stream: (tmp_path / "out").open("wb")}
    if bad == "read only":
        return {stream: open(os.devnull, "rb")}
    return {stream: FULL if bad == "full" else without_reader()}


def test_an_interrupt_within_eval_ends_with_the_status_of_an_interrupt(tmp_path):
    # Imports call eval(). Python notes an interrupt there, and would end itself by the signal in spite of its handler.
    (tmp_path / "interrupted.py").write_text("""
import os, signal, sys
from torquer import _command
sys.exit(_command.run("torquer", lambda: eval("os.kill(os.getpid(), signal.SIGINT) or [k for k in range(9999)]")))
""")
    words = [sys.executable, "-B", "-m", "interrupted"]
    done = subprocess.run(words, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (130, "\ntorquer: stopped\n")


@pytest.mark.parametrize("command, bad", COMMANDS_AND_BAD)
def test_failed_output_is_reported(command, bad, tmp_path):
    status, _, error = run(command, "--help", **streams(bad, "stdout", 1, tmp_path))
    assert status == 2
    assert error == f"{command}: standard output cannot be written; is the disk full, or its reader gone?\n"


@pytest.mark.parametrize("command, bad", COMMANDS_AND_BAD)
def test_lost_messages_have_no_effect(command, bad, tmp_path):
    status, output, _ = run(command, "--help", **streams(bad, "stderr", 2, tmp_path))
    assert status == 0 and output.startswith(f"usage: {command}")
    # No part of a message goes to another stream.
    words = ["convert", "none", "out.csv"] if command == "torquer" else ["none.toml"]
    assert run(command, *words, **streams(bad, "stderr", 2, tmp_path))[:2] == (2, "")
    assert run(command, "--no-such-option", **streams(bad, "stderr", 2, tmp_path))[:2] == (2, "")


@pytest.mark.parametrize("bad", [bad for bad in BAD if bad != "limited"])  # a limit holds for the result too
def test_a_result_whose_message_cannot_be_written_is_whole(tmp_path, bad):
    states = tmp_path / "states.jsonl"
    states.write_text('{"time_s": 1, "nodes_mm": [[0, 0, 0], [1, 0, 0]]}\n')
    status, _, error = run("torquer", "convert", states, tmp_path / "wire.csv", **streams(bad, "stdout", 1, tmp_path))
    assert status == 2 and "standard output cannot be written" in error and "Traceback" not in error
    assert (tmp_path / "wire.csv").read_text().count("\n") == 3


@pytest.mark.parametrize("command", COMMANDS)
def test_all_streams_closed(command):
    assert run(command, "--help", closed=(0, 1, 2))[0] == 2
    assert run(command, "none", closed=(0, 1, 2))[0] == 2


def test_an_undecodable_name_is_shown_by_escapes(tmp_path):
    states = tmp_path / "states.jsonl"
    states.write_text('{"time_s": 1, "nodes_mm": [[0, 0, 0]]}\n')
    target = os.fsdecode(os.fsencode(tmp_path) + b"/\xff.csv")
    status, output, error = run("torquer", "convert", states, target)
    assert (status, error) == (0, "") and "\\udcff.csv: 1 states" in output


@pytest.mark.parametrize("workers", [[], ["--workers", "1"]])
def test_a_batch_with_all_streams_closed_is_stored(study, tmp_path, workers):
    out = tmp_path / "out"
    assert run("torquer-batch", study(cases(2)), "--out", out, *workers, closed=(0, 1, 2))[0] == 2
    check_whole(out, 2)
