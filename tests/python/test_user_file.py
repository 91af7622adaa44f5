"""Deeply nested, too long or special files of a user: a torquer.Error names them, without a traceback."""

import os
import time

import pytest
import torquer
import torquer.batch
import torquer.centerlines
import torquer.export
from batch_runs import MOTION, cases, study
from torquer import _user_file

DEEP = [33, 1_000, 100_000]


@pytest.mark.parametrize("depth", DEEP)
@pytest.mark.parametrize(("opening", "closing"), [("[", "]"), ('{"a":', "}"), ('[{"a":', "}]"), ("[", "")])
def test_json_that_is_nested_deeply(depth, opening, closing):
    with pytest.raises(ValueError, match="flatten it" if closing else None):
        _user_file.load_json(opening * depth + "1" + closing * depth)


def test_json_of_the_largest_allowed_depth():
    assert _user_file.load_json("[" * 32 + "1" + "]" * 32)
    for text in ("NaN", "[Infinity]", "1 2", "1" * 5000, ""):
        with pytest.raises(ValueError):
            _user_file.load_json(text)


def test_text_in_utf_16_is_refused_by_its_name(tmp_path):
    for coding in ("utf-16-le", "utf-16-be"):
        (tmp_path / "t.csv").write_bytes("\ufeffa,b\n".encode(coding))
        with pytest.raises(torquer.Error, match=r"t\.csv: the text is UTF-16; save it as UTF-8"):
            _user_file.read_text(tmp_path / "t.csv")


@pytest.mark.parametrize("depth", DEEP)
@pytest.mark.parametrize(
    ("before", "opening", "after", "closing"),
    [
        ("b = ", "[", "1", "]"), ("b = ", "{a=", "1", "}"), ("b = ", "[{a=", "1", "}]"), ("b = ", "[\n", "1", "]"),
        ("", "a.", "a = 1", ""), ("", "'a' . ", "a = 1", ""), ("[", "a.", "a]", ""), ("b = {", "a.", "a = 1}", ""),
        ("b = ", "[", "", ""),
    ],
)
def test_toml_that_is_nested_deeply(depth, before, opening, after, closing):
    began = time.process_time()
    with pytest.raises(torquer.Error, match=r"^s\.toml:\d+: .*; flatten it$"):
        _user_file.parse_toml("s.toml", f"# [[ \"\n{before}{opening * depth}{after}{closing * depth}\n")
    assert time.process_time() - began < 1


def test_toml_of_the_largest_allowed_depth_and_length():
    parse = _user_file.parse_toml
    deep = "a = " + "[" * 31 + "1" + "]" * 31
    assert parse("", deep) and parse("", ".".join("a" * 32) + " = 1") and parse("", "a" * 4096 + " = 1")
    marks = "[" * 500 + "." * 500
    for text in (f'a = "\\"{marks}"', f"a = '{marks}'", f'a = """\n{marks}"\n\\"""{marks}"""', f"a = '''{marks}'''", f"# {marks}"):
        assert parse("", text) is not None
    for text in ("a" * 4097 + " = 1", "a = " + "1" * 5000, "a = 0x" + "f" * 5000):
        with pytest.raises(torquer.Error, match="s.toml:2: a key or value has more than 4096 bytes; shorten it"):
            parse("s.toml", f"\n{text}")
    for text in ("a = ", "a = 2020-02-30", 'a = "\\ud800"', "a = 1\na = 2"):
        with pytest.raises(torquer.Error, match="^s.toml: "):
            parse("s.toml", text)


@pytest.mark.parametrize(
    ("begin", "piece"),
    [('"""', '\n\\"""'), ("", '"'), ("", "'\n"), ("", '"\\\n'), ('"""', "\\"), ("'''", "\n"), ("", "#'\n")],
)
def test_texts_that_do_not_end_take_no_longer(begin, piece):
    began = time.process_time()
    with pytest.raises(torquer.Error):
        _user_file.parse_toml("s.toml", begin + piece * 100_001 + "=")
    assert time.process_time() - began < 2


def test_a_path_that_is_not_an_ordinary_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    readers = [
        lambda path: torquer.batch.run(path, str(tmp_path / "out")), torquer.read_states, torquer.export.read_states,
        torquer.centerlines.read_vtp,
    ]
    for read in readers:
        for path in (str(tmp_path), str(tmp_path / "pipe"), str(tmp_path / "link"), "/dev/zero", str(tmp_path / "none"), "a\0b"):
            with pytest.raises(torquer.Error, match="cannot be read"):
                read(path)


def test_files_of_states_that_are_nested_deeply(tmp_path):
    path = tmp_path / "states.jsonl"
    path.write_text('{"time_s": ' + "[" * 100_000)
    for read in (torquer.read_states, torquer.export.read_states):
        with pytest.raises(torquer.Error, match=f"^{path}:1: not valid JSON .*flatten it"):
            read(path)
    header = b"[" * 80_000
    path.write_bytes(b"TQSTATES" + (2).to_bytes(4, "little") + len(header).to_bytes(4, "little") + header)
    with pytest.raises(torquer.Error, match="its header does not name fields"):
        torquer.read_states(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"a = {'[' * 1_000}", "study.toml:1: arrays or tables are nested more than 32 deep; flatten it"),
        (f'scenes = ["ty_phantom"]\n{MOTION}\n[axes]\n"{"a." * 500}a" = [1]\n', "axes: a.a.a"),
        (f'scenes = ["ty_phantom"]\n{MOTION}\n[random]\n"{"a." * 500}a" = [0, 1]\n', "random: a.a.a"),
        ('scenes = ["ty_phantom"]\n[[motion]]\nname = "m"\nscript = "pipe"\n', "pipe: cannot be read"),
        ('scenes = ["ty_phantom"]\n[[motion]]\nname = "m"\nscript = "wide.csv"\n', "wide.csv:2: time_s is '1+\\.\\.'; give a finite number"),
    ],
)
def test_a_study_that_is_nested_deeply_or_waits(study, tmp_path, text, said):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "wide.csv").write_text("time_s\n" + "1" * 200_000)
    with pytest.raises(torquer.Error, match=said):
        torquer.batch.run(str(study(text)), str(tmp_path / "out"))


def test_a_record_that_is_nested_deeply(study, tmp_path):
    for name in ("torquer-batch.jsonl", "readings.jsonl"):
        out = tmp_path / name.partition(".")[0]
        torquer.batch.run(str(study(cases(1))), str(out))
        with (out / name).open("a") as file:
            file.write('{"key": ' + "[" * 100_000 + "\n")
        with pytest.raises(torquer.Error, match=f"{name}:\\d: is not a line"):
            torquer.batch.run(str(study(cases(1))), str(out))
