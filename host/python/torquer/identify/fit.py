"""Values of a scene fitted to measured ones by least squares, with their intervals."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import numpy.typing as npt

from .. import Error, _command
from .experiment import Experiment, split

Array = npt.NDArray[np.float64]
CONFIDENCE = 0.95
_FARTHEST = math.log(20)  # from the start
_MOST_ROUNDS = 8
# Largest over smallest singular value of the scaled derivatives. Above this, the data leave a key open.
_MOST_CONDITION = 1e5


def need(module: str) -> Any:
    """Imports a module of a Debian package that the command needs."""
    return _command.need("torquer-identify", module, {"scipy": "python3-scipy", "matplotlib": "python3-matplotlib"}[module.split(".")[0]])


@dataclasses.dataclass(frozen=True)
class Value:
    """A fitted value. A list of numbers has the factor of its start."""

    key: str
    start: float
    value: float
    low: Optional[float]
    """End of the interval of confidence; None if the measured values do not determine the key."""
    high: Optional[float]


@dataclasses.dataclass(frozen=True)
class Identification:
    """Result of a fit."""

    values: List[Value]
    correlation: Optional[List[List[float]]]
    """Between the keys, in their order; None if the measured values do not determine all of them."""
    noise: Dict[str, float]
    """Estimated standard deviation of each kind of measured value; of a shape in each coordinate, mm."""
    measured: int
    """Number of independent measured values."""
    snaps: List[int]
    """Lines of the table on the way to which the fitted wire snapped."""
    factors: List[float]
    residuals: Array


def identify(experiment: Experiment) -> Identification:
    """Fits the keys of an experiment to its measured values.

    Each kind of value has its own noise, which is estimated from its residuals in turn with the keys. The logarithms of
    the values are fitted. Their intervals are those of the linearized model, with Student's t. Raises Error if a key reaches 0.05 or 20 times its start.
    """
    scipy = need("scipy.optimize"), need("scipy.stats")
    parts = split(experiment.groups)
    logs = np.zeros(len(experiment.keys))
    residuals = experiment.residuals(np.exp(logs))
    noise = {name: _floored(float(np.sqrt(np.mean(residuals[at] ** 2)))) for name, (at, _) in parts.items()}
    for _ in range(_MOST_ROUNDS):
        scale = _scales(experiment, parts, noise)
        found = scipy[0].least_squares(
            lambda at: experiment.residuals(np.exp(at)) / scale, logs,
            jac=lambda at: experiment.jacobian(np.exp(at)) * np.exp(at) / scale[:, None],
            bounds=(-_FARTHEST, _FARTHEST), xtol=1e-5, ftol=1e-8, gtol=1e-10, max_nfev=40,
        )
        logs, slopes, residuals = found.x, found.jac * scale[:, None], found.fun * scale
        before, noise = noise, _noise(experiment, parts, residuals, slopes / scale[:, None])
        # One kind of value alone has the same fit for any noise.
        if len(noise) == 1 or all(abs(noise[name] - before[name]) <= 1e-2 * before[name] for name in noise):
            break
    factors = [float(one) for one in np.exp(logs)]
    for key, factor in zip(experiment.keys, factors):
        if abs(math.log(factor)) > 0.99 * _FARTHEST:
            raise Error(f"{experiment.table.path}: {key.key} runs to {key.at(factor)}, {factor:g} times its start; give another start, or check the table")
    weighted = slopes / _scales(experiment, parts, noise)[:, None]
    measured = round(sum(count for _, count in parts.values()))
    spread, correlation = _spread(weighted, float(scipy[1].t.ppf((1 + CONFIDENCE) / 2, measured - len(factors))))
    return Identification(
        values=[_named(key, factor, wide) for key, factor, wide in zip(experiment.keys, factors, spread)],
        correlation=correlation, noise=noise, measured=measured, snaps=experiment.run(factors)[1],
        factors=factors, residuals=residuals,
    )


def _floored(noise: float) -> float:
    """Noise above the rounding of the measured values, so that exact ones have a weight."""
    return max(noise, 1e-9)


def _scales(experiment: Experiment, parts: Dict[str, Tuple[Any, float]], noise: Dict[str, float]) -> Array:
    out = np.empty(len(experiment.groups))
    for name, (at, _) in parts.items():
        out[at] = noise[name]
    return out


def _noise(experiment: Experiment, parts: Dict[str, Tuple[Any, float]], residuals: Array, weighted: Array) -> Dict[str, float]:
    """Standard deviation of each kind of value. The fitted keys take freedom away where they have leverage."""
    orthogonal = np.linalg.svd(weighted, full_matrices=False)[0]
    leverage = (orthogonal**2).sum(axis=1)
    out = {}
    for name, (at, count) in parts.items():
        free = count - float(leverage[at].sum())
        if free < 0.5:
            raise Error(f"{experiment.table.path}: {name} has too few values for the keys; measure more, or vary fewer keys")
        out[name] = _floored(math.sqrt(float((residuals[at] ** 2).sum()) / free))
    return out


def _spread(weighted: Array, quantile: float) -> Tuple[List[Optional[float]], Optional[List[List[float]]]]:
    """Half of each interval of the logarithms, and the correlations; None where the values do not determine a key."""
    norms = np.linalg.norm(weighted, axis=0)
    if not (norms > 0).all():
        return [None] * len(norms), None
    _, singular, directions = np.linalg.svd(weighted / norms, full_matrices=False)
    open_ones = singular < singular[0] / _MOST_CONDITION
    if open_ones.any():
        loose = (np.abs(directions[open_ones]) > 1e-3).any(axis=0)
    else:
        loose = np.zeros(len(norms), bool)
    kept = np.where(open_ones, np.inf, singular)
    covariance = (directions.T / kept**2) @ directions / np.outer(norms, norms)
    deviations = np.sqrt(np.diag(covariance))
    half: List[Optional[float]] = [None if loose[k] else quantile * float(deviations[k]) for k in range(len(norms))]
    if loose.any():
        return half, None
    return half, (covariance / np.outer(deviations, deviations)).tolist()


def _named(key: Any, factor: float, half: Optional[float]) -> Value:
    start = 1.0 if isinstance(key.start, list) else float(key.start)
    if half is None:
        return Value(key.key, start, start * factor, None, None)
    low, high = sorted([start * factor * math.exp(-half), start * factor * math.exp(half)])
    return Value(key.key, start, start * factor, low, high)
