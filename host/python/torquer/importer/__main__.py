"""The command "torquer-import", or python3 -m torquer.importer."""

import argparse
import os
import pathlib
import re
import shutil
import signal
import sys
import tempfile
from typing import Any, List, Optional, Tuple

import numpy as np

from .. import Error, Scene, __version__, _command
from ..centerlines import UNITS
from . import _given, body, case, centerlines, lumen, scan, surface
from ._base import need

# A report says so if the surface of a label lacks more than this share of its volume.
_MOST_LOST = 0.1


def point_of(option: str, text: str) -> Any:
    """Place that an option gives. Raises Error."""
    try:
        point = np.array([float(word) for word in text.split(",")])
    except ValueError:
        point = np.array([])
    if len(point) != 3 or not (np.abs(point) < 1e5).all():
        raise Error(f"{option}={text}: give left, posterior and superior in mm, as {option}=-12.5,30,1480")
    return point


def _places(arguments: argparse.Namespace) -> Tuple[List[Any], Optional[Any]]:
    """Places of --root and --entry."""
    entry = arguments.entry
    return [point_of("--root", text) for text in arguments.root], None if entry is None else point_of("--entry", entry)


def _seeds(arguments: argparse.Namespace) -> Any:
    """Places of --seed, shape (n, 3)."""
    return np.array([point_of("--seed", text) for text in arguments.seed]).reshape(-1, 3)


def _parts(mesh: surface.Mesh, arguments: argparse.Namespace) -> Tuple[surface.Mesh, List[str]]:
    """The parts of the surface that the options choose, and sentences about them and the others."""
    roots, entry = _places(arguments)
    return surface.wanted(mesh, roots, [*_seeds(arguments), *([] if entry is None else [entry])])


def _label_mesh(read: scan.Scan, numbers: List[int]) -> Tuple[surface.Mesh, List[str]]:
    """Surface of all voxels with one of these values, and sentences about it."""
    for number in numbers:
        if number == 0 or not (read.values == number).any():
            why = "is the background" if number == 0 else f"no voxel of {read.path} has this value"
            there = [value for value in np.unique(read.values) if value]
            listed = ", ".join(map(str, there[:20])) + (", .." if len(there) > 20 else "") if there else "none"
            raise Error(f"--label {number}: {why}; labels in {read.path}: {listed}")
    mask = np.isin(read.values, numbers)
    picture = need("scipy.ndimage").gaussian_filter(mask.astype(np.float32), 0.7)
    if not (picture > 0.5).any():
        raise Error(f"{read.path}: the label is nowhere thicker than two voxels; give a label map with finer voxels")
    mesh = surface.isosurface(picture, 0.5, read.affine)
    ml = np.count_nonzero(mask) * float(abs(np.linalg.det(read.affine[:3, :3]))) / 1000
    facts = [f"Label {', '.join(map(str, numbers))}: {ml:.2f} mL."]
    lost = 1 - mesh.volume_mm3() / 1000 / ml
    if lost > _MOST_LOST:
        facts.append(f"The surface has {100 * lost:.0f} % less, because vessels of two voxels or less are lost; give finer voxels.")
    return mesh, facts


def _from_scan(
    folder: pathlib.Path, arguments: argparse.Namespace, progress: _command.Progress
) -> Tuple[surface.Mesh, str, List[str]]:
    """Surface of the lumen in a scan or a label map, the keys of the body, and sentences about the steps."""
    seeds = _seeds(arguments)
    progress.step("Reading the scan")
    read = scan.read(arguments.scan, None if arguments.body else arguments.series)
    facts: List[str] = list(read.facts)
    levels: Optional[lumen.Levels] = None
    if arguments.label:
        progress.step("Surface of the label")
        mesh, said = _label_mesh(read, arguments.label)
        facts += said
    else:
        levels = lumen.levels_of(read, seeds)
        facts.append(f"Levels: {levels}.")
        progress.step("Lumen")
        picture = lumen.smoothed(read)
        label = lumen.segment(read, picture, levels, seeds)
        progress.step("Surface")
        values, first = lumen.wall_picture(read, picture, label, levels)
        lumen.trim(label, values, first)
        scan.write_nifti(folder / "lumen.nii.gz", label, read.affine)
        mesh = surface.isosurface(values, 0.5, read.affine, first)
        del picture, label, values
    mesh, said = _parts(mesh, arguments)
    facts += said
    before = mesh.volume_mm3()
    mesh = surface.decimate(surface.smooth(mesh))
    text = ""
    if levels is not None:
        progress.step("Body")
        shown = body.write(folder, read, mesh, levels)
        text = shown.text
        facts += shown.facts
    facts.append(
        f"Surface: {len(mesh.triangles)} triangles, {mesh.volume_mm3() / 1000:.2f} mL; smoothing and decimation changed the "
        f"volume by {100 * (mesh.volume_mm3() / before - 1):.2f} %."
    )
    return mesh, text, facts


def _from_surface(
    arguments: argparse.Namespace, progress: _command.Progress
) -> Tuple[surface.Mesh, Optional[List[centerlines.Curve]], List[str]]:
    """Repaired surface, its centerlines if they are given, and sentences about the steps."""
    progress.step("Reading the surface")
    mesh, space, facts = _given.read_surface(arguments.scan, arguments.mesh_unit, arguments.space)
    curves = None
    if arguments.centerlines is not None:
        roots, _ = _places(arguments)
        if os.path.isdir(arguments.centerlines):
            curves, said = _given.read_curves(arguments.centerlines, mesh, roots)
        else:
            curves, said = _given.read_lines(arguments.centerlines, arguments.mesh_unit, space, roots, surface.parts(mesh))
        facts += said
        # The parts that the curves lie in.
        mesh, said = surface.wanted(mesh, [curve.points[len(curve.points) // 2] for curve in curves])
    else:
        mesh, said = _parts(mesh, arguments)
    facts += said
    before = len(mesh.triangles)
    mesh = surface.decimate(mesh)
    if len(mesh.triangles) < before:
        facts.append(f"Surface: {before} triangles were reduced to {len(mesh.triangles)}, with the volume kept.")
    return mesh, curves, facts


def _given_body(folder: pathlib.Path, arguments: argparse.Namespace, mesh: surface.Mesh) -> body.Body:
    """The scan of --body as the body, for a vessel that was not made from it here."""
    read = scan.read(arguments.body, arguments.series)
    found = body.write(folder, read, mesh, body.levels_at(read, mesh))
    return body.Body(found.text, [*read.facts, *found.facts])


def _findings(folder: pathlib.Path, name: str, arguments: argparse.Namespace) -> List[str]:
    """Findings of the simulator about the finished case. Raises Error naming the input if the case does not run."""
    try:
        return list(Scene(str(folder / f"{name}.toml")).findings)
    except Error as error:
        unit = " Check --mesh-unit." if arguments.mesh_unit else ""
        raise Error(
            f"{arguments.scan}: the simulator refuses the case that was made from it, and so it was not kept.{unit} Choose other "
            f"ends by --root and --entry, or correct the vessel in 3D Slicer. It says: {str(error).replace(f'{folder}/', '')}"
        ) from None


def _build(folder: pathlib.Path, name: str, arguments: argparse.Namespace, progress: _command.Progress) -> str:
    """Makes all files in a folder; returns a description."""
    roots, at = _places(arguments)
    curves: Optional[List[centerlines.Curve]] = None
    shown = ""
    if _given.is_surface(arguments.scan):
        mesh, curves, facts = _from_surface(arguments, progress)
    else:
        mesh, shown, facts = _from_scan(folder, arguments, progress)
    surface.write_stl(folder / "surface.stl", mesh)
    if arguments.body is not None:
        progress.step("Body")
        given = _given_body(folder, arguments, mesh)
        shown = given.text
        facts += given.facts
    if curves is None:
        progress.step("Centerlines")
        try:
            curves = centerlines.find_all(surface.parts(mesh), roots, facts)
        except Error as error:
            raise Error(f"{arguments.scan}: {error}") from None
    centerlines.write(folder / "centerlines", curves)
    facts.append(f"{len(curves)} centerlines, {sum(float(curve.lengths_mm()[-1]) for curve in curves):.0f} mm.")
    facts += case.size_facts(curves)
    progress.step("Scene")
    entries = case.entries_of(curves)
    entry = case.first_entry(entries, facts) if at is None else case.entry_at(entries, at)
    origin = pathlib.Path(arguments.scan).resolve().name
    text = case.scene_text(name, re.sub(r"[^\w. -]", "_", origin), curves, entry, shown)
    (folder / f"{name}.toml").write_text(text)
    case.draw(folder / "picture.png", mesh, curves, entries)
    facts += _findings(folder, name, arguments)
    (folder / "report.txt").write_text("\n".join(facts) + "\n")
    progress.end()
    return "\n".join(facts)


def _check_options(arguments: argparse.Namespace) -> None:
    """Refuses options that do not belong to the kind of input."""
    is_surface = _given.is_surface(arguments.scan)
    given = {
        "--seed": bool(arguments.seed), "--label": bool(arguments.label), "--series": arguments.series is not None,
        "--mesh-unit": arguments.mesh_unit is not None, "--space": arguments.space is not None,
        "--centerlines": arguments.centerlines is not None, "--body": arguments.body is not None,
    }
    scans = ["--seed", "--label"] if given["--body"] else ["--seed", "--label", "--series"]
    others = scans if is_surface else ["--mesh-unit", "--space", "--centerlines"]
    wrong = [option for option in others if given[option]]
    if wrong:
        kind, other = ("a surface", "a scan") if is_surface else ("no surface", "a surface")
        raise Error(f"{wrong[0]}: is for {other}, but {arguments.scan} is {kind}; leave it out")
    if is_surface and arguments.mesh_unit is None:
        raise Error("give --mesh-unit: a surface does not state its unit; mm for most segmentations, m or cm for some models")
    if not is_surface and given["--seed"] == given["--label"]:
        raise Error("give --seed for a CT angiography, or --label for a label map, and not both")
    if given["--seed"] and given["--body"]:
        raise Error("--body: is for a label map or a surface; a CT angiography is the body itself; leave it out")


def import_case(arguments: argparse.Namespace) -> str:
    """Makes a case by the arguments of the command; returns a description. Raises Error."""
    out = pathlib.Path(arguments.out)
    if os.path.lexists(out):
        raise Error(f"--out {out}: exists already; remove it, or give another name")
    if not re.fullmatch(r"[A-Za-z0-9_-]+", out.name):
        raise Error(f"--out {out}: the name becomes that of the scene; give letters, digits, - and _")
    _check_options(arguments)
    temporary = None
    try:
        temporary = pathlib.Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
        said = _build(temporary, out.name, arguments, _command.Progress(sys.stderr))
        temporary.chmod(0o755)
        temporary.rename(out)
        temporary = None
        return said
    except OSError as error:
        raise Error(f"--out {out}: cannot be written ({error.strerror}); check the folder and its space") from None
    except MemoryError:
        raise Error(f"{arguments.scan}: does not fit into memory; crop it in 3D Slicer") from None
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)


def arguments_of(words: Optional[List[str]] = None) -> argparse.Namespace:
    """Arguments of the command; default: the arguments of this process."""
    parser = argparse.ArgumentParser(
        prog="torquer-import",
        description="Makes a case from a patient's CT angiography, from a label map of the vessels, or from their surface: "
        "surface, centerlines, scene.",
    )
    parser.add_argument("--version", action="version", version=f"torquer-import {__version__}")
    parser.add_argument(
        "scan", metavar="SCAN",
        help="folder of DICOM files; a NIfTI, NRRD or MetaImage file; or a surface: STL, OBJ, PLY, VTP or VTK",
    )
    parser.add_argument("--out", metavar="FOLDER", required=True, help="new folder for the case; its name becomes that of the scene")
    parser.add_argument(
        "--seed", metavar="L,P,S", action="append", default=[],
        help="place in the lumen: left, posterior, superior in mm; write --seed=-12,30,1480; may be given several times",
    )
    parser.add_argument(
        "--label", metavar="N", type=int, action="append", default=[],
        help="SCAN is a label map, and N the value of the lumen in it; give it several times for a vessel of several values",
    )
    parser.add_argument(
        "--body", metavar="SCAN",
        help="for a label map or a surface: the CT in which it was segmented, for X-ray pictures; a folder of DICOM files or an image",
    )
    parser.add_argument("--series", metavar="N", type=int, help="number of the series in a folder with several, of --body if given")
    parser.add_argument("--mesh-unit", metavar="UNIT", choices=UNITS, help="SCAN is a surface in this unit: mm, m, cm, um or in")
    parser.add_argument("--space", choices=_given.SPACES, help="coordinate system of a surface that does not name it (default: LPS)")
    parser.add_argument(
        "--centerlines", metavar="FILE",
        help="for a surface: centerlines of VMTK (.vtp) in its unit and space, or a folder of curves of 3D Slicer (.mrk.json)",
    )
    parser.add_argument(
        "--root", metavar="L,P,S", action="append", default=[],
        help="the blood enters at the tip nearest to this place (default: the widest); give it several times for parts without "
        "connection, and other parts are left out",
    )
    parser.add_argument("--entry", metavar="L,P,S", help="the wire enters at the tip nearest to this place (default: the lowest)")
    parser.add_argument("--completion", choices=["bash"], action=_command.Completion, help="print a completion script for bash")
    return parser.parse_args(words)


def main() -> int:
    arguments = arguments_of()
    # Ends as Ctrl-C does, so that no unfinished folder stays.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        said = import_case(arguments)
    except Error as error:
        print(f"torquer-import: {error}", file=sys.stderr)
        return 2
    print(f"{said}\n{arguments.out}: torquer-simulator --explain {arguments.out}/{pathlib.Path(arguments.out).name}.toml")
    return 0


def command() -> int:
    """The command torquer-import: its exit status."""
    return _command.run("torquer-import", main)


if __name__ == "__main__":
    sys.exit(command())
