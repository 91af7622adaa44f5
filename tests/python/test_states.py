"""torquer.read_states reads the files of the program and refuses damaged ones."""

import json
import pathlib
import random
import re
import struct
import subprocess
import sys

import numpy as np
import pytest
import torquer
import torquer.export

SIMULATOR = pathlib.Path(torquer.__file__).absolute().parents[3] / "bin/torquer-simulator"


def run_both(folder, scene):
    (folder / "s.csv").write_text(
        "time_s,guidewire.insertion_mm\n" + "".join(f"{0.1 * k:.1f},{3 * k}\n" for k in range(6))
    )
    for name in ("states.bin", "states.jsonl"):
        subprocess.run(
            [SIMULATOR, "--scene", scene, "--script", folder / "s.csv", "--states", folder / name],
            check=True, capture_output=True,
        )
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return run_both(tmp_path_factory.mktemp("states"), torquer.scene_path("ty_phantom"))


# Two curves, whose numbers of nodes differ.
ROOM = """
[[instrument]]
name = "catheter"
max_length_mm = 200
inserted_at_start_mm = 60
radius_mm = 1
inner_radius_mm = 0.6
rigidity_N_mm2 = [40]
from_tip_mm = [0]

[effects.clearance]
[effects.internal_forces]
"""


@pytest.mark.parametrize("scene", ["ty_phantom", "room"])
def test_both_formats_give_the_same_arrays(tmp_path, scene):
    path = torquer.scene_path("ty_phantom")
    if scene == "room":
        path = tmp_path / "room.toml"
        path.write_text(pathlib.Path(torquer.scene_path("ty_phantom")).read_text() + ROOM)
    folder = run_both(tmp_path, path)
    binary = torquer.read_states(folder / "states.bin")
    text = torquer.read_states(folder / "states.jsonl")
    lines = [json.loads(line) for line in (folder / "states.jsonl").read_text().splitlines()]
    assert binary.rows == text.rows == 6
    assert set(binary) == set(text) == set(lines[0])
    for name in binary:
        if name == "solve_us":
            continue
        if isinstance(binary[name], list):
            assert all(np.array_equal(a, b) for a, b in zip(binary[name], text[name]))
            assert [a.tolist() for a in binary[name]] == [line[name] for line in lines]
        else:
            assert binary[name].dtype == text[name].dtype and binary[name].shape == (6,)
            assert np.array_equal(binary[name], text[name], equal_nan=binary[name].dtype.kind == "f")
    assert binary["state_hash"].dtype == np.uint64
    assert [str(value) for value in binary["state_hash"]] == [line["state_hash"] for line in lines]
    assert binary["time_s"].tolist() == [0.1 * k if k != 3 else 0.3 for k in range(6)]
    assert binary.units["energy_mJ"] == "mJ" and text.units == binary.units
    if scene == "room":
        assert len(binary["guidewire.nodes_mm"][0]) != len(binary["catheter.nodes_mm"][0])
    # The inserted length grows from row to row.
    nodes_mm = binary["guidewire.nodes_mm" if scene == "room" else "nodes_mm"]
    assert len(nodes_mm[5]) > len(nodes_mm[0])
    with pytest.raises(KeyError, match="no field 'energy'.*energy_mJ"):
        binary["energy"]


def test_binary_states_are_exported_as_others_are(folder, tmp_path):
    for name in ("states.bin", "states.jsonl"):
        subprocess.run(
            [sys.executable, "-m", "torquer", "convert", folder / name, tmp_path / f"{name}.csv"], check=True
        )
    assert (tmp_path / "states.bin.csv").read_text() == (tmp_path / "states.jsonl.csv").read_text()
    few = tmp_path / "few.bin"
    subprocess.run(
        [SIMULATOR, "--scene", torquer.scene_path("ty_phantom"), "--script", folder / "s.csv",
         "--states", few, "--fields", "time_s"],
        check=True, capture_output=True,
    )
    assert list(torquer.read_states(few)) == ["time_s"]
    with pytest.raises(torquer.Error, match="nodes_mm is missing; name it in torquer-simulator --fields"):
        torquer.export.read_states(few)


def test_a_file_that_is_cut_is_refused_where_it_ends(folder, tmp_path):
    data = (folder / "states.bin").read_bytes()
    path = tmp_path / "cut.bin"
    path.write_bytes(data[:-1])
    with pytest.raises(torquer.Error, match=r"cut.bin: row 6 ends after \d+ of \d+ bytes"):
        torquer.read_states(path)
    path.write_bytes(data[:12])
    with pytest.raises(torquer.Error, match="12 bytes, no header"):
        torquer.read_states(path)
    path.write_bytes(data[:8] + struct.pack("<I", 1) + data[12:])
    with pytest.raises(torquer.Error, match="version 1; this Torquer reads version 2"):
        torquer.read_states(path)
    header = b'{"fields": []}  '
    path.write_bytes(data[:12] + struct.pack("<I", len(header)) + header + bytes(64))
    with pytest.raises(torquer.Error, match="does not name fields"):
        torquer.read_states(path)
    with pytest.raises(torquer.Error, match="cannot be read"):
        torquer.read_states(tmp_path / "none")
    lines = (folder / "states.jsonl").read_text()
    path.write_text(lines[:-10])
    with pytest.raises(torquer.Error, match="cut.bin:6: not valid JSON"):
        torquer.read_states(path)
    path.write_text(lines + '{"time_s": 1}\n')
    with pytest.raises(torquer.Error, match="cut.bin:7: not an object with the fields"):
        torquer.read_states(path)
    path.write_text('{"a": 1}\n{"a": [1]}\n')
    with pytest.raises(torquer.Error, match="field a does not hold the same kind"):
        torquer.read_states(path)


def test_any_bytes_are_read_or_refused(folder, tmp_path):
    data = (folder / "states.bin").read_bytes()
    size = 16 + struct.unpack_from("<I", data, 12)[0]
    draw = random.Random(1)
    path = tmp_path / "any.bin"
    refused = 0
    for k in range(600):
        mutant = bytearray(data)
        # Half of the changes affect the header that describes the rest.
        for _ in range(draw.randint(1, 3)):
            at = draw.randrange(8, size + 8) if k % 2 else draw.randrange(8, len(data))
            mutant[at] = draw.choice([0, 255, draw.randrange(256), mutant[at] ^ 1])
        path.write_bytes(mutant)
        try:
            torquer.read_states(path)
        except torquer.Error:
            refused += 1
    assert 50 < refused < 550


def old_binary(values):
    """A file of these fields, with one number a row each."""
    header = json.dumps({"fields": [{"name": name, "unit": "s", "type": "f8", "shape": []} for name in values]}).encode()
    header += b" " * (-len(header) % 8)
    rows = b"".join(struct.pack(f"<{len(row)}d", *row) for row in zip(*values.values()))
    return torquer.states.MAGIC + struct.pack("<II", 2, len(header)) + header + rows


def test_times_that_earlier_builds_wrote_as_minus_one_are_not_known(folder, tmp_path):
    # Times of events are null in today's files until the event has happened.
    today = (folder / "states.jsonl").read_text()
    times = {name for name in re.findall(r'"(\w+_s)":null', today) if not name.endswith("_mm_s")}
    assert {"target_reached_s", "wall_force_event_s"} <= times
    (tmp_path / "old.jsonl").write_text(re.sub(rf'("({"|".join(times)})"):null', r"\1:-1.0", today))
    old = torquer.read_states(tmp_path / "old.jsonl")
    for name in times:
        assert np.array_equal(old[name], torquer.read_states(folder / "states.jsonl")[name], equal_nan=True), name
        assert np.isnan(old[name]).any()

    values = {name: [-1.0, -1.0, 0.5] for name in sorted(times)} | {"time_s": [-1.0, 0.0, 1.0]}
    (tmp_path / "old.bin").write_bytes(old_binary(values))
    old = torquer.read_states(tmp_path / "old.bin")
    assert old["time_s"].tolist() == [-1, 0, 1]
    for name in times:
        assert np.array_equal(old[name], [np.nan, np.nan, 0.5], equal_nan=True), name
