"""Opens and parses the files of users, so that each bad file raises torquer.Error."""

from __future__ import annotations

import json
import os
import re
import stat
import tomllib
from typing import Any, BinaryIO, Dict, Iterable, Iterator, Union

from . import _torquer

Error = _torquer.Error
Path = Union[str, "os.PathLike[str]"]

# Limits of the simulator for its scenes.
_DEEPEST = 32
_MOST_KEY_PARTS = 32
_MOST_PIECE_BYTES = 4096
_MOST_BYTES = 256 << 20
# Texts and comments of TOML. Each may end with the file, so that no position is searched twice.
_TOML_TEXTS = re.compile(
    r'"""(?:\\.?|[^\\])*?(?:"""|\Z)|\'\'\'.*?(?:\'\'\'|\Z)|"(?:\\.?|[^"\\\n])*"?|\'[^\'\n]*\'?|#[^\n]*', re.DOTALL
)
_TOML_PIECES = re.compile(r"[^\[\]{}=,\n]+|[\[\]{}]")


def open_file(path: Path) -> BinaryIO:
    """Opens an ordinary file. Pipes may wait forever for a writer, and devices may have no end."""
    path = os.fspath(path)
    try:
        # Checked before the opening, which could start a device, and after it, in case of a replacement.
        if stat.S_ISREG(os.stat(path).st_mode):
            file = os.fdopen(os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY), "rb")
            if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                return file
            file.close()
    except OSError as error:
        raise Error(f"{path}: cannot be read ({error.strerror}); check the path and permissions") from None
    except ValueError as error:
        raise Error(f"{path!r}: cannot be read ({error}); check the path") from None
    raise Error(f"{path}: cannot be read (it is not an ordinary file); check the path")


def read_text(path: Path) -> str:
    """Reads a file in UTF-8, with or without a byte order mark."""
    with open_file(path) as file:
        try:
            data = file.read(_MOST_BYTES + 1)
        except OSError as error:
            raise Error(f"{os.fspath(path)}: cannot be read ({error.strerror}); check the disk") from None
    if len(data) > _MOST_BYTES:
        raise Error(f"{os.fspath(path)}: larger than {_MOST_BYTES} bytes; give a smaller file")
    # UTF-16 may lack its mark. No other text has zeros.
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or 0 in data[:2]:
        raise Error(f"{os.fspath(path)}: the text is UTF-16; save it as UTF-8 (in Excel: CSV UTF-8)")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Error(f"{os.fspath(path)}: {error}; save it in UTF-8") from None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")


def _inner(values: Iterable[Any]) -> Iterator[Any]:
    for value in values:
        if isinstance(value, dict):
            yield from value.values()
        elif isinstance(value, list):
            yield from value


def _refuse_deep(value: Any) -> None:
    level = [value]
    for _ in range(_DEEPEST):
        level = [inner for inner in _inner(level) if isinstance(inner, (dict, list))]
        if not level:
            return
    raise ValueError(f"nested more than {_DEEPEST} deep; flatten it")


def load_json(text: Union[str, bytes]) -> Any:
    """As json.loads. Raises ValueError also for too deep nesting, NaN and infinity."""
    try:
        value = json.loads(text, parse_constant=_refuse_constant)
    except RecursionError:
        raise ValueError(f"nested more than {_DEEPEST} deep; flatten it") from None
    _refuse_deep(value)
    return value


def _check_toml(where: str, text: str) -> None:
    """Refuses texts for which tomllib takes quadratic time, or overflows the stack."""
    depth = 0
    bare = _TOML_TEXTS.sub(lambda match: '"' + "\n" * match[0].count("\n"), text)
    for match in _TOML_PIECES.finditer(bare):
        piece = match[0]
        depth = max(0, depth + (piece in "[{") - (piece in "]}"))
        problem = ""
        if depth > _DEEPEST:
            problem = f"arrays or tables are nested more than {_DEEPEST} deep; flatten it"
        elif piece.count(".") >= _MOST_KEY_PARTS:
            problem = f"a key has more than {_MOST_KEY_PARTS} parts; flatten it"
        elif len(piece) > _MOST_PIECE_BYTES and len("".join(piece.split())) > _MOST_PIECE_BYTES:
            problem = f"a key or value has more than {_MOST_PIECE_BYTES} bytes; shorten it"
        if problem:
            line = 1 + bare.count("\n", 0, match.start())
            raise Error(f"{where}:{line}: {problem}")


def parse_toml(where: str, text: str) -> Dict[str, Any]:
    """Parses a text; `where` is for messages."""
    _check_toml(where, text)
    try:
        table = tomllib.loads(text)
        _refuse_deep(table)
        return table
    except (ValueError, RecursionError) as error:
        raise Error(f"{where}: {error}") from None


def read_toml(path: Path) -> Dict[str, Any]:
    """Parses a file."""
    return parse_toml(os.fspath(path), read_text(path))
