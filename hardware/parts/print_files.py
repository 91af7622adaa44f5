"""Writes an STL file of every printed part, as it lies on the printer's bed.

Needs openscad. It refuses to replace a file, and a part whose surface a slicer could not use.
"""

import argparse
import os
import subprocess
import sys

import render
import stl

# Further files: parts that have another shape for an optional part of the device.
VARIANTS = {"catheter_clamp_switch": ("catheter_clamp", ("end_switch=true",))}


def files() -> dict[str, tuple[str, tuple[str, ...]]]:
    """Part and settings of each file, by the name without its ending."""
    return {**{name: (name, ()) for name in render.PARTS}, **VARIANTS}


def write(folder: str) -> None:
    """Raises FileExistsError, OSError, CalledProcessError, or ValueError for an unusable surface."""
    os.makedirs(folder, exist_ok=True)
    paths = {name: os.path.join(folder, name + ".stl") for name in files()}
    for path in paths.values():
        if os.path.lexists(path):
            raise FileExistsError(f"{path} exists; remove it, or give another folder")
    for name, (part, settings) in files().items():
        render.make_stl(part, paths[name], settings)
        found = stl.defects(stl.read_stl(paths[name]))
        if found:
            raise ValueError(f"{paths[name]}: {found[0]}; correct {render.MODEL}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", help="for the files; it is made if it does not exist")
    try:
        write(parser.parse_args().folder)
    except (OSError, ValueError) as error:
        print(f"print_files.py: {error}", file=sys.stderr)
        return 2
    except subprocess.CalledProcessError as error:
        print(f"print_files.py: openscad failed: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
