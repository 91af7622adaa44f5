"""Folders of results: existing files of a user stay unchanged, and no link is followed."""

import os
import shutil

import pytest
import torquer
import torquer.batch
from batch_runs import cases, study

# Files of a user, by name; "->" marks a link.
FOREIGN = {
    "an own file": {"shapes/mine.zip": b"mine", "shapes/mine.part": b"mine"},
    "an own table": {"readings.csv": b"mine"},
    "results before the mark": {"readings.jsonl": b"", "lock": b""},
    "a linked lock": {"lock": "->"},
    "a linked shapes": {"shapes": "->"},
    "a linked readings.jsonl": {"readings.jsonl": "->"},
    "linked shares": {"shares": "->", "mine": b"mine"},
}
CHANGED = {
    **{f"another {name}": {name: b"mine"} for name in ("readings.csv", "failures.jsonl", "report.html")},
    **{f"a linked {name}": {name: "->"} for name in (
        "readings.csv", "failures.jsonl", "report.html", "readings.jsonl", "torquer-batch.jsonl", "shapes", ".torquer-batch.part",
        "shapes/.torquer-batch.part",
    )},
    "a pipe": {"report.html": "pipe"},
}


def put(out, target, files):
    for name, content in files.items():
        path = out / name
        path.parent.mkdir(exist_ok=True)
        if path.is_dir():
            path.rename(out.parent / f"moved-{path.name}")
        else:
            path.unlink(missing_ok=True)
        if content == "->":
            path.symlink_to(target / "folder" if name in ("shapes", "shares") else target / "file")
        elif content == "pipe":
            os.mkfifo(path)
        else:
            path.write_bytes(content)


def tree(folder):
    """All entries of a folder, with their contents or link targets."""
    found = {}
    for path in folder.rglob("*"):
        plain = path.is_file() and not path.is_symlink()
        found[path] = path.read_bytes() if plain else os.readlink(path) if path.is_symlink() else path.lstat().st_mode
    return found


@pytest.fixture
def target(tmp_path):
    """A folder and a file that links point to."""
    folder = tmp_path / "target"
    (folder / "folder").mkdir(parents=True)
    (folder / "folder" / "mine.zip").write_bytes(b"mine")
    (folder / "file").write_bytes(b"mine, without an end of line")
    return folder


@pytest.mark.parametrize("what", FOREIGN)
def test_a_folder_of_the_user_is_refused_and_stays_unchanged(study, tmp_path, target, what):
    out = tmp_path / "out"
    out.mkdir()
    put(out, target, FOREIGN[what])
    before = tree(tmp_path)
    path = study(cases(1))
    before[path] = path.read_bytes()
    for share in (None, "1/2"):
        with pytest.raises(torquer.Error, match="no mark of torquer-batch") as refused:
            torquer.batch.run(str(path), str(out), share=share)
        assert str(out) in str(refused.value)
        assert tree(tmp_path) == before


@pytest.mark.parametrize("what", ["shares", "shares/1-of-2"])
def test_linked_shares_are_refused_and_stay_unchanged(study, tmp_path, target, what):
    out = tmp_path / "out"
    path = study(cases(1))
    torquer.batch.run(str(path), str(out))
    (out / what).parent.mkdir(exist_ok=True)
    (out / what).symlink_to(target / "folder")
    before = tree(target)
    for call in (lambda: torquer.batch.run(str(path), str(out), share="1/2"), lambda: torquer.batch.gather(str(path), str(out))):
        with pytest.raises(torquer.Error, match=f"{out / what}: is not a folder, or a symbolic link to one"):
            call()
    assert tree(target) == before


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ran")
    (folder / "study.toml").write_text(cases(1))
    torquer.batch.run(str(folder / "study.toml"), str(folder / "out"))
    return folder


@pytest.mark.parametrize("what", CHANGED)
def test_a_users_file_in_the_results_is_refused_by_name_and_stays(ran, tmp_path, target, what):
    out = tmp_path / "out"
    shutil.copytree(ran / "out", out)
    put(out, target, CHANGED[what])
    before = tree(tmp_path)
    with pytest.raises(torquer.Error) as refused:
        torquer.batch.run(str(ran / "study.toml"), str(out))
    assert str(out / next(iter(CHANGED[what]))) in str(refused.value)
    assert tree(tmp_path) == before


def test_files_of_a_user_beside_results_stay(ran, study, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(ran / "out", out)
    own = {out / name: b"mine" for name in ("shapes/mine.zip", "shapes/mine.part", "lock", "notes.part", f"shapes/{'0' * 64}.zip")}
    for path, content in own.items():
        path.write_bytes(content)
    assert torquer.batch.run(str(study(cases(2))), str(out)).done == 1
    assert {path: path.read_bytes() for path in own} == own
    # A last line without a line end, as some editors leave it, is complete.
    text = (out / "readings.jsonl").read_bytes()
    (out / "readings.jsonl").write_bytes(text[:-1])
    assert torquer.batch.run(str(study(cases(2))), str(out)).stored_before == 2
    assert (out / "readings.jsonl").read_bytes() == text
    # A case whose line was removed runs again; a shape without a record stays.
    (out / "readings.jsonl").write_bytes(b"")
    assert torquer.batch.run(str(study(cases(2))), str(out)).done == 2
    record = out / "torquer-batch.jsonl"
    record.write_text("".join(line for line in record.read_text().splitlines(True) if "shape" not in line))
    (out / "readings.jsonl").write_bytes(b"")
    with pytest.raises(torquer.Error, match="zip: exists, but torquer-batch did not write it; move it away"):
        torquer.batch.run(str(study(cases(2))), str(out))


def test_a_linked_folder_is_refused(study, tmp_path, target):
    (tmp_path / "out").symlink_to(target / "folder")
    before = tree(target)
    with pytest.raises(torquer.Error, match="symbolic link to one; give the folder itself"):
        torquer.batch.run(str(study(cases(1))), str(tmp_path / "out"))
    assert tree(target) == before
