"""Errors of the import: scans of known truth, imported and compared with it.

    python3 -m torquer.importer.errors [SCENE ..] [--voxels 0.4,0.7,1]

Makes a CT angiography of a scene's lumen with bone, partial volume, blur and noise. Imports it as the command does, and
prints a row of the table for each voxel size. The wire's runs start at the same end of the vessel in both. They push it
at nine pairs of a first turn and an offset of the insertion.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import re
import sys
import tempfile
import time
from typing import Any, List, Optional, Tuple

import numpy as np
import numpy.typing as npt

from .. import Error, Scene, Simulation, _command
from .._polyline import at_arcs
from . import case, centerlines, scan, surface
from .__main__ import arguments_of, import_case, point_of
from ._base import Points, need
from ._truth import BLUR_MM, NOISE, Truth, scan_of, seed_of
from .centerlines import Curve

_WALL_POINTS = 60_000
# Grid of the true surface, mm: the same for all voxel sizes.
_REFERENCE_MM = 0.5
_TURNS, _OFFSETS_MM = (0.0, 2.1, 4.2), (-2.0, 0.0, 2.0)
_PUSH_MM, _ROW_S = 1.0, 0.1
# Share of the way to the farthest tip that is pushed.
_WAY_SHARE = 0.8
# A branch is found if this share of its points lies in the lumen about an imported curve.
_FOUND_SHARE = 0.8


@dataclasses.dataclass(frozen=True)
class Vessel:
    """A vessel that the wire runs in: the tables of its scene, its curves, and its frame."""

    tables: str
    folder: str
    curves: List[Curve]
    truth: Optional[Truth]
    """Turns from LPS to the frame of the scene; None: it is LPS."""

    def to_lps(self, points: Any) -> Points:
        return np.asarray(points, float) if self.truth is None else self.truth.to_lps(points)

    def from_lps(self, points: Any) -> Points:
        return np.asarray(points, float) if self.truth is None else self.truth.from_lps(points)


@dataclasses.dataclass(frozen=True)
class Run:
    """End of a run, in LPS: the wire at points of the same distance from the entry, and its tip."""

    wire: Points
    tip: npt.NDArray[np.float64]


def tables_of(text: str) -> str:
    """Vessel and frame in the text of a scene."""
    return "".join(part for part in re.split(r"(?m)^(?=\[)", text) if re.match(r"\[+(vessel|patient_axes)\b", part))


def reference(truth: Truth, step_mm: float = _REFERENCE_MM) -> Vessel:
    """The true vessel, with curves that the importer finds in its exact surface on a grid."""
    low = truth.low - 3.37 * step_mm
    size = np.ceil((truth.high + 3 * step_mm - low) / step_mm).astype(int) + 1
    values = np.zeros(tuple(size[::-1]), np.float32)
    j, i = np.meshgrid(np.arange(size[1]), np.arange(size[0]), indexing="ij")
    for k in range(int(size[2])):
        points = np.stack([i, j, np.full_like(i, k)], axis=-1).reshape(-1, 3) * step_mm + low
        values[k] = np.clip(0.5 + truth.depth_mm(points) / (4 * step_mm), 0, 1).reshape(j.shape)
    affine = np.diag([step_mm] * 3 + [1.0])
    affine[:3, 3] = low
    mesh = surface.decimate(surface.wanted(surface.isosurface(values, 0.5, affine))[0])
    curves = centerlines.find_all(surface.parts(mesh))
    return Vessel(tables_of(truth.scene.text), truth.scene.folder, curves, truth)


def imported(folder: pathlib.Path) -> Vessel:
    """The vessel of an imported case."""
    text = (folder / f"{folder.name}.toml").read_text()
    return Vessel(tables_of(text), str(folder), centerlines.read(folder / "centerlines"), None)


def simulation(vessel: Vessel, entry: case.Entry, length_mm: float) -> Simulation:
    """Wire of an imported case, from an entry in LPS."""
    point, direction = (vessel.from_lps(value) for value in (entry.point_mm, entry.direction))
    front, left = vessel.from_lps(case.ANTERIOR), vessel.from_lps(case.LEFT)
    text = f'name = "run"\n{vessel.tables}\n[entry]\npoint_mm = {point.tolist()}\ndirection = {direction.tolist()}\n'
    text += case.wire_text(case.is_thick(entry), direction, length_mm, front, left)
    return Simulation(Scene.from_text(text + "\n[effects.friction]\ncoefficient = 0.08\n", vessel.folder))


def run(vessel: Vessel, start: Simulation, way_mm: float, turn_rad: float) -> Run:
    """Pushes the wire, in rows of a millimeter, after a turn."""
    now = start.copy()
    rows = int(way_mm / _PUSH_MM)
    for k in range(1, rows + 1):
        now.step(_ROW_S * k, [[_PUSH_MM * k, turn_rad]])
    nodes = vessel.to_lps(now.nodes_mm)
    return Run(at_arcs(nodes, np.arange(0, rows * _PUSH_MM, _PUSH_MM)), vessel.to_lps(now.tips_mm[0]))


def runs(vessel: Vessel, entry: case.Entry, way_mm: float) -> List[Run]:
    """All nine runs."""
    start = simulation(vessel, entry, way_mm + 10)
    return [run(vessel, start, way_mm + offset, turn) for turn in _TURNS for offset in _OFFSETS_MM]


def branch_of(curves: List[Curve], point: Any) -> int:
    """The curve whose lumen a point lies in."""
    shares = []
    for curve in curves:
        distances = np.linalg.norm(curve.points - point, axis=1)
        shares.append(float((distances / curve.radii).min()))
    return int(np.argmin(shares))


def section_of(curves: List[Curve], point: Any) -> Tuple[int, int]:
    """The curve whose lumen a point lies in, and the number of curves that leave it before the point."""
    number = branch_of(curves, point)
    points = curves[number].points

    def at(place: Any) -> int:
        return int(np.linalg.norm(points - place, axis=1).argmin())

    left = [curve for curve in curves if curve.parent == number and at(curve.points[0]) < at(point)]
    return number, len(left)


def went_alike(curves: List[Curve], one: Run, other: Run) -> bool:
    """True if two tips lie between the same branchings, or beside each other at one."""
    number, _ = section = section_of(curves, one.tip)
    if section == section_of(curves, other.tip):
        return True
    curve = curves[number]
    radius = float(curve.radii[np.linalg.norm(curve.points - one.tip, axis=1).argmin()])
    return float(np.linalg.norm(one.tip - other.tip)) < radius


def way_of(curves: List[Curve], entry: case.Entry) -> float:
    """Length that is pushed: a share of the longest way from the entry to another tip."""
    tips = [curves[0].points[0], *(curve.points[-1] for curve in curves)]
    nodes = np.vstack([curve.points for curve in curves])
    starts = np.cumsum([0, *(len(curve.points) for curve in curves)])
    pairs = [np.column_stack([np.arange(a, b - 1), np.arange(a + 1, b)]) for a, b in zip(starts, starts[1:])]
    tree = need("scipy.spatial").cKDTree
    for k, curve in enumerate(curves):
        if curve.parent is not None:
            near = int(tree(curves[curve.parent].points).query(curve.points[0])[1])
            pairs.append(np.array([[starts[k], starts[curve.parent] + near]]))
    joined = np.vstack(pairs)
    lengths = np.maximum(1e-9, np.linalg.norm(nodes[joined[:, 0]] - nodes[joined[:, 1]], axis=1))
    graph = need("scipy.sparse").coo_matrix((lengths, joined.T), (len(nodes), len(nodes)))
    whole = tree(nodes)
    from_entry = need("scipy.sparse.csgraph").dijkstra(graph.tocsr(), directed=False, indices=int(whole.query(entry.point_mm)[1]))
    lengths_to_tips = from_entry[whole.query(np.array(tips))[1]]
    # Tips of another part of the vessel are at no distance.
    return _WAY_SHARE * float(lengths_to_tips[np.isfinite(lengths_to_tips)].max())


def branches_found(true: List[Curve], found: List[Curve]) -> Tuple[int, int]:
    """Number of true branches that were found, and of false branches."""

    def covered(one: Curve, others: List[Curve]) -> bool:
        tree = need("scipy.spatial").cKDTree(np.vstack([curve.points for curve in others]))
        radii = np.concatenate([curve.radii for curve in others])
        distances, nearest = tree.query(one.points)
        return float((distances < np.maximum(1.0, radii[nearest])).mean()) >= _FOUND_SHARE

    return sum(covered(one, found) for one in true), sum(not covered(one, true) for one in found)


def _percentiles(values: Any) -> str:
    p50, p95 = np.percentile(np.abs(values), [50, 95])
    return f"{p50:.2f}, {p95:.2f}"


def row_of(
    truth: Truth, true: Vessel, wall: Points, voxel_mm: float, folder: pathlib.Path, entry_mm: Optional[Any] = None
) -> str:
    """Imports a scan and compares; a row of the table. The wire enters next to entry_mm, or where the import chooses."""
    began = time.monotonic()
    read = scan_of(truth, voxel_mm)
    scan.write_nifti(folder / "scan.nii", read.values, read.affine)
    del read
    out = folder / f"case_{voxel_mm * 100:.0f}"
    seed = ",".join(f"{value:.2f}" for value in seed_of(truth))
    import_case(arguments_of([str(folder / "scan.nii"), f"--seed={seed}", "--out", str(out)]))
    vessel = imported(out)
    scene = Scene(str(out / f"{out.name}.toml"))
    points = centerlines.sample(surface.from_stl(out / "surface.stl"), 1.0)[0]
    radii = np.concatenate([curve.radii for curve in vessel.curves])
    middles = np.vstack([curve.points for curve in vessel.curves])
    bias = radii - need("scipy.spatial").cKDTree(wall).query(middles)[0]
    found, false = branches_found(true.curves, vessel.curves)
    ends = case.entries_of(true.curves)
    entry = case.first_entry(ends) if entry_mm is None else case.entry_at(ends, entry_mm)
    same = min(case.entries_of(vessel.curves), key=lambda one: float(np.linalg.norm(one.point_mm - entry.point_mm)))
    way_mm = way_of(true.curves, entry)
    ours, theirs = runs(true, entry, way_mm), runs(vessel, same, way_mm)
    alike = sum(went_alike(true.curves, a, b) for a, b in zip(ours, theirs))
    tips = np.array([np.linalg.norm(a.tip - b.tip) for a, b in zip(ours, theirs)])
    wires = np.concatenate([np.linalg.norm(a.wire - b.wire, axis=1) for a, b in zip(ours, theirs)])
    angle = np.degrees(np.arccos(np.clip(entry.direction @ same.direction, -1, 1)))
    row = (
        f"| {truth.scene.name} | {voxel_mm:g} | {_percentiles(truth.depth_mm(points))} | {_percentiles(scene.clearance_mm(wall))} "
        f"| {np.median(bias):+.2f}, {np.percentile(np.abs(bias), 95):.2f} | {found} of {len(true.curves)}, {false} false "
        f"| {np.linalg.norm(entry.point_mm - same.point_mm):.1f} mm, {angle:.0f} deg | {wires.mean():.2f}, {tips.mean():.2f} "
        f"| {alike} of {len(tips)} |"
    )
    # The table comes at the end; a run that is stopped shows the rows so far.
    print(f"{row} {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)
    return row


HEAD = (
    "| vessel | voxel, mm | surface to truth p50, p95, mm | truth to surface p50, p95, mm | radius median, p95, mm "
    "| branches | entry | wire, tip: mean distance, mm | runs in the same branch |\n|---|---|---|---|---|---|---|---|---|"
)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python3 -m torquer.importer.errors",
        description="Imports scans of known truth and prints the errors as a table: the lumen of a scene with bone, "
        f"partial volume, a blur of {BLUR_MM:g} mm and noise of {NOISE:g} HU.",
    )
    parser.add_argument("scenes", metavar="SCENE", nargs="*", default=["ty_phantom", "coronary"], help="scenes of Torquer, or files")
    parser.add_argument("--voxels", metavar="MM,..", default="0.4,0.7,1", help="voxel sizes, 0.2 to 2 mm (default: 0.4,0.7,1)")
    parser.add_argument("--entry", metavar="L,P,S", help="the wire enters at the end nearest to this place (default: as the import)")
    arguments = parser.parse_args()
    try:
        voxels = [float(word) for word in arguments.voxels.split(",")]
    except ValueError:
        voxels = []
    try:
        if not voxels or not all(0.2 <= voxel <= 2 for voxel in voxels):
            raise Error(f"--voxels {arguments.voxels}: give sizes from 0.2 to 2 mm, as 0.4,0.7,1")
        entry_mm = None if arguments.entry is None else point_of("--entry", arguments.entry)
        rows = [HEAD]
        for name in arguments.scenes:
            truth = Truth(Scene(name))
            true = reference(truth)
            wall = truth.wall_points(_WALL_POINTS)
            for voxel_mm in voxels:
                with tempfile.TemporaryDirectory() as folder:
                    rows.append(row_of(truth, true, wall, voxel_mm, pathlib.Path(folder), entry_mm))
    except Error as error:
        print(f"torquer.importer.errors: {error}", file=sys.stderr)
        return 2
    print("\n".join(rows))
    return 0


if __name__ == "__main__":
    sys.exit(_command.run("torquer.importer.errors", main))
