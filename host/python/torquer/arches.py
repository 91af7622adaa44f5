"""Random aortic arches with the vessels of head and arms, of the types I to III and bovine.

    import torquer.arches

    scene = torquer.arches.draw(7)                     # any type, by the seed
    scene = torquer.arches.draw(7, types=["III"])
    env = torquer.arches.make()                        # another arch at each reset
    many = torquer.arches.make_vec(64)                 # another arch in each lane and at each reset, in threads

The type is the distance of the origin of the brachiocephalic trunk below the top of the arch, both on the outer wall:
less than one diameter of the left common carotid artery (I), one to two (II), or more (III). In a bovine arch, that
artery begins at the trunk. Courses and ranges are our own choice; no patient has these vessels. x points to the left, y
to the back, z to the head, in mm. A guidewire enters from the descending aorta.
"""

from __future__ import annotations

import functools
import math
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene
from ._anatomies import SceneDraw, drawn, generator_of, tube_text
from ._names import did_you_mean, first_unknown, shown
from ._navigation import End, Observation, Reward, Task
from ._vector import VectorEnv
from .envs import NavigationEnv

TYPES = ("I", "II", "III", "bovine")
TASK = Task("lcca", 60.0, other_targets=(("lcca", 40.0, 80.0), ("rcca", 20.0, 70.0), ("lsa", 30.0, 60.0)))
"""Places in the left and right common carotid and the left subclavian artery."""

# Distance of the trunk's origin below the top, in diameters of the left common carotid artery.
_DROPS = {"I": (0.3, 0.9), "II": (1.1, 1.9), "III": (2.1, 3.0), "bovine": (0.3, 1.9)}

Point = npt.NDArray[np.float64]


class _Arch:
    """Half circle of the aorta's axis, from the ascending part over the top to the descending part."""

    def __init__(self, random: np.random.Generator) -> None:
        self.radius_mm = random.uniform(27.0, 34.0)
        self.lumen_mm = random.uniform(12.0, 14.5)
        slope = random.uniform(0.3, 0.8)  # of its plane, to the back
        self.across: Point = np.array([math.cos(slope), math.sin(slope), 0.0])
        self.middle: Point = np.array([0.0, 0.0, 60.0])

    def place(self, angle_rad: float, beyond_mm: float = 0.0) -> Point:
        """Point of the axis, or `beyond_mm` outside of it. angle_rad: from the top to the ascending part."""
        reach_mm = self.radius_mm + beyond_mm
        out: Point = self.middle + reach_mm * (math.cos(angle_rad) * np.array([0, 0, 1.0]) - math.sin(angle_rad) * self.across)
        return out

    def angle_at(self, drop_mm: float) -> float:
        """Angle of the place on the outer wall that is `drop_mm` below the top."""
        return math.acos(1 - drop_mm / (self.radius_mm + self.lumen_mm))

    def tube(self) -> Dict[str, Any]:
        head: Point = np.array([0.0, 0.0, 1.0])
        left, right = self.middle + self.radius_mm * self.across, self.middle - self.radius_mm * self.across
        corners = [left - 160 * head, left + self.radius_mm * head, right + self.radius_mm * head, right - 60 * head]
        radii = [0.85 * self.lumen_mm, self.lumen_mm, self.lumen_mm, 1.1 * self.lumen_mm]
        return _tube("aorta", corners, radii, self.radius_mm)


def _tube(name: str, points: Sequence[Point], radii: Sequence[float], bend_mm: float) -> Dict[str, Any]:
    return {"name": name, "points_mm": points, "radii_mm": radii, "bend_radius_mm": bend_mm}


def _branch(
    random: np.random.Generator, name: str, start: Point, out: Point, ways: Sequence[Tuple[float, float, float]], radius_mm: float
) -> Dict[str, Any]:
    """A tube from `start` over `out` and then by `ways`, each with random parts."""
    points = [start, out]
    for way in ways:
        points.append(points[-1] + np.array(way) + random.normal(0.0, 2.5, 3))
    radii = [radius_mm, *np.linspace(radius_mm, 0.8 * radius_mm, len(points) - 1)]
    return _tube(name, points, radii, 15.0)


def _tubes(random: np.random.Generator, kind: str) -> List[Dict[str, Any]]:
    arch = _Arch(random)
    carotid_mm = random.uniform(3.0, 3.8)
    trunk_mm = random.uniform(5.5, 6.5)
    subclavian_mm = random.uniform(4.0, 5.0)
    angle = arch.angle_at(random.uniform(*_DROPS[kind]) * 2 * carotid_mm)
    outside_mm = arch.lumen_mm + random.uniform(8.0, 14.0)
    trunk = _branch(
        random, "brachiocephalic", arch.place(angle), arch.place(angle, outside_mm), [(-14, -2, 26)], trunk_mm
    )
    fork = trunk["points_mm"][-1]
    right = _branch(random, "rcca", fork, fork + [-3, 2, 14], [(-4, 2, 40), (-4, 4, 40)], carotid_mm)
    arm = _branch(random, "rsa", fork, fork + [-16, 4, 4], [(-30, 6, -4), (-30, 2, -16)], subclavian_mm)
    # The origins of the vessels are 17 to 22 mm apart on the outer wall.
    gap = random.uniform(17.0, 22.0) / (arch.radius_mm + arch.lumen_mm)
    if kind == "bovine":
        below, above = trunk["points_mm"][1:]
        start = below + random.uniform(0.0, 0.3) * (above - below)
        left = _branch(random, "lcca", start, start + [14, -2, 12], [(12, 2, 30), (2, 4, 45)], carotid_mm)
    else:
        start, out = arch.place(angle - gap), arch.place(angle - gap, outside_mm)
        left = _branch(random, "lcca", start, out, [(2, 2, 30), (4, 4, 50)], carotid_mm)
    other = angle - 2 * gap
    far = _branch(
        random, "lsa", arch.place(other), arch.place(other, outside_mm), [(8, 4, 24), (30, 4, 10), (30, 0, -10)], subclavian_mm
    )
    return [arch.tube(), trunk, right, arm, left, far]


_REST = """
[entry]
centerline = "aorta"
at_mm = 2

[[instrument]]
name = "guidewire"
max_length_mm = 420
inserted_at_start_mm = 100
radius_mm = 0.4445
tip_mm = 25
tip_angle_deg = 100
rigidity_N_mm2 = [2, 2, 60]
from_tip_mm = [0, 20, 100]
"""


def _check(types: Sequence[str]) -> None:
    if isinstance(types, str) or not types or any(kind not in TYPES for kind in types):
        near = "" if isinstance(types, str) else did_you_mean(first_unknown(types, TYPES), TYPES)
        raise Error(f"types are {shown(types)}; {near}give a list with some of {', '.join(TYPES)}")


def draw(seed: Union[int, np.random.Generator], types: Sequence[str] = TYPES) -> Scene:
    """Scene of a random arch, named after its type. The same seed and types give the same scene. Each of the types is
    equally probable."""
    _check(types)
    random = generator_of(seed)
    kind = types[random.integers(len(types))]
    text = [f'name = "arch_{kind}"\n[vessel]\nkind = "tubes"\nwall_stiffness_N_mm2 = 5\n']
    for tube in _tubes(random, kind):
        text.append(tube_text(tube["name"], tube["points_mm"], tube["radii_mm"], tube["bend_radius_mm"]))
    return Scene.from_text("".join(text) + _REST)


def _draw(seed: Union[int, np.random.Generator], types: Tuple[str, ...]) -> Scene:
    return draw(seed, types)


def _drawn(types: Sequence[str], count: Optional[int]) -> SceneDraw:
    _check(types)
    return drawn(functools.partial(_draw, types=tuple(types)), count)


def make(
    types: Sequence[str] = TYPES,
    task: Task = TASK,
    observation: Observation = "vector",
    render_mode: Optional[str] = None,
    reward: Optional[Reward] = None,
    end: Optional[End] = None,
    count: Optional[int] = None,
) -> NavigationEnv:
    """Environment with another arch at each reset, by the seed. The name of env.scene has its type. count: None: each
    reset draws a new arch; otherwise one of so many, which are kept, and then cost no more time."""
    return NavigationEnv(_drawn(types, count), task, observation, render_mode, reward, end)


def make_vec(
    num_envs: int = 1,
    types: Sequence[str] = TYPES,
    task: Task = TASK,
    observation: Observation = "vector",
    threads: Optional[int] = None,
    copy: bool = True,
    reward: Optional[Reward] = None,
    end: Optional[End] = None,
    count: Optional[int] = None,
) -> VectorEnv:
    """Environments in threads, each with another arch at each reset, by its seed. count: as in make()."""
    return VectorEnv(_drawn(types, count), num_envs, threads, observation, task, copy, reward, end)
