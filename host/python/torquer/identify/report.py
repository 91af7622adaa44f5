"""Tables and the picture of a fit."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
import pathlib
import tomllib
from typing import Any, Dict, List, Optional, Sequence, Union

import numpy as np

from .. import Scene, __build__, __version__
from .experiment import SHAPE, Experiment
from .fit import CONFIDENCE, Identification, need

RULES = (
    "The scene repeats the motion of the table in parts of at most 0.25 mm and 0.2 rad, each relaxed to 1e-8.",
    "Each kind of measured value has its own noise, estimated from the residuals. The values are those of least squares.",
    "A point of a shape is compared with the nearest point of the wire. It counts as two measured values.",
    "Derivatives are central differences of whole runs, so they include what friction keeps of the way.",
    f"An interval has a confidence of {100 * CONFIDENCE:g} % if the noise of all values is independent and the scene describes the experiment.",
    "Without an interval, the measured values do not determine the key.",
)
# Keys of a scene that name a file or a folder.
_PATHS = ("vessel.file", "vessel.centerlines", "effects.fluoroscopy.ct_file")


def _text(value: Optional[float]) -> str:
    return "-" if value is None else f"{value:.4g}"


def table(result: Identification) -> List[str]:
    """The fitted values as lines of Markdown."""
    lines = ["| key | start | value | from | to |", "|---|---|---|---|---|"]
    for one in result.values:
        lines.append(f"| {one.key} | {_text(one.start)} | {_text(one.value)} | {_text(one.low)} | {_text(one.high)} |")
    return lines


def as_markdown(result: Identification, origin: Dict[str, str]) -> str:
    lines = ["# Values fitted to measured ones", "", f"Intervals of {100 * CONFIDENCE:g} %; `-`: not known. A list of numbers has the factor of its start.", ""]
    lines += table(result)
    if result.correlation is not None and len(result.values) > 1:
        keys = [one.key for one in result.values]
        lines += ["", "## Correlation", "", "| | " + " | ".join(keys) + " |", "|---" * (len(keys) + 1) + "|"]
        lines += ["| " + " | ".join([key, *(f"{value:.2f}" for value in row)]) + " |" for key, row in zip(keys, result.correlation)]
    lines += ["", "## Noise", "", "| measured | standard deviation |", "|---|---|"]
    lines += [f"| {name} | {_text(noise)}{' mm in each coordinate' if name == SHAPE else ''} |" for name, noise in result.noise.items()]
    if result.snaps:
        lines += ["", f"The wire snapped on the way to the lines {', '.join(map(str, result.snaps))} of the table. The intervals hold only for values with the same snaps."]
    lines += ["", "## Rules", ""] + [f"- {rule}" for rule in RULES]
    lines += ["", "## Sources", ""] + [f"- {name}: `{value}`" for name, value in origin.items()]
    return "\n".join(lines) + "\n"


def as_json(result: Identification, origin: Dict[str, str]) -> str:
    everything = {
        "sources": origin, "rules": RULES, "confidence": CONFIDENCE, "values": [dataclasses.asdict(one) for one in result.values],
        "correlation": result.correlation, "noise": result.noise, "measured": result.measured, "snaps": result.snaps,
    }
    return json.dumps(everything, indent=1, allow_nan=False) + "\n"


def as_csv(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows)
    return out.getvalue()


def sources(experiment: Experiment, shapes: Optional[str]) -> Dict[str, str]:
    out = {"scene": experiment.scene.path, "scene_hash": f"{experiment.scene.content_hash:016x}"}
    for name, path in (("measured", experiment.table.path), ("shapes", shapes)):
        if path is not None:
            out[name] = path
            out[f"{name}_sha256"] = hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
    out["torquer"] = f"{__version__}, build {__build__}"
    return out


def _lines_of(experiment: Experiment) -> List[int]:
    """Line of the table of each residual."""
    out: List[int] = []
    for row in experiment.table.rows:
        out += [row.line] * (len(row.readings) + (0 if row.shape is None else 3 * len(row.shape)))
    return out


def picture(experiment: Experiment, result: Identification) -> bytes:
    """PNG of the residuals of each kind of measured value, over the rows of the table."""
    need("matplotlib").use("Agg")
    names = list(result.noise)
    figure = need("matplotlib.figure").Figure(figsize=(9, 2.2 * len(names) + 0.6), dpi=100, layout="constrained")
    groups, lines = np.array(experiment.groups), np.array(_lines_of(experiment))
    for k, name in enumerate(names, 1):
        axes = figure.add_subplot(len(names), 1, k)
        at = groups == name
        axes.axhspan(-2 * result.noise[name], 2 * result.noise[name], color="0.92")
        axes.axhline(0, color="0.6", linewidth=0.8)
        axes.plot(lines[at], result.residuals[at], "k.", markersize=4)
        axes.set_title(name + (" (each coordinate), mm" if name == SHAPE else ""), fontsize="medium", loc="left")
        axes.set_ylabel("simulated - measured")
    axes.set_xlabel("line of the table (the band is twice the noise)")
    out = io.BytesIO()
    figure.savefig(out, format="png", metadata={"Software": None})
    return out.getvalue()


def movable(scene: Scene) -> Scene:
    """The scene with absolute paths of the files and folders that it names, so that it loads from any folder."""
    table = tomllib.loads(scene.text)
    folder = pathlib.Path(scene.folder).absolute()
    changed: Dict[str, Any] = {}
    for key in _PATHS:
        value: Any = table
        for part in key.split("."):
            value = value.get(part, {})
        if value:
            changed[key] = str(folder / value)
    return scene.with_values(changed)


def files(experiment: Experiment, result: Identification, origin: Dict[str, str]) -> Dict[str, Union[str, bytes]]:
    """Contents of the result's files by their names."""
    slopes = experiment.sensitivities(result.factors)
    return {
        "table.md": as_markdown(result, origin),
        "table.json": as_json(result, origin),
        "table.csv": as_csv(["key", "start", "value", "from", "to"], [list(dataclasses.astuple(one)) for one in result.values]),
        "residuals.csv": as_csv(["line", "measured", "residual"], list(zip(_lines_of(experiment), experiment.groups, result.residuals.tolist()))),
        "sensitivities.csv": as_csv(["line", "reading", "key", "derivative"], [list(one.values()) for one in slopes]),
        "fitted.toml": movable(experiment.scene_at(result.factors)).text,
        "residuals.png": picture(experiment, result),
    }
