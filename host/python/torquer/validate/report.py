"""Tables and pictures of a comparison."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
import pathlib
import re
import statistics
from typing import Any, Dict, List, Optional, Union

import numpy as np

from .. import Scene, __build__, __version__
from ._base import need
from .fit import ALIKE, APART_MM, HOLD_N_MM, LONGER, METHODS, REFINED_DEG, ROTATIONS, Fit, Row
from .paths import Lumen

RULES = (
    "The points of a shape have the numbers 0, 1, 2, .. in the order of the file. The even ones choose a fit, the odd ones "
    "give its figures. The last point, the tip, is in neither half: it gives the measured length and the goal of the ways.",
    "A smooth curve through the even points and the tip gives length, entry, direction and noise. The entry is its first "
    "place where the wire has 0.2 mm of room, there and over the next 2 mm. Its direction is taken over the next 10 mm. All points behind the entry are compared.",
    f"The rotation is searched on a grid of {ROTATIONS} and at {REFINED_DEG[0]:+g} and {REFINED_DEG[1]:+g} degrees from the best one. "
    f"The inserted length is the measured one, and longer by {', '.join(f'{100 * more:g}' for more in LONGER[1:])} %. "
    "The fit has the least RMS distance from the even points.",
    "A distance is between a measured point and the point of the wire at the same fraction of the length from the entry. "
    "nearest_rms_mm uses distances to the nearest points of the wire instead.",
    "A run is refused if the wire is shorter than the measured length by more than the noise of both ends (at most 1 %), if it "
    "is outside the lumen, or if it did not converge.",
    f"wire_held: a spring of {HOLD_N_MM:g} N/mm holds the tip at the measured tip, moved into the lumen if it lies outside. "
    "hold_mN is the force of the spring: 0 would be an equilibrium without it.",
    f"Other runs have the inserted length of the fit and all rotations; for wire_pushed and wire_laid, both are counted. "
    f"apart_runs differ from the fit by more than {APART_MM:g} mm somewhere. equilibria counts shapes that are so far apart. "
    "other_branch_runs end farther from the measured tip, through the lumen, than 5 mm and 4 radii of the lumen. "
    f"alike_runs are apart, and their RMS distance from the even points is at most {ALIKE:g} times that of the fit.",
    "middle, shortest: ways through the lumen from the entry to the measured tip, without a model of a wire.",
)
_FIGURES = ("rms_mm", "nearest_rms_mm", "largest_mm", "tip_mm")
_COLORS = {"wire_pushed": "tab:orange", "wire_laid": "tab:green", "wire_held": "tab:red", "middle": "0.5", "shortest": "tab:purple"}
_DOTS = 20_000


def summary(fits: List[Fit]) -> List[Dict[str, Any]]:
    """Medians over the shapes, for each method."""
    out = []
    for method in METHODS:
        rows = [row for fit in fits for row in fit.rows if row.method == method]
        good = [row for row in rows if not row.refused]
        medians = {name: statistics.median(getattr(row, name) for row in good) if good else None for name in _FIGURES}
        out.append({"method": method, "shapes": len(good), "refused": len(rows) - len(good), **medians})
    return out


def sources(scene: Scene, shapes: str) -> Dict[str, str]:
    return {
        "scene": scene.path,
        "scene_hash": f"{scene.content_hash:016x}",
        "shapes": shapes,
        "shapes_sha256": hashlib.sha256(pathlib.Path(shapes).read_bytes()).hexdigest(),
        "torquer": f"{__version__}, build {__build__}",
        "command": f"torquer-validate --scene {scene.path} --shapes {shapes} --out FOLDER",
    }


def as_csv(fits: List[Fit]) -> str:
    out = io.StringIO()
    names = [field.name for field in dataclasses.fields(Row)]
    table = csv.writer(out, lineterminator="\n")
    table.writerow(names)
    for fit in fits:
        for row in fit.rows:
            table.writerow(["" if getattr(row, name) is None else getattr(row, name) for name in names])
    return out.getvalue()


def as_json(fits: List[Fit], origin: Dict[str, str]) -> str:
    everything = {
        "sources": origin,
        "rules": RULES,
        "methods": METHODS,
        "rows": [dataclasses.asdict(row) for fit in fits for row in fit.rows],
        "medians": summary(fits),
    }
    return json.dumps(everything, indent=1, allow_nan=False) + "\n"


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value).replace("|", "\\|")


def _markdown_table(names: List[str], rows: List[List[Any]]) -> List[str]:
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    return lines + ["| " + " | ".join(map(_cell, row)) + " |" for row in rows]


def as_markdown(fits: List[Fit], origin: Dict[str, str]) -> str:
    names = [field.name for field in dataclasses.fields(Row)]
    shown = [name for name in names if name != "refused"]
    medians = summary(fits)
    lines = ["# Wire beside measured shapes", "", "Lengths in mm. `-`: not known, or not asked for.", "", "## Medians over the shapes", ""]
    lines += _markdown_table(list(medians[0]), [list(row.values()) for row in medians])
    lines += ["", "## Shapes", ""]
    lines += _markdown_table(shown, [[getattr(row, name) for name in shown] for fit in fits for row in fit.rows])
    refused = [row for fit in fits for row in fit.rows if row.refused]
    if refused:
        lines += ["", "## Refused", ""]
        lines += _markdown_table(["shape", "method", "reason"], [[row.shape, row.method, row.refused] for row in refused])
    lines += ["", "## Methods", ""] + _markdown_table(["method", "meaning"], [[name, said] for name, said in METHODS.items()])
    lines += ["", "## Rules", ""] + [f"- {rule}" for rule in RULES]
    lines += ["", "## Sources", ""] + [f"- {name}: `{value}`" for name, value in origin.items()]
    return "\n".join(lines) + "\n"


def picture(fit: Fit, lumen: Optional[Lumen]) -> bytes:
    """PNG of a shape and its wires in two projections. The lumen is a shadow of its places."""
    need("matplotlib").use("Agg")
    figure = need("matplotlib.figure").Figure(figsize=(12, 6), dpi=100, layout="constrained")
    points = fit.shape.points
    sizes = np.ptp(points, axis=0)
    up = int(sizes.argmax())
    across = [axis for axis in range(3) if axis != up]
    low, high = points.min(axis=0) - 15, points.max(axis=0) + 15
    for k, axis in enumerate(across, 1):
        axes = figure.add_subplot(1, 2, k, aspect="equal")
        if lumen is not None:
            near = lumen.places[((lumen.places > low) & (lumen.places < high)).all(axis=1)]
            near = near[:: max(1, len(near) // _DOTS)]
            axes.plot(near[:, axis], near[:, up], ",", color="0.85")
        for method, curve in fit.curves.items():
            axes.plot(curve[:, axis], curve[:, up], color=_COLORS[method], linewidth=1, label=method)
        axes.plot(points[:, axis], points[:, up], "k.", markersize=4, label="measured")
        if fit.entry_mm is not None:
            axes.plot(fit.entry_mm[axis], fit.entry_mm[up], "k^", label="entry")
        axes.set_xlabel(f"{'xyz'[axis]}, mm")
        axes.set_ylabel(f"{'xyz'[up]}, mm")
    axes.legend(fontsize="small")
    figure.suptitle(fit.shape.name)
    out = io.BytesIO()
    figure.savefig(out, format="png", metadata={"Software": None})
    return out.getvalue()


def files(fits: List[Fit], lumen: Optional[Lumen], origin: Dict[str, str]) -> Dict[str, Union[str, bytes]]:
    """Contents of the result's files by their names."""
    out: Dict[str, Union[str, bytes]] = {
        "table.csv": as_csv(fits), "table.json": as_json(fits, origin), "table.md": as_markdown(fits, origin),
    }
    for number, fit in enumerate(fits):
        name = re.sub(r"[^A-Za-z0-9_.-]", "_", fit.shape.name)
        out[f"shape_{number:03}_{name}.png"] = picture(fit, lumen)
    return out


