"""Store of trainees' sessions: one file of SQLite."""

from __future__ import annotations

import pathlib
import sqlite3
from typing import Any, Dict, List, Optional

from . import Error

_APPLICATION = 0x746F7271  # "torq"
_VERSION = 2
_WAIT_S = 10.0

# Figures of a session, as in the file that torquer-report writes. A value that is not known is null.
FIGURES = (
    "procedure_s",
    "before_motion_s",
    "on_the_way_s",
    "after_target_s",
    "target_s",
    "wall_force_mN",
    "fluoroscopy_s",
    "air_kerma_mGy",
    "air_kerma_mGy_min",
    "contrast_mL",
    "blind_s",
    "blind_mm",
    "retractions",
    "retracted_mm",
    "reversals",
    "tip_path_mm",
)
VERDICTS = ("examination", "gradable", "target_reached", "safe", "passed")

# started_us is NULL if it is not known; SQLite takes each NULL of a UNIQUE key for another one.
_SESSION = f"""(
  id INTEGER PRIMARY KEY,
  trainee INTEGER NOT NULL REFERENCES trainee(id),
  trainee_group TEXT NOT NULL,
  scene TEXT NOT NULL,
  started_us INTEGER,
  file TEXT NOT NULL,
  {", ".join(f"{name} INTEGER" for name in VERDICTS)},
  {", ".join(f"{name} REAL" for name in FIGURES)},
  UNIQUE (trainee, scene, started_us)
);"""
_TABLES = f"""
CREATE TABLE trainee (
  id INTEGER PRIMARY KEY,
  name TEXT NOT NULL UNIQUE
);
CREATE TABLE session {_SESSION}
CREATE TABLE mark (
  session INTEGER NOT NULL REFERENCES session(id) ON DELETE CASCADE,
  name TEXT NOT NULL,
  value REAL,
  passed INTEGER
);
PRAGMA application_id = {_APPLICATION};
PRAGMA user_version = {_VERSION};
"""
# Version 1 had 0 for a start that is not known.
_FROM_VERSION_1 = f"""
CREATE TABLE renewed {_SESSION}
INSERT INTO renewed SELECT * FROM session;
UPDATE renewed SET started_us = NULL WHERE started_us = 0;
DROP TABLE session;
ALTER TABLE renewed RENAME TO session;
PRAGMA user_version = {_VERSION};
"""


class Store:
    """Sessions by trainee. `make`: a file that is missing is made."""

    def __init__(self, path: pathlib.Path, make: bool = False) -> None:
        self.path = path
        if not make and not path.exists():
            raise Error(f"{path}: there is no store; make it with: torquer-trainees add FOLDER")
        try:
            if make:
                path.parent.mkdir(parents=True, exist_ok=True)
            self._base = sqlite3.connect(path, timeout=_WAIT_S)
            self._check()
            self._base.execute("PRAGMA foreign_keys = ON")
        except (OSError, sqlite3.Error) as error:
            raise Error(f"{path}: cannot be used as a store ({error}); check the path and permissions") from None

    def __repr__(self) -> str:
        return f"Store(path={str(self.path)!r})"

    def _check(self) -> None:
        (application,) = self._base.execute("PRAGMA application_id").fetchone()
        (version,) = self._base.execute("PRAGMA user_version").fetchone()
        tables = self._base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if tables == 0 and application == 0:
            self._base.executescript("BEGIN EXCLUSIVE;" + _TABLES + "COMMIT;")
        elif application != _APPLICATION:
            raise Error(f"{self.path}: is a database of another program; give another --store")
        elif version == 1:
            self._base.executescript("PRAGMA foreign_keys = OFF; BEGIN EXCLUSIVE;" + _FROM_VERSION_1 + "COMMIT;")
        elif version != _VERSION:
            raise Error(f"{self.path}: has version {version} of the store, not {_VERSION}; use the release that made it")

    def close(self) -> None:
        self._base.close()

    def add(self, session: Dict[str, Any], trainee: str, group: str, file: str) -> bool:
        """Adds a session, or replaces it. False if it was there. One without a known start is known by its file."""
        with self._base:
            self._base.execute("INSERT OR IGNORE INTO trainee (name) VALUES (?)", (trainee,))
            (who,) = self._base.execute("SELECT id FROM trainee WHERE name = ?", (trainee,)).fetchone()
            key = (who, session["scene"], session["started_us"])
            # The same file may name another trainee than before.
            before = self._base.execute(
                "DELETE FROM session WHERE (file = ? OR (trainee = ? AND started_us IS NOT NULL)) AND scene = ? AND started_us IS ?",
                (file, *key),
            ).rowcount
            names = ["trainee", "scene", "started_us", "trainee_group", "file", *VERDICTS, *FIGURES]
            values = [*key, group, file, *(session[name] for name in (*VERDICTS, *FIGURES))]
            places = ", ".join("?" * len(names))
            row = self._base.execute(f"INSERT INTO session ({', '.join(names)}) VALUES ({places})", values).lastrowid
            self._base.executemany(
                "INSERT INTO mark VALUES (?, ?, ?, ?)",
                [(row, mark["name"], mark["value"], mark["passed"]) for mark in session["marks"]],
            )
        return before == 0

    def sessions(self, trainee: Optional[str] = None, scene: Optional[str] = None, group: Optional[str] = None) -> List[Dict[str, Any]]:
        """Sessions in the order of their start."""
        names = ["trainee", "group", "scene", "started_us", "file", *VERDICTS, *FIGURES]
        columns = ["trainee.name", "trainee_group", *names[2:]]
        rows = self._base.execute(
            f"SELECT {', '.join(columns)} FROM session JOIN trainee ON trainee.id = session.trainee "
            "WHERE (?1 IS NULL OR trainee.name = ?1) AND (?2 IS NULL OR scene = ?2) AND (?3 IS NULL OR trainee_group = ?3) "
            "ORDER BY started_us, session.id",
            (trainee, scene, group),
        )
        return [dict(zip(names, row)) for row in rows]
