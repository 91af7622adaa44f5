"""torquer-monitor on a terminal whose width changes.

usage: monitor_width_test.py BUILD/bin"""

import fcntl
import os
import pathlib
import pty
import select
import signal
import struct
import sys
import termios
import time

PRIVATE_NETWORK = str(pathlib.Path(__file__).parents[2] / "host" / "bus" / "private_network")
FAR_S = 30  # until a wait fails
FULL = "no scene | no wire yet | device no daemon | 0 reports/s, - lost | 0 states/s, latency -"


def set_width(terminal, columns):
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))


def wait_for_line(terminal, wanted):
    """Reads until one update of the line is `wanted`."""
    text = ""
    end_s = time.monotonic() + FAR_S
    while time.monotonic() < end_s:
        if select.select([terminal], [], [], 1)[0]:
            text += os.read(terminal, 4096).decode()
        if wanted in text.split("\r\033[K")[1:-1]:
            return
    sys.exit(f"FAILED: no line {wanted!r} in {text[-2000:]!r}")


def main():
    monitor = os.path.join(sys.argv[1], "torquer-monitor")
    child, terminal = pty.fork()
    if child == 0:
        url = "udpm://239.255.76.67:7667?ttl=0"
        os.execv(PRIVATE_NETWORK, [PRIVATE_NETWORK, monitor, "--lcm-url", url])
    try:
        for columns, wanted in [
            (40, "no scene | no wire yet"),
            (len(FULL) + 1, FULL),
            (len(FULL), FULL[: FULL.rindex(" | ")]),
            (10, "no scene"),
            (1, ""),
        ]:
            set_width(terminal, columns)
            wait_for_line(terminal, wanted)
    finally:
        os.kill(child, signal.SIGTERM)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0:
        sys.exit("FAILED: the monitor did not end with status 0")


if __name__ == "__main__":
    main()
