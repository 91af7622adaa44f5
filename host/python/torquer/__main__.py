"""The command "torquer", or python3 -m torquer."""

import argparse
import sys

from . import Error, __version__, centerlines, export


def main() -> int:
    parser = argparse.ArgumentParser(prog="torquer", description="Shapes of wires and vessels in other formats.")
    parser.add_argument("--version", action="version", version=f"torquer {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)
    convert = commands.add_parser(
        "convert",
        help="a --states file into .pvd, .vtp, .mrk.json or .csv; centerlines of VMTK (.vtp) into "
        "a new folder of curves for a scene",
    )
    convert.add_argument("source", metavar="IN")
    convert.add_argument("target", metavar="OUT")
    arguments = parser.parse_args()
    try:
        if arguments.source.endswith(".vtp"):
            written = centerlines.convert(arguments.source, arguments.target)
        else:
            written = export.write(export.read_states(arguments.source), arguments.target)
    except Error as error:
        print(f"torquer: {error}", file=sys.stderr)
        return 2
    print(f"{arguments.target}: {written}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
