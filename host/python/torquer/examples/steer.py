"""Pushes the guidewire of a live session 10 mm in 2 s. First generate the types, in the root of the repository:

    lcm-gen -p --ppath build/lcm_python protocol/lcm/*.lcm
    PYTHONPATH=build/lcm_python /usr/bin/python3 host/python/torquer/examples/steer.py

Debian has no Python binding of LCM. A message that fits one datagram is "LC02", a number, the channel and the encoded
type. (Docs of LCM: UDP multicast protocol.) With ttl 0 it stays on this machine.
"""

import socket
import struct
import sys
import time


def main(instrument="guidewire"):
    """Commands for 2 s, a hundred a second."""
    from torquer_lcm.instrument_command_t import instrument_command_t

    bus = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bus.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    command = instrument_command_t()
    command.instrument = instrument
    for k in range(201):
        command.sequence = k
        command.origin_us = command.publish_us = time.monotonic_ns() // 1000
        command.insertion_mm = 0.05 * k
        message = struct.pack(">4sI", b"LC02", k) + b"TORQUER_INSTRUMENT_COMMAND\0" + command.encode()
        bus.sendto(message, ("239.255.76.67", 7667))
        time.sleep(0.01)
    print(f"pushed {command.instrument} {command.insertion_mm:.1f} mm in {k * 0.01:.1f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
