"""Scenes that an environment draws, another one for each episode."""

from __future__ import annotations

import functools
from typing import Any, Callable, Dict, Optional, Sequence

import numpy as np

from . import Error, Scene
from ._names import shown
from ._navigation import Observation, Prepared, Task, whole

SceneDraw = Callable[[np.random.Generator], Scene]
"""Random scenes of an environment."""
# Bounds of observations over those that the first of the scenes needs.
_ROOM = 2.0


class Anatomies:
    """Scenes of a function, each prepared for the episodes of a task."""

    def __init__(self, draw: SceneDraw, task: Task, observation: Observation, sees: bool) -> None:
        self.draw = draw
        self._given = (task, observation, sees)
        self.first = Prepared(draw(np.random.default_rng(0)), *self._given)
        self.space = self.first.observation_space(_ROOM)

    def __getstate__(self) -> Dict[str, Any]:
        # The first scene is for the beginning only, and is not pickled.
        return {name: value for name, value in self.__dict__.items() if name != "first"}

    def prepare(self, random: np.random.Generator) -> Prepared:
        """Draws a scene. Raises Error if the bounds of observations do not contain its own."""
        prepared = Prepared(self.draw(random), *self._given)
        if not prepared.fits(self.space):
            raise Error(
                f"{prepared.scene.name} has observations outside the bounds of the first scene that was drawn, which are "
                f"{_ROOM:g} times as wide as that scene needs; draw scenes of a similar size with the same instruments"
            )
        return prepared


def next_seed(random: np.random.Generator) -> int:
    """Seed of the scene of the next episode. It is known at the start of this one, so that a thread can prepare the scene
    meanwhile."""
    return int(random.integers(2**63))


def draw_kept(draw: Callable[[int], Scene], random: np.random.Generator, count: int) -> Scene:
    """One of the scenes of the seeds 0 to count - 1."""
    return draw(int(random.integers(count)))


def drawn(draw: Callable[[Any], Scene], count: Optional[int]) -> SceneDraw:
    """Function that draws a new scene for each episode, or one of `count` scenes, which are kept. Each is built once."""
    if count is None:
        return draw
    count = whole("count", count, 1, 10_000)
    return functools.partial(draw_kept, Kept(draw), count=count)


class Kept:
    """Scenes by their seeds, each of which is drawn once."""

    def __init__(self, draw: Callable[[Any], Scene]) -> None:
        self._draw = draw
        self._scenes = functools.lru_cache(maxsize=None)(draw)

    def __call__(self, seed: int) -> Scene:
        return self._scenes(seed)

    def __reduce__(self) -> Any:
        return Kept, (self._draw,)


def generator_of(seed: Any) -> np.random.Generator:
    """Generator of a seed that a user gave, or that generator itself."""
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise Error(f"seed is {shown(seed)}; give a whole number from 0 on, or a numpy.random.Generator") from None


def numbers(values: Any) -> str:
    """Numbers, or lists of them, as TOML."""
    return "[" + ", ".join(numbers(value) for value in values) + "]" if np.ndim(values) else f"{float(values):.4f}"


def tube_text(name: str, points_mm: Sequence[Any], radii_mm: Sequence[float], bend_mm: float) -> str:
    """A tube of a vessel as TOML."""
    return (
        f'[[vessel.tube]]\nname = "{name}"\npoints_mm = {numbers(points_mm)}\n'
        f"radii_mm = {numbers(radii_mm)}\nbend_radius_mm = {numbers(bend_mm)}\n"
    )
