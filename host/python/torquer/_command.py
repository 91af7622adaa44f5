"""How each command ends, whatever its standard streams are: closed, full, limited or without a reader."""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import Callable, TextIO, cast

_SUCCESS, _USER_ERROR, _INTERRUPTED = 0, 2, 130


class _Errors(io.TextIOBase):
    """Standard error. What it cannot take is lost, and changes nothing: the loss can be said nowhere."""

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


def _write_whole(descriptor: int, text: str) -> bool:
    left = memoryview(text.encode("utf-8", "backslashreplace"))
    try:
        while left:
            left = left[os.write(descriptor, left) :]
    except OSError:
        return False
    return True


def _occupy_standard_streams() -> None:
    """Keeps the numbers of closed streams, so that no file that is opened gets the messages."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError as error:
            if error.errno != errno.EBADF:
                continue
            # The lowest number that is free is this one. Opened the wrong way, it refuses every use.
            os.set_inheritable(os.open(os.devnull, os.O_WRONLY if descriptor == 0 else os.O_RDONLY), True)


def run(name: str, main: Callable[[], int]) -> int:
    """The exit status of a command: that of `main`, or 2 where what it printed could not be written."""
    _occupy_standard_streams()
    output = io.StringIO()
    # Written at the end: until then nothing of it can fail, in argparse neither.
    sys.stdout = output
    sys.stderr = cast(TextIO, _Errors())
    try:
        status = main()
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else _SUCCESS if ended.code is None else _USER_ERROR
    except KeyboardInterrupt:
        print(f"\n{name}: stopped", file=sys.stderr)
        status = _INTERRUPTED
    if not _write_whole(1, output.getvalue()):
        print(f"{name}: standard output cannot be written; is the disk full, or its reader gone?", file=sys.stderr)
        status = status or _USER_ERROR
    return status
