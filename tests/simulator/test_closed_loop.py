"""torquer-simulator in exchange with a program: rows in, states out; and the layout of its binary states.

TORQUER_SIMULATOR is the program."""

import fcntl
import json
import os
import pathlib
import resource
import select
import signal
import struct
import subprocess
import termios
import time

import pytest

SIMULATOR = os.environ["TORQUER_SIMULATOR"]
SCENE = str(pathlib.Path(__file__).parents[2] / "host/scenes/ty_phantom.toml")
HEADER = "time_s,guidewire.insertion_mm,guidewire.rotation_rad\n"
ROWS = [f"{0.1 * k:.1f},{2 * k},{0.1 * k:.1f}\n" for k in range(8)]


def command(*words):
    return [SIMULATOR, "--scene", SCENE, *map(str, words)]


class Loop:
    """A program that answers."""

    def __init__(self, *words):
        self.process = subprocess.Popen(
            command("--script", "-", "--states", "-", *words),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )

    def send(self, text):
        self.process.stdin.write(text.encode())
        self.process.stdin.flush()

    def answer(self):
        ready, _, _ = select.select([self.process.stdout], [], [], 120)
        assert ready, "no answer"
        return json.loads(self.process.stdout.readline())

    def end(self):
        """Exit status and message after the end of its input."""
        out, err = self.process.communicate(timeout=120)
        assert out == b""
        return self.process.returncode, err.decode()


def run_file(folder, name, *words, script=None):
    path = folder / "script.csv"
    path.write_text(script or HEADER + "".join(ROWS))
    subprocess.run(command("--script", path, "--states", folder / name, *words), check=True, capture_output=True)
    return folder / name


def without_time(states):
    return [{name: value for name, value in state.items() if name != "solve_us"} for state in states]


def test_each_row_is_answered_before_the_next_is_sent(tmp_path):
    loop = Loop()
    loop.send(HEADER)
    answers = []
    for row in ROWS:
        loop.send(row)
        answers.append(loop.answer())
    assert loop.end()[0] == 0
    states = run_file(tmp_path, "states").read_text().splitlines()
    assert without_time(answers) == without_time(map(json.loads, states))


def test_rows_come_in_pieces_and_the_last_without_an_end():
    loop = Loop("--fields", "time_s,guidewire.insertion_mm")
    loop.send("# by hand\n" + HEADER[:7])
    loop.send(HEADER[7:] + ROWS[0] + ROWS[1][:3])
    assert loop.answer()["time_s"] == 0
    assert not select.select([loop.process.stdout], [], [], 0.3)[0]
    loop.send(ROWS[1][3:] + "\n" + ROWS[2].rstrip("\n"))
    assert loop.answer() == {"time_s": 0.1, "guidewire.insertion_mm": loop_start() + 2}
    out, err = loop.process.communicate(timeout=120)
    assert loop.process.returncode == 0, err
    assert json.loads(out)["time_s"] == 0.2


def loop_start():
    loop = Loop("--fields", "guidewire.insertion_mm")
    loop.send(HEADER + ROWS[0])
    start = loop.answer()["guidewire.insertion_mm"]
    assert loop.end()[0] == 0
    return start


@pytest.mark.parametrize(
    "rows, answers, said",
    [
        ("", 0, "standard input:1: empty; the first line must name the columns"),
        ("time,xray\n", 0, "standard input:1: there is no column time_s"),
        ("time_s,guidwire.insertion_mm\n", 0, "did you mean guidewire.insertion_mm?"),
        (HEADER + "0,0,0\n0.1,abc,0\n", 1, "standard input:3: guidewire.insertion_mm is 'abc'; give a finite"),
        (HEADER + "0,0,0\n# no row\n0.1,1\n", 1, "standard input:4: the row has 2 values, but the header"),
        (HEADER + "0,0,0\n0,1,0\n", 1, "standard input:3: time_s is '0', not later than the previous row"),
        (HEADER + "0,0," + "0" * 1_100_000, 0, "a line has more than 1000000 bytes"),
    ],
    ids=["empty", "no-time", "column", "number", "short", "time", "long"],
)
def test_a_bad_row_is_refused_after_the_answers_before_it(rows, answers, said):
    done = subprocess.run(
        command("--script", "-", "--states", "-"), input=rows, text=True, capture_output=True, timeout=120
    )
    assert done.returncode == 2
    assert len(done.stdout.splitlines()) == answers
    assert said in done.stderr


def test_a_clamped_row_is_reported_once():
    rows = HEADER + "0,0,0\n10,9000,0\n20,9100,0\n"
    done = subprocess.run(
        command("--script", "-", "--states", "-", "--fields", "time_s"),
        input=rows, text=True, capture_output=True, timeout=300,
    )
    assert done.returncode == 0
    assert done.stderr.count("is clamped to its max_length_mm") == 1


def test_a_closed_reader_ends_it_with_a_message():
    loop = Loop()
    loop.send(HEADER + ROWS[0])
    loop.answer()
    loop.process.stdout.close()
    # The program notices it while it waits for a row.
    assert loop.process.wait(timeout=60) == 1
    message = loop.process.stderr.read().decode()
    assert "the reader of standard output has closed it; 1 of 1 rows are done" in message
    loop.process.stdin.close()
    loop.process.stderr.close()


def test_a_reader_that_closes_between_rows():
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        command("--script", "-", "--states", "-"), input=(HEADER + "".join(ROWS)).encode(),
        stdout=writing, stderr=subprocess.PIPE, timeout=120,
    )
    # Before the header has arrived, the program notices it while it waits for the header.
    waiting = subprocess.Popen(
        command("--script", "-", "--states", "-"), stdin=subprocess.PIPE, stdout=writing, stderr=subprocess.PIPE
    )
    os.close(writing)
    assert done.returncode == 1
    assert b"the reader of standard output has closed it; 0 of " in done.stderr
    assert waiting.wait(timeout=60) == 1
    assert b"the reader of standard output has closed it; 0 of 0 rows" in waiting.stderr.read()
    waiting.stdin.close()
    waiting.stderr.close()


def test_a_full_disk_behind_standard_output():
    if not os.path.exists("/dev/full"):
        pytest.skip("there is no /dev/full")
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            command("--script", "-", "--states", "-"), input=(HEADER + ROWS[0]).encode(), stdout=full,
            stderr=subprocess.PIPE, timeout=120,
        )
    assert done.returncode == 2
    assert b"standard output: cannot be written: No space left" in done.stderr


def test_a_slow_reader_of_a_pipe_that_does_not_wait():
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETFL, os.O_NONBLOCK)
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)
    process = subprocess.Popen(command("--script", "-", "--states", "-"), stdin=subprocess.PIPE, stdout=writing)
    os.close(writing)
    process.stdin.write((HEADER + "".join(ROWS)).encode())
    process.stdin.close()
    # By now the pipe is full.
    time.sleep(0.5)
    with os.fdopen(reading) as answers:
        assert len([json.loads(line) for line in answers]) == len(ROWS)
    assert process.wait(timeout=60) == 0


def test_a_signal_ends_the_wait_for_a_row():
    loop = Loop()
    loop.send(HEADER + ROWS[0])
    loop.answer()
    loop.process.send_signal(signal.SIGTERM)
    # Its input is still open.
    assert loop.process.wait(timeout=60) == 1
    status, message = loop.end()
    assert "asked to stop; 1 of 1 rows are done and written" in message


@pytest.mark.parametrize("waits", [True, False])
def test_a_signal_ends_the_wait_for_a_reader(tmp_path, waits):
    (tmp_path / "script.csv").write_text(HEADER + "".join(f"{k},{k % 7},0\n" for k in range(3000)))
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)
    if not waits:
        fcntl.fcntl(writing, fcntl.F_SETFL, os.O_NONBLOCK)
    process = subprocess.Popen(
        command("--script", tmp_path / "script.csv", "--states", "-"), stdout=writing, stderr=subprocess.PIPE
    )
    os.close(writing)
    # The pipe is full when it holds something that grows no more.
    before, held = b"", bytearray(4)
    for _ in range(240):
        fcntl.ioctl(reading, termios.FIONREAD, held)
        if any(held) and held == before:
            break
        before = bytes(held)
        time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=120)
    os.close(reading)
    assert process.returncode == 1 and b"asked to stop" in error, error


def test_rows_from_standard_input_into_a_file_and_a_record(tmp_path):
    words = ("--script", "-", "--states", tmp_path / "states")
    text = HEADER + "".join(ROWS)
    subprocess.run(command(*words), input=text, text=True, check=True, capture_output=True)
    assert len((tmp_path / "states").read_text().splitlines()) == len(ROWS)
    (tmp_path / "states").unlink()
    done = subprocess.run(command(*words), input=text + "x\n", text=True, capture_output=True)
    assert done.returncode == 2 and not list(tmp_path.iterdir())


def test_fields(tmp_path):
    all_fields = [json.loads(line) for line in run_file(tmp_path, "all").read_text().splitlines()]
    some = run_file(tmp_path, "some", "--fields", "time_s,state_hash,nodes_mm").read_text().splitlines()
    wanted = ["nodes_mm", "state_hash", "time_s"]
    assert [json.loads(line) for line in some] == [{name: row[name] for name in wanted} for row in all_fields]
    for names, said in [
        ("time_s,energy", "has no field 'energy'; did you mean energy_mJ? there are: "),
        ("time_s,time_s", "time_s is given twice"),
        ("time_s,", "has no field ''"),
    ]:
        done = subprocess.run(
            command("--script", tmp_path / "script.csv", "--states", tmp_path / "no", "--fields", names),
            capture_output=True, text=True,
        )
        assert done.returncode == 2 and said in done.stderr
        assert not (tmp_path / "no").exists()
    done = subprocess.run(command("--fields", "time_s"), capture_output=True, text=True)
    assert done.returncode == 2 and "--fields needs --states" in done.stderr


def decode(data):
    """Binary states in the layout of host/simulator/README.md."""
    assert data[:8] == b"TQSTATES"
    version, size = struct.unpack("<II", data[8:16])
    assert version == 2 and size % 8 == 0
    fields = json.loads(data[16 : 16 + size])["fields"]
    at, rows = 16 + size, []
    while at < len(data):
        nodes = {}
        for field in fields:
            if field["shape"]:
                (nodes[field["name"]],) = struct.unpack_from("<Q", data, at)
                at += 8
        row = {}
        for field in sorted(fields, key=lambda field: field["shape"] != []):
            code = {"f8": "d", "i8": "q", "u8": "Q"}[field["type"]]
            count = 1
            for size in field["shape"]:
                count *= nodes[field["name"]] if size == "nodes" else size
            row[field["name"]] = struct.unpack_from(f"<{count}{code}", data, at)
            at += 8 * count
        rows.append(row)
    return fields, rows


def test_binary_states_hold_what_json_does(tmp_path):
    text = pathlib.Path(SCENE).read_text() + "\n[effects.internal_forces]\n"
    scene = tmp_path / "forces.toml"
    scene.write_text(text)
    (tmp_path / "script.csv").write_text(HEADER + "".join(ROWS))
    for name in ("states.jsonl", "states.bin"):
        subprocess.run(
            [SIMULATOR, "--scene", scene, "--script", tmp_path / "script.csv", "--states", tmp_path / name],
            check=True, capture_output=True,
        )
    lines = [json.loads(line) for line in (tmp_path / "states.jsonl").read_text().splitlines()]
    fields, rows = decode((tmp_path / "states.bin").read_bytes())
    assert [field["name"] for field in fields] == sorted(lines[0])
    assert len(rows) == len(lines) == len(ROWS)
    units = {field["name"]: field["unit"] for field in fields}
    assert units["line_load_mN_mm"] == "mN/mm" and units["bending_mN_mm"] == "mN mm"
    assert units["nodes_mm"] == "mm" and units["status"] == "1" and units["time_s"] == "s"
    for line, row in zip(lines, rows):
        for name, value in line.items():
            if name == "solve_us":
                continue
            values = [value]
            while isinstance(values[0], list):
                values = sum(values, [])
            if name == "state_hash":
                values = [int(value)]
            if value is None:
                assert row[name][0] != row[name][0]
            else:
                assert list(row[name]) == values, name


def test_whole_rows_of_binary_states_are_kept_where_the_disk_fails(tmp_path):
    (tmp_path / "script.csv").write_text(HEADER + "".join(f"{k},{k % 7},0\n" for k in range(2000)))
    done = subprocess.run(
        command("--script", tmp_path / "script.csv", "--states", tmp_path / "states.bin"), capture_output=True,
        text=True, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000)),
    )
    assert done.returncode == 2 and "states.bin.partial" in done.stderr
    assert not (tmp_path / "states.bin").exists()
    data = (tmp_path / "states.bin.partial").read_bytes()
    _, rows = decode(data)
    assert len(data) > 100_000 and [row["time_s"][0] for row in rows] == list(range(len(rows)))
