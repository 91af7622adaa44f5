"""The command "torquer-validate", or python3 -m torquer.validate."""

from __future__ import annotations

import argparse
import signal
import sys

import numpy as np

from .. import Error, Scene, __version__, _command
from ..export import write_folder
from . import report, shapes
from ._base import need
from .fit import METHODS, Fit, fit, wire_of, with_name
from .paths import Lumen


def validate(scene_path: str, shapes_path: str, out: str, progress: _command.Progress) -> str:
    """Compares the shapes of a file with a scene's wire, and writes the folder `out`.

    Returns the table of medians. Raises Error naming the file, the defect and the remedy.
    """
    folder = _command.new_folder(out)
    for module in ("scipy.sparse.csgraph", "matplotlib"):
        need(module)
    every, unused = shapes.read(shapes_path)
    scene = Scene(scene_path)
    wire = wire_of(scene)
    named = with_name(scene)
    progress.step("Lumen")
    try:
        lumen = Lumen(scene, np.vstack([shape.points for shape in every]), wire.tip_radius_mm)
    except Error as error:
        raise Error(f"{shapes_path}: {error}") from None
    fits = []
    for number, shape in enumerate(every, 1):
        progress.step(f"Shape {number} of {len(every)}: {shape.name}")
        fits.append(fit(named, lumen, shape))
    origin = report.sources(scene, shapes_path)
    if unused:
        origin["unused_columns"] = ", ".join(unused)
    write_folder(folder, report.files(fits, lumen, origin))
    progress.end()
    return "\n".join([*_lines(fits), f"{out}/table.md"])


def _lines(fits: list[Fit]) -> list[str]:
    lines = []
    for row in report.summary(fits):
        refused = f", {row['refused']} refused" if row["refused"] else ""
        figures = f"median RMS {row['rms_mm']:.2f} mm, tip {row['tip_mm']:.2f} mm" if row["shapes"] else "no figures"
        lines.append(f"{row['method']}: {figures}, {row['shapes']} shapes{refused}")
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="torquer-validate",
        description="Compares measured shapes of a wire with those that a scene gives, and with ways through the lumen without a model of a wire.",
        epilog=f"Methods of the table: {'; '.join(f'{name} ({said})' for name, said in METHODS.items())}.",
    )
    parser.add_argument("--version", action="version", version=f"torquer-validate {__version__}")
    parser.add_argument("--scene", metavar="FILE", required=True, help="scene with the vessel and the wire; its entry is not used")
    parser.add_argument(
        "--shapes", metavar="FILE", required=True,
        help="CSV file with the columns shape, point, x_mm, y_mm, z_mm in the frame of the vessel's surface, "
        "the points of each shape from the entry to the tip",
    )
    parser.add_argument("--out", metavar="FOLDER", required=True, help="new folder for tables and pictures")
    parser.add_argument("--completion", choices=["bash"], action=_command.Completion, help="print a completion script for bash")
    arguments = parser.parse_args()
    # Ends as Ctrl-C does, so that no unfinished folder stays.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        print(validate(arguments.scene, arguments.shapes, arguments.out, _command.Progress(sys.stderr)))
    except Error as error:
        print(f"torquer-validate: {error}", file=sys.stderr)
        return 2
    return 0


def command() -> int:
    """The command torquer-validate: its exit status."""
    return _command.run("torquer-validate", main)


if __name__ == "__main__":
    sys.exit(command())
