"""Common parts of the commands: optional packages, progress, completion and exit. The exit is correct even if a
standard stream is closed, full, limited or without a reader."""

from __future__ import annotations

import argparse
import errno
import importlib
import io
import os
import pathlib
import sys
import time
from typing import Any, Callable, Optional, TextIO, cast

from . import Error

_SUCCESS, _USER_ERROR, _INTERRUPTED = 0, 2, 130


class _Errors(io.TextIOBase):
    """Standard error. Failed writes are ignored, because there is no place to report them."""

    encoding = "utf-8"
    errors = "backslashreplace"

    def writable(self) -> bool:
        return True

    def isatty(self) -> bool:
        return os.isatty(2)

    def fileno(self) -> int:
        return 2

    def write(self, text: str) -> int:
        _write_whole(2, text)
        return len(text)


def need(command: str, module: str, package: str) -> Any:
    """Imports a module of a Debian package that only this command needs."""
    try:
        return importlib.import_module(module)
    except ImportError:
        elsewhere = package.removeprefix("python3-").rstrip("0123456789")
        raise Error(
            f"{command} needs the package {package}: apt-get install {package}, or pip install {elsewhere}"
        ) from None


class Progress:
    """Progress of a command: the name of each step, and its time when the next one begins."""

    def __init__(self, out: Optional[TextIO] = None) -> None:
        self._out = out
        self._began: Optional[float] = None
        self._terminal = out is not None and out.isatty()

    def step(self, name: str) -> None:
        self.end()
        self._began = time.monotonic()
        self._write(f"{name} .." + ("" if self._terminal else "\n"))

    def end(self) -> None:
        if self._began is not None and self._terminal:
            self._write(f" {time.monotonic() - self._began:.0f} s\n")
        self._began = None

    def _write(self, text: str) -> None:
        if self._out is not None:
            self._out.write(text)
            self._out.flush()


def new_folder(out: str) -> pathlib.Path:
    """The folder of the option --out, which must not exist yet, in one that does."""
    folder = pathlib.Path(out)
    if os.path.lexists(folder):
        raise Error(f"--out {out}: exists already; remove it, or give another name")
    if not folder.absolute().parent.is_dir():
        raise Error(f"--out {out}: there is no folder {folder.absolute().parent}; make it first")
    return folder


class Completion(argparse.Action):
    """Prints the completion for bash: options and files."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        options = [option for action in parser._actions for option in action.option_strings if option.startswith("--")]
        print(f'complete -o default -W "{" ".join(options)}" {parser.prog}')
        parser.exit()


def _write_whole(descriptor: int, text: str) -> bool:
    left = memoryview(text.encode("utf-8", "backslashreplace"))
    try:
        while left:
            left = left[os.write(descriptor, left) :]
    except OSError:
        return False
    return True


def _occupy_standard_streams() -> None:
    """Occupies the numbers of closed streams, so that no opened file gets the messages."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError as error:
            if error.errno != errno.EBADF:
                continue
            # open() uses the lowest free number, which is this one. The wrong mode makes every use fail.
            os.set_inheritable(os.open(os.devnull, os.O_WRONLY if descriptor == 0 else os.O_RDONLY), True)


def run(name: str, main: Callable[[], int]) -> int:
    """Exit status of a command: that of `main`, or 2 if its output could not be written."""
    _occupy_standard_streams()
    output = io.StringIO()
    # Written at the end, so that no print fails before, not even in argparse.
    sys.stdout = output
    sys.stderr = cast(TextIO, _Errors())
    try:
        status = main()
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else _SUCCESS if ended.code is None else _USER_ERROR
    except KeyboardInterrupt:
        print(f"\n{name}: stopped", file=sys.stderr)
        status = _INTERRUPTED
        # After an interrupt within eval(), as in imports, Python would end itself by SIGINT. The next eval() prevents it.
        eval("0")
    if not _write_whole(1, output.getvalue()):
        print(f"{name}: standard output cannot be written; is the disk full, or its reader gone?", file=sys.stderr)
        status = status or _USER_ERROR
    return status
