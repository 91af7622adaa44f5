"""Commands of a wheel that are programs in C++."""

import os
import pathlib
import sys


def torquer_simulator() -> None:
    """Replaces this process by torquer-simulator."""
    program = pathlib.Path(__file__).with_name("bin") / "torquer-simulator"
    os.execv(program, ["torquer-simulator", *sys.argv[1:]])
