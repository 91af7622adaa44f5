"""The command "torquer-identify", or python3 -m torquer.identify."""

from __future__ import annotations

import argparse
import signal
import sys
import tomllib
from typing import Any, Dict, List, Optional

from .. import Error, Scene, __version__, _command
from ..export import write_folder
from . import measured, report
from .experiment import Experiment
from .fit import identify, need


def starts(given: List[str]) -> Dict[str, Any]:
    """Keys of the option --vary, and their starts; None for the scene's own value."""
    out: Dict[str, Any] = {}
    for one in given:
        key, sign, value = (part.strip() for part in one.partition("="))
        if key in out:
            raise Error(f"--vary {key}: is there twice; keep one")
        out[key] = None
        if sign:
            try:
                out[key] = tomllib.loads(f"value = {value}")["value"]
            except tomllib.TOMLDecodeError:
                raise Error(f"--vary {one}: {value!r} is not a number; give one, as in {key}=0.1") from None
    return out


def run(scene_path: str, table_path: str, shapes_path: Optional[str], vary: List[str], out: str, progress: _command.Progress) -> str:
    """Fits keys of a scene, and writes the folder `out`. Returns the table of values.

    Raises Error naming the file, the defect and the remedy.
    """
    folder = _command.new_folder(out)
    for module in ("scipy.optimize", "matplotlib"):
        need(module)
    scene = Scene(scene_path)
    experiment = Experiment(scene, measured.read(scene, table_path, shapes_path), starts(vary))
    progress.step("Fit")
    result = identify(experiment)
    progress.step("Tables")
    write_folder(folder, report.files(experiment, result, report.sources(experiment, shapes_path)))
    progress.end()
    return "\n".join([*report.table(result), f"{out}/table.md"])


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="torquer-identify",
        description="Fits values of a scene, such as a rigidity or a friction coefficient, to measured forces, tips and shapes, with intervals.",
    )
    parser.add_argument("--version", action="version", version=f"torquer-identify {__version__}")
    parser.add_argument("--scene", metavar="FILE", required=True, help="scene of the experiment")
    parser.add_argument(
        "--measured", metavar="FILE", required=True,
        help="CSV file with a row for each moment: time_s, hands (NAME.insertion_mm, NAME.rotation_rad), and the measured readings by "
        "their names; tip_x_mm, tip_y_mm, tip_z_mm; shape names a shape. An empty cell was not measured",
    )
    parser.add_argument("--shapes", metavar="FILE", help="CSV file with the columns shape, point, x_mm, y_mm, z_mm, as for torquer-validate")
    parser.add_argument(
        "--vary", metavar="KEY", action="append", required=True,
        help="key to fit, as instrument.NAME.rigidity_N_mm2 or effects.friction.coefficient; KEY=VALUE gives the start; repeat for more keys",
    )
    parser.add_argument("--out", metavar="FOLDER", required=True, help="new folder for tables, the picture and the fitted scene")
    parser.add_argument("--completion", choices=["bash"], action=_command.Completion, help="print a completion script for bash")
    arguments = parser.parse_args()
    # Ends as Ctrl-C does, so that no unfinished folder stays.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        print(run(arguments.scene, arguments.measured, arguments.shapes, arguments.vary, arguments.out, _command.Progress(sys.stderr)))
    except Error as error:
        print(f"torquer-identify: {error}", file=sys.stderr)
        return 2
    return 0


def command() -> int:
    """The command torquer-identify: its exit status."""
    return _command.run("torquer-identify", main)


if __name__ == "__main__":
    sys.exit(command())
