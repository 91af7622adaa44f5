"""Page about a batch: one HTML file that needs no other files."""

from __future__ import annotations

import html
import importlib
import io
import math
import statistics
from typing import Any, Dict, List, Sequence, Tuple

from ._batch_study import Study

_MOST_PLOTS = 6
_MOST_LISTED = 200
# Fewer values of a random key show no trend.
_FEWEST_DRAWN = 6
# Readings about the computation of a case, not about its result.
_WORK = ("rows", "ticks", "iterations", "unconverged_rows", "solver_error_mm", "state_hash")
_COLORS = ("#1b6ca8", "#c8553d", "#3b7d4f", "#7a5195", "#b8860b", "#4a4a4a")

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1c2530; }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2rem }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
td, th { border-bottom: 1px solid #d5dbe1; padding: .25rem .8rem .25rem 0; text-align: left; vertical-align: top }
td.number, th.number { text-align: right }
.plots { display: grid; grid-template-columns: repeat(auto-fill, minmax(24rem, 1fr)); gap: 1rem }
.plots svg { width: 100%; height: auto }
.failed { color: #a11 }
@media print { body { margin: 0; max-width: none } }
"""


def name(labels: Dict[str, Any]) -> str:
    """Name of a case, in one line."""
    return ", ".join(f"{key} = {value}" if key not in ("scene", "motion") else str(value) for key, value in labels.items())


def marked(readings: Dict[str, Any]) -> Dict[str, Any]:
    """Readings of a case with the reason why it is not valid, such as a row that did not converge. Empty for a valid
    case."""
    reasons = []
    if readings.get("outside_lumen"):
        reasons.append("outside the lumen")
    if readings.get("unconverged_rows", 0) > 0:
        reasons.append("not converged")
    return {"invalid": ", ".join(reasons), **readings}


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _text(value: Any) -> str:
    if value is None:
        return "not known"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    def cells(row: Sequence[Any], kind: str) -> str:
        made = []
        for index, value in enumerate(row):
            number = ' class="number"' if index > 0 and all(_is_number(other[index]) for other in rows) else ""
            made.append(f"<{kind}{number}>{html.escape(_text(value))}</{kind}>")
        return f"<tr>{''.join(made)}</tr>"

    return f"<table>{cells(head, 'th')}{''.join(cells(row, 'td') for row in rows)}</table>"


def _varying(rows: List[Dict[str, Any]], labels: Sequence[str]) -> List[str]:
    """Readings that differ between cases."""
    found: List[str] = []
    for key in dict.fromkeys(key for row in rows for key in row):
        values = [row[key] for row in rows if _is_number(row.get(key))]
        if key not in labels and key not in _WORK and len(values) > 1 and max(values) > min(values):
            found.append(key)
    return found


def _groups(rows: List[Dict[str, Any]], axis: str, reading: str) -> Dict[Any, List[float]]:
    groups: Dict[Any, List[float]] = {}
    for row in rows:
        if _is_number(row.get(reading)) and axis in row:
            groups.setdefault(row[axis] if not isinstance(row[axis], list) else str(row[axis]), []).append(row[reading])
    return groups


def _explained(rows: List[Dict[str, Any]], axis: str, reading: str, drawn: bool) -> float:
    """Fraction of a reading's variance that an axis explains, 0 to 1: mean over scenes and motions."""
    kinds: Dict[Tuple[str, str], List[Dict[str, Any]]] = {}
    for row in rows:
        kinds.setdefault((row["scene"], row["motion"]), []).append(row)
    return statistics.fmean(_explained_of_kind(kind, axis, reading, drawn) for kind in kinds.values())


def _explained_of_kind(rows: List[Dict[str, Any]], axis: str, reading: str, drawn: bool) -> float:
    if drawn:
        pairs = [(row[axis], row[reading]) for row in rows if _is_number(row.get(reading))]
        if len({x for x, _ in pairs}) < _FEWEST_DRAWN:
            return 0
        try:
            return statistics.correlation([x for x, _ in pairs], [y for _, y in pairs]) ** 2
        except statistics.StatisticsError:
            return 0
    groups = list(_groups(rows, axis, reading).values())
    every = [value for group in groups for value in group]
    if len(groups) < 2 or statistics.pvariance(every) == 0:
        return 0
    inside = sum(len(group) * statistics.pvariance(group) for group in groups) / len(every)
    return 1 - inside / statistics.pvariance(every)


def _pyplot() -> Any:
    """Raises ImportError without matplotlib."""
    importlib.import_module("matplotlib").use("Agg")
    return importlib.import_module("matplotlib.pyplot")


def _plot(rows: List[Dict[str, Any]], axis: str, reading: str, drawn: bool) -> str:
    """Plots a reading against an axis: the mean for each motion and scene, and all cases as points."""
    plt = _pyplot()
    figure, axes = plt.subplots(figsize=(5, 3.4), layout="constrained")
    kinds = sorted({(row["scene"], row["motion"]) for row in rows})
    for index, kind in enumerate(kinds):
        color = _COLORS[index % len(_COLORS)]
        of_kind = [row for row in rows if (row["scene"], row["motion"]) == kind]
        label = ", ".join(kind)
        if drawn:
            points = [(row[axis], row[reading]) for row in of_kind if _is_number(row.get(reading))]
            axes.scatter([x for x, _ in points], [y for _, y in points], s=12, color=color, label=label)
            continue
        groups = _groups(of_kind, axis, reading)
        places = list(groups) if all(_is_number(value) for value in groups) else list(range(len(groups)))
        axes.plot(places, [statistics.fmean(values) for values in groups.values()], color=color, label=label)
        for place, values in zip(places, groups.values()):
            axes.scatter([place] * len(values), values, s=8, alpha=0.5, color=color)
        if places != list(groups):
            axes.set_xticks(places, [str(value) for value in groups], rotation=20, ha="right")
    axes.set(xlabel=axis, ylabel=reading)
    axes.grid(alpha=0.3)
    if 1 < len(kinds) <= len(_COLORS):
        axes.legend(fontsize="small")
    return _svg(figure)


def _spread(rows: List[Dict[str, Any]], reading: str) -> str:
    """Histogram of a reading."""
    plt = _pyplot()
    figure, axes = plt.subplots(figsize=(5, 3.4), layout="constrained")
    kinds = sorted({(row["scene"], row["motion"]) for row in rows})
    values = [[row[reading] for row in rows if (row["scene"], row["motion"]) == kind and _is_number(row.get(reading))] for kind in kinds]
    bins = min(40, max(5, round(len(rows) ** 0.5)))
    colors = [_COLORS[index % len(_COLORS)] for index in range(len(kinds))]
    axes.hist(values, bins=bins, stacked=True, color=colors, label=[", ".join(kind) for kind in kinds])
    axes.set(xlabel=reading, ylabel="cases")
    if 1 < len(kinds) <= len(_COLORS):
        axes.legend(fontsize="small")
    return _svg(figure)


def _svg(figure: Any) -> str:
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    _pyplot().close(figure)
    text = out.getvalue()
    return text[text.index("<svg") :]


def _plots(study: Study, rows: List[Dict[str, Any]], readings: List[str]) -> str:
    ranked: List[Tuple[float, str, str, bool]] = []
    for axis in [*study.axes, *study.random]:
        drawn = axis in study.random
        for reading in readings:
            explained = _explained(rows, axis, reading, drawn)
            if explained > 0.05:
                ranked.append((explained, axis, reading, drawn))
    # Each reading appears once, against the axis that explains it best.
    best: Dict[str, Tuple[float, str, str, bool]] = {}
    for entry in sorted(ranked, key=lambda entry: -entry[0]):
        best.setdefault(entry[2], entry)
    chosen = list(best.values())[:_MOST_PLOTS]
    if not readings:
        return "<p>All cases have the same readings.</p>"
    try:
        drawings = [_plot(rows, axis, reading, drawn) for _, axis, reading, drawn in chosen]
        # Histograms if no axis explains a reading, as with only seeds and motions.
        drawings = drawings or [_spread(rows, reading) for reading in readings[:_MOST_PLOTS]]
    except ImportError:
        return "<p>Plots need the package python3-matplotlib: install it and run the command again.</p>"
    return f'<div class="plots">{"".join(f"<div>{drawing}</div>" for drawing in drawings)}</div>'


def _left_out(study: Study, invalid: int) -> str:
    if invalid == 0:
        return ""
    if study.plots == "all":
        return f"These {invalid} cases are not valid, but plots and readings below have them. "
    return (
        f"These {invalid} cases are not valid, so plots and readings below leave them out; "
        'plots = "all" in the study shows them. '
    )


def page(study: Study, rows: List[Dict[str, Any]], failures: List[Dict[str, Any]]) -> str:
    """Page about the stored cases, and about those that failed in the last run."""
    labels = ["scene", "motion", "seed", *study.axes, *study.random]
    readings = _varying(rows, labels)
    varied: List[Tuple[str, str]] = [("scene", ", ".join(sorted({row["scene"] for row in rows}) or study.scenes))]
    varied.append(("motion", ", ".join(motion["name"] for motion in study.motions)))
    varied += [(axis, ", ".join(map(str, values))) for axis, values in study.axes.items()]
    varied += [(key, f"{low:g} to {high:g}, drawn") for key, (low, high) in study.random.items()]
    if len(study.seeds) > 1:
        varied.append(("seed", f"{len(study.seeds)} seeds"))
    unconverged = sum(1 for row in rows if row.get("unconverged_rows", 0) > 0)
    outside = sum(1 for row in rows if row.get("outside_lumen"))
    stored = len(rows)
    invalid = sum(1 for row in rows if row["invalid"])
    if study.plots == "valid":
        rows = [row for row in rows if not row["invalid"]]
        readings = _varying(rows, labels)

    parts = [f"<h1>{html.escape(study.path.stem)}</h1>"]
    parts.append(f"<p>{stored} of {study.count()} cases are stored.")
    if failures:
        parts.append(f' <span class="failed">{len(failures)} failed in the last run.</span>')
    parts.append(
        f" In {unconverged} some row did not converge; in {outside} the wire was outside the lumen at some time. "
        f"{_left_out(study, invalid)}"
        "All readings are in <code>readings.csv</code>, series and shapes in <code>shapes</code>, by the cases' keys in <code>readings.jsonl</code>.</p>"
    )
    parts.append("<h2>Varied keys</h2>" + _table(("key", "values"), varied))
    if rows:
        parts.append("<h2>Effect on the readings</h2>" + _plots(study, rows, readings))
        summary = []
        for key in readings:
            values = sorted(row[key] for row in rows if _is_number(row.get(key)))
            summary.append((key, float(values[0]), float(statistics.median(values)), float(values[-1])))
        if summary:
            parts.append("<h2>Readings</h2><p>Values of the last row of each case; <code>largest.</code>: largest value of all its rows.</p>")
            parts.append(_table(("reading", "lowest", "median", "highest"), summary))
    if failures:
        listed = [(name(failure["case"]), failure["message"]) for failure in failures[:_MOST_LISTED]]
        parts.append("<h2>Failures</h2>" + _table(("case", "message"), listed))
        if len(failures) > _MOST_LISTED:
            parts.append(f"<p>{len(failures) - _MOST_LISTED} more are in <code>failures.jsonl</code>.</p>")
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        f"<title>{html.escape(study.path.stem)}: a batch</title><style>{_STYLE}</style></head>"
        f"<body>{''.join(parts)}</body></html>\n"
    )
