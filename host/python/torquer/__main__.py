"""The command "torquer", or python3 -m torquer."""

import argparse
import sys

from . import Error, __version__, _command, benchmark, centerlines, envs, export, guide3d


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="torquer", description="Converts wires and vessels to other formats, and measures the speed of environments."
    )
    parser.add_argument("--version", action="version", version=f"torquer {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)
    convert = commands.add_parser(
        "convert",
        help="convert a --states file to .pvd, .vtp, .mrk.json or .csv, or centerlines of VMTK (.vtp) "
        "to a new folder of curves for a scene, or guide3d FOLDER to shapes for torquer-validate",
    )
    convert.add_argument("source", metavar="IN", help="file to read; or guide3d, and then the folder of that public data")
    convert.add_argument("target", metavar="OUT", help="file or folder to write; the folder to read after guide3d")
    convert.add_argument("shapes", metavar="SHAPES", nargs="?", help="new folder for the shapes of guide3d (default: guide3d-shapes)")
    convert.add_argument(
        "--unit", choices=centerlines.UNITS, help="unit of the coordinates in a .vtp (default: mm; SimVascular: cm)"
    )
    speed = commands.add_parser(
        "benchmark", help="measure the steps per second and the error of the environments in torquer.envs"
    )
    speed.add_argument("--json", action="store_true", help="print one line of JSON")
    speed.add_argument("tasks", metavar="TASK", nargs="*", help=f"tasks to measure: {', '.join(envs.TASKS)} (default: all)")
    arguments = parser.parse_args()
    try:
        if arguments.command == "benchmark":
            for name in arguments.tasks:
                if name not in envs.TASKS:
                    raise Error(f"there is no task {name!r}; there are: {', '.join(envs.TASKS)}")
            result = benchmark.run(arguments.tasks)
            print(benchmark.as_json(result) if arguments.json else benchmark.as_table(result))
            return 0
        target = arguments.target
        if arguments.source == "guide3d":
            if arguments.unit:
                raise Error("--unit is for centerlines in a .vtp; leave it out after guide3d")
            target = arguments.shapes or "guide3d-shapes"
            written = guide3d.convert(arguments.target, target)
        elif arguments.shapes:
            raise Error(f"{arguments.shapes}: only guide3d takes a third name; leave it out")
        elif arguments.source.endswith(".vtp"):
            written = centerlines.convert(arguments.source, arguments.target, arguments.unit or "mm")
        elif arguments.unit:
            raise Error(f"--unit {arguments.unit} is for centerlines in a .vtp, but {arguments.source} is no .vtp; leave it out")
        else:
            written = export.write(export.read_states(arguments.source), arguments.target)
    except Error as error:
        print(f"torquer: {error}", file=sys.stderr)
        return 2
    print(f"{target}: {written}")
    return 0


def command() -> int:
    """The command torquer: its exit status."""
    return _command.run("torquer", main)


if __name__ == "__main__":
    sys.exit(command())
