"""Local store of trainees' sessions: what is added, listed, drawn and exported, and what is refused."""

import csv
import json
import os
import sqlite3
import subprocess
import sys
import xml.dom.minidom

import pytest
import torquer
from batch_runs import ENVIRONMENT
from torquer import trainees


def summary(**values):
    whole = {name: None for name in (*trainees.FIGURES, *trainees.VERDICTS)}
    whole.update(
        session_summary=2, scene="neuro_angio", trainee="Ann", group="2026", started_us=1_700_000_000_000_000, gradable=True,
        examination=False, procedure_s=90, target_s=60, target_reached=True, safe=True, passed=True, wall_force_mN=120,
        reversals=3, marks=[{"name": "wrong_vessels", "value": 0, "passed": True}],
    )
    return {**whole, **values}


def write(folder, name, **values):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.session.json"
    path.write_text(json.dumps(summary(**values)))
    return path


def run(store, *words):
    done = subprocess.run(
        [sys.executable, "-B", "-m", "torquer.trainees", "--store", str(store), *map(str, words)],
        env=ENVIRONMENT, capture_output=True, text=True, timeout=60, check=False,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def filled(tmp_path):
    sessions = tmp_path / "sessions"
    for k, (target, force) in enumerate([(120, 400), (80, 250), (60, 120)]):
        write(sessions / f"t{k}", "report", started_us=1_700_000_000_000_000 + k * 10**9, target_s=target, wall_force_mN=force,
              safe=force < 300, passed=force < 300, examination=k == 2)
    write(sessions / "u", "report", trainee="Bob", group="2025", target_reached=False, safe=False, target_s=None, passed=False)
    os.symlink(sessions / "t0", sessions / "latest")
    store = tmp_path / "new" / "store.sqlite"
    assert run(store, "add", sessions) == (0, f"{store}: 4 sessions added, 0 replaced\n", "")
    return store, sessions


def test_a_list_has_each_trainee_and_case(filled):
    store, _ = filled
    lines = run(store, "list")[1].splitlines()
    assert [line.split()[:5] for line in lines[1:]] == [
        ["Ann", "2026", "neuro_angio", "3", "2"], ["Bob", "2025", "neuro_angio", "1", "0"]]
    assert "1 of 1" in lines[1] and "0 of 0" in lines[2]
    assert len(run(store, "list", "--group", "2025")[1].splitlines()) == 2


def test_a_curve_has_the_sessions_in_order_of_time(filled, tmp_path):
    store, _ = filled
    picture = tmp_path / "ann.svg"
    status, out, error = run(store, "curve", "Ann", "--case", "neuro_angio", "--picture", picture)
    assert (status, error) == (0, "")
    rows = [line.split() for line in out.splitlines()[1:]]
    assert [row[1] for row in rows] == ["1", "2", "3"]
    assert [(row[4:6] + row[6:9]) for row in rows] == [
        ["practice", "unsafe", "failed", "120", "400"], ["practice", "safe", "passed", "80", "250"],
        ["examination", "safe", "passed", "60", "120"]]
    assert xml.dom.minidom.parseString(picture.read_text()).documentElement.tagName == "svg"
    status, _, error = run(store, "curve", "Ann", "--picture", picture)
    assert status == 2 and "exists already" in error
    status, _, error = run(store, "curve", "Anna")
    assert status == 2 and "Anna: has no session" in error and "Ann, Bob" in error


def test_an_export_has_every_session_and_empty_cells_for_what_is_not_known(filled, tmp_path):
    store, _ = filled
    table = tmp_path / "all.csv"
    assert run(store, "export", table) == (0, f"{table}: 4 sessions\n", "")
    rows = list(csv.DictReader(table.open()))
    assert [row["trainee"] for row in rows] == ["Ann", "Bob", "Ann", "Ann"]
    assert [row["target_s"] for row in rows] == ["120.0", "", "80.0", "60.0"]
    assert {row["blind_mm"] for row in rows} == {""} and rows[3]["examination"] == "1"
    before = table.read_bytes()
    assert run(store, "export", table)[0] == 2 and table.read_bytes() == before


def test_a_session_that_is_added_again_is_replaced_with_its_marks(filled):
    store, sessions = filled
    write(sessions / "t2", "report", started_us=1_700_000_000_000_000 + 2 * 10**9, target_s=61)
    assert run(store, "add", sessions)[1] == f"{store}: 0 sessions added, 4 replaced\n"
    with sqlite3.connect(store) as base:
        assert base.execute("SELECT count(*) FROM session").fetchone() == (4,)
        assert base.execute("SELECT count(*) FROM mark").fetchone() == (4,)
        assert base.execute("SELECT max(target_s) FROM session WHERE started_us = 1700002000000000").fetchone() == (61,)


def test_sessions_without_a_known_start_are_all_kept(tmp_path):
    store = tmp_path / "store.sqlite"
    sessions = [write(tmp_path / f"s{k}", "report", started_us=start, target_s=k) for k, start in enumerate([None, 0, None])]
    assert run(store, "add", *sessions)[1] == f"{store}: 3 sessions added, 0 replaced\n"
    write(tmp_path / "s1", "report", started_us=None, target_s=7)
    assert run(store, "add", *sessions)[1] == f"{store}: 0 sessions added, 3 replaced\n"
    assert [line.split()[2] for line in run(store, "curve", "Ann")[1].splitlines()[1:]] == ["-", "-", "-"]
    run(store, "export", tmp_path / "all.csv")
    rows = list(csv.DictReader((tmp_path / "all.csv").open()))
    assert {row["started_us"] for row in rows} == {""} and sorted(row["target_s"] for row in rows) == ["0.0", "2.0", "7.0"]


def test_a_store_of_the_first_version_is_renewed_without_loss(filled):
    store, sessions = filled
    with sqlite3.connect(store) as base:
        (made,) = base.execute("SELECT sql FROM sqlite_master WHERE name = 'session'").fetchone()
        old = made.replace("started_us INTEGER", "started_us INTEGER NOT NULL").replace("TABLE session", "TABLE old")
        base.executescript(
            f"{old}; INSERT INTO old SELECT * FROM session; UPDATE old SET started_us = 0 WHERE target_s = 60; DROP TABLE session;"
            "ALTER TABLE old RENAME TO session; PRAGMA user_version = 1"
        )
        assert base.execute("SELECT count(*) FROM mark").fetchone() == (4,)
    assert [line.split()[3] for line in run(store, "list")[1].splitlines()[1:]] == ["3", "1"]
    write(sessions / "t9", "report", started_us=None)
    assert run(store, "add", sessions / "t9")[1] == f"{store}: 1 sessions added, 0 replaced\n"
    with sqlite3.connect(store) as base:
        assert base.execute("SELECT count(*) FROM session WHERE started_us IS NULL").fetchone() == (2,)
        assert base.execute("SELECT count(*) FROM mark JOIN session ON session.id = mark.session").fetchone() == (5,)
        assert base.execute("PRAGMA foreign_key_check").fetchall() == []


def test_a_session_without_a_name_needs_one(tmp_path):
    store = tmp_path / "store.sqlite"
    write(tmp_path / "s", "a", trainee="", group="")
    write(tmp_path / "s", "b", scene="calcified")
    status, out, error = run(store, "add", tmp_path / "s")
    assert status == 1 and "1 sessions added" in out and "--trainee NAME" in error
    assert run(store, "add", tmp_path / "s", "--trainee", "Cy", "--group", "evening")[0] == 0
    lines = run(store, "list")[1].splitlines()
    assert lines[1].split()[:3] == ["Ann", "2026", "calcified"] and lines[2].split()[:3] == ["Cy", "evening", "neuro_angio"]
    status, _, error = run(store, "add", tmp_path / "s", "--group", "evening")
    assert status == 2 and "--trainee" in error


def test_any_name_is_listed_drawn_and_exported_as_it_is(tmp_path):
    names = ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", 'Ann, "the\nfast"', "Bob\r\nEve", "$\\frac{$", "\x1b[31mred", "a\0b", "\u202eevil"]
    store = tmp_path / "store.sqlite"
    for k, name in enumerate(names):
        write(tmp_path / "s", f"{k:02}", trainee=name, group="=g")
    assert run(store, "add", tmp_path / "s") == (0, f"{store}: {len(names)} sessions added, 0 replaced\n", "")
    out = run(store, "list")[1]
    assert len(out.splitlines()) == len(names) + 1 and all(one.isprintable() for one in out.replace("\n", ""))
    opened = trainees.Store(store)
    for name in names[7:10]:
        assert xml.dom.minidom.parseString(trainees.draw(opened.sessions(name), name)).documentElement.tagName == "svg"
    table = tmp_path / "all.csv"
    assert run(store, "export", table)[0] == 0
    rows = list(csv.DictReader(table.open(newline="")))
    opened.close()
    # A spreadsheet would compute a cell that begins like a formula.
    assert [row["trainee"] for row in rows] == [f"'{name}" if name[0] in "=+-@\t" else name for name in names]
    assert {row["group"] for row in rows} == {"'=g"}


def test_a_report_with_a_corrected_name_moves_its_session_to_that_trainee(tmp_path):
    store = tmp_path / "store.sqlite"
    write(tmp_path / "s", "a", trainee="Anm")
    assert run(store, "add", tmp_path / "s")[1].endswith("1 sessions added, 0 replaced\n")
    write(tmp_path / "s", "a", trainee="Ann")
    write(tmp_path / "s", "b", trainee="Bob")  # another place, begun at the same time
    assert run(store, "add", tmp_path / "s")[1].endswith("1 sessions added, 1 replaced\n")
    assert [line.split()[0] for line in run(store, "list")[1].splitlines()[1:]] == ["Ann", "Bob"]


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "is not a summary"),
        ("[1]", "is not a summary"),
        ("{" * 5000, "is not a summary"),
        (" " * 20000, "is not a summary"),
        (json.dumps(summary(session_summary=1)), "is not a summary"),
        (json.dumps(summary(wall_force_mN=-1)), "wall_force_mN = -1"),
        (json.dumps(summary(target_s=True)), "target_s = True"),
        (json.dumps(summary(started_us=1 << 62)), "started_us = "),
        (json.dumps(summary(safe=1)), "safe = 1"),
        (json.dumps(summary(trainee=7)), "trainee = 7"),
        (json.dumps(summary(scene="")), "scene is missing"),
        (json.dumps(summary(marks=[3])), "marks is no list"),
        (json.dumps(summary(trainee="\ud800")), "no text in Unicode"),
    ],
    ids=range(13),
)
def test_a_damaged_summary_is_named_and_left_out(tmp_path, text, said):
    path = tmp_path / "bad.session.json"
    path.write_text(text)
    with pytest.raises(torquer.Error, match=said) as error:
        trainees.read_session(str(path))
    assert str(path) in str(error.value)
    store = trainees.Store(tmp_path / "store.sqlite", make=True)
    done, left_out = trainees.add(store, [str(path)], "", "")
    assert done == "0 sessions added, 0 replaced" and said in left_out[0]
    store.close()


def test_files_that_are_no_store_stay_as_they_are(tmp_path):
    text = tmp_path / "notes.txt"
    text.write_text("no database, but notes of somebody " * 100)
    foreign = tmp_path / "foreign.sqlite"
    with sqlite3.connect(foreign) as base:
        base.execute("CREATE TABLE session (x)")
    write(tmp_path / "s", "a")
    for path, said in ((text, "cannot be used as a store"), (foreign, "of another program")):
        before = path.read_bytes()
        status, _, error = run(path, "add", tmp_path / "s")
        assert status == 2 and said in error and path.read_bytes() == before
    missing = tmp_path / "missing.sqlite"
    status, _, error = run(missing, "list")
    assert status == 2 and "there is no store" in error and not missing.exists()
    status, _, error = run(missing, "add", tmp_path / "none")
    assert status == 2 and "no such folder" in error and not missing.exists()
