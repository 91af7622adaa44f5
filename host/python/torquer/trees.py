"""Random trees of arteries that divide again and again, for the training of policies.

    import torquer.trees

    scene = torquer.trees.draw(7)                      # by the seed
    scene = torquer.trees.draw(7, generations=2)
    env = torquer.trees.make()                         # another tree at each reset
    many = torquer.trees.make_vec(64)                  # another tree in each lane and at each reset, in threads

"trunk" divides into "a", the wider branch, and "b". Those of "a" are "aa" and "ab", and so on. At each division, radii
obey Murray's law: the cube of the parent's radius is the sum of the cubes of its branches' radii (Murray 1926,
10.1073/pnas.12.3.207). The angles are those of the least work (Murray 1926, 10.1085/jgp.9.6.835), each changed by up to
15 %. No branch touches another one, except beside a division. Sizes and lengths are our own choice; no patient has these
vessels. A guidewire enters the trunk, which begins at the origin along z. Coordinates are in mm.
"""

from __future__ import annotations

import functools
import math
from typing import List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Scene
from ._anatomies import SceneDraw, drawn, generator_of, tube_text
from ._navigation import End, Observation, Reward, Task, whole
from ._vector import VectorEnv
from .envs import NavigationEnv

GENERATIONS = 3
"""Divisions from the trunk to an end."""
_MOST = 4

_TRUNK_MM = 40.0
_TRUNK_RADIUS_MM = (2.6, 3.2)
_LENGTH_MM = (24.0, 34.0)
_RATIO = (0.75, 1.0)  # of the radii of the two branches
_ANGLE = (0.85, 1.15)  # of the angle of the least work
_BEND = 0.2  # standard deviation of each coordinate of a branch's second direction
_ROOM_MM = 1.0  # between two lumens
_BESIDE_MM = 9.0  # branches may touch that near to their division
_STEP_MM = 3.0  # between the points of two branches that are compared
_TRIES = 40

Points = npt.NDArray[np.float64]


class _Branch:
    def __init__(self, name: str, corners: Points, radius_mm: float) -> None:
        self.name = name
        self.corners = corners
        self.radius_mm = radius_mm
        parts = [np.linspace(a, b, 1 + math.ceil(np.linalg.norm(b - a) / _STEP_MM)) for a, b in zip(corners, corners[1:])]
        self.places: Points = np.vstack(parts)

    def way(self) -> Points:
        """Direction at the end."""
        return _unit(self.corners[-1] - self.corners[-2])

    def is_clear_of(self, other: _Branch, division: Points) -> bool:
        """True if the lumens have room between them, except beside a division of the tree."""
        near, far = (
            one.places[np.linalg.norm(one.places - division, axis=1) > _BESIDE_MM] for one in (self, other)
        )
        gaps = np.linalg.norm(near[:, None] - far[None], axis=2)
        return bool(gaps.min(initial=math.inf) > self.radius_mm + other.radius_mm + _ROOM_MM)


def _unit(way: Points) -> Points:
    out: Points = way / np.linalg.norm(way)
    return out


def _angle(parent_mm: float, own_mm: float, other_mm: float) -> float:
    """Angle between a branch and its parent, for the least work of flow and blood."""
    return math.acos(min(1.0, (parent_mm**4 + own_mm**4 - other_mm**4) / (2 * parent_mm**2 * own_mm**2)))


def _division(random: np.random.Generator, parent: _Branch) -> Tuple[_Branch, _Branch]:
    """Two branches, the wider one first."""
    ratio = random.uniform(*_RATIO)
    wider_mm = parent.radius_mm / (1 + ratio**3) ** (1 / 3)
    radii_mm = (wider_mm, ratio * wider_mm)
    side = _unit(np.cross(parent.way(), random.normal(size=3)))
    start = parent.corners[-1]
    made = []
    for k, letter in enumerate("ab"):
        angle = _angle(parent.radius_mm, radii_mm[k], radii_mm[1 - k]) * random.uniform(*_ANGLE)
        half_mm = random.uniform(*_LENGTH_MM) / 2
        first = math.cos(angle) * parent.way() + (-1) ** k * math.sin(angle) * side
        second = _unit(first + random.normal(0.0, _BEND, 3))
        corners = np.array([start, start + half_mm * first, start + half_mm * (first + second)])
        made.append(_Branch(parent.name.replace("trunk", "") + letter, corners, radii_mm[k]))
    return made[0], made[1]


def _is_clear(pair: Tuple[_Branch, _Branch], others: Sequence[_Branch]) -> bool:
    """True if two new branches are clear of each other and of all others."""
    division = pair[0].corners[0]
    return pair[0].is_clear_of(pair[1], division) and all(
        one.is_clear_of(other, division) for one in pair for other in others
    )


def _grown(random: np.random.Generator, generations: int) -> Optional[List[_Branch]]:
    """Branches of a tree. None if there was no room for one of them."""
    corners = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, _TRUNK_MM]])
    branches = [_Branch("trunk", corners, random.uniform(*_TRUNK_RADIUS_MM))]
    for parent in branches:
        if parent.name != "trunk" and len(parent.name) == generations:
            break
        pairs = (_division(random, parent) for _ in range(_TRIES))
        pair = next((one for one in pairs if _is_clear(one, branches)), None)
        if pair is None:
            return None
        branches += pair
    return branches


_REST = """
[entry]
centerline = "trunk"
at_mm = 2

[[instrument]]
name = "guidewire"
max_length_mm = 220
inserted_at_start_mm = 20
radius_mm = 0.1778
tip_mm = 10
tip_angle_deg = 60
rigidity_N_mm2 = [0.3, 0.3, 15]
from_tip_mm = [0, 10, 60]
"""


def _ends(generations: int) -> List[str]:
    names = [""]
    for _ in range(generations):
        names = [name + letter for name in names for letter in "ab"]
    return names


def _checked(generations: int) -> int:
    return whole("generations", generations, 1, _MOST)


def task(generations: int = GENERATIONS) -> Task:
    """Targets in all ends of a tree, 10 to 20 mm behind their divisions."""
    first, *others = ((name, 10.0, 20.0) for name in _ends(_checked(generations)))
    return Task(first[0], first[2], within_mm=2.0, longest_mm=1.0, other_targets=(first, *others))


_task = task  # for functions with an argument of that name


def draw(seed: Union[int, np.random.Generator], generations: int = GENERATIONS) -> Scene:
    """Scene of a random tree. The same seed and generations give the same scene."""
    _checked(generations)
    random = generator_of(seed)
    branches = None
    while branches is None:
        branches = _grown(random, generations)
    text = [f'name = "tree_{generations}"\n[vessel]\nkind = "tubes"\nwall_stiffness_N_mm2 = 5\nunion_width_mm = 1\n']
    for branch in branches:
        text.append(tube_text(branch.name, list(branch.corners), [branch.radius_mm] * len(branch.corners), 15.0))
    return Scene.from_text("".join(text) + _REST)


def _drawn(generations: int, count: Optional[int]) -> SceneDraw:
    return drawn(functools.partial(draw, generations=_checked(generations)), count)


def make(
    generations: int = GENERATIONS,
    task: Optional[Task] = None,
    observation: Observation = "vector",
    render_mode: Optional[str] = None,
    reward: Optional[Reward] = None,
    end: Optional[End] = None,
    count: Optional[int] = None,
) -> NavigationEnv:
    """Environment with another tree at each reset, by the seed. task: None: that of task(). count: None: each reset draws
    a new tree; otherwise one of so many, which are kept, and then cost no more time."""
    scenes = _drawn(generations, count)
    return NavigationEnv(scenes, task or _task(generations), observation, render_mode, reward, end)


def make_vec(
    num_envs: int = 1,
    generations: int = GENERATIONS,
    task: Optional[Task] = None,
    observation: Observation = "vector",
    threads: Optional[int] = None,
    copy: bool = True,
    reward: Optional[Reward] = None,
    end: Optional[End] = None,
    count: Optional[int] = None,
) -> VectorEnv:
    """Environments in threads, each with another tree at each reset, by its seed. task and count: as in make()."""
    scenes = _drawn(generations, count)
    return VectorEnv(scenes, num_envs, threads, observation, task or _task(generations), copy, reward, end)
