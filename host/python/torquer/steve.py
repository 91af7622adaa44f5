"""The three tasks of stEVE_bench by their published definitions: BasicWireNav, ArchVariety and DualDeviceNav.

    import torquer.steve

    env = torquer.steve.SteveEnv("ArchVariety")                 # or realistic=True
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

    gymnasium.make("torquer/ArchVariety-v0")                    # or torquer/ArchVarietyRealistic-v0

Targets, threshold, step, step limit, speeds, devices, friction, observation and reward are those of
lkarstensen/stEVE_bench at 1c7640e, stEVE at f909e71 and stEVE_training at 901c8c5. host/python/README.md has the
differences. Each task has a second form with stiffness and friction of real devices. Torquer simulates both.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, Callable, Dict, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import Error, Scene, Simulation, arches
from ._devices import shipped
from ._names import did_you_mean, shown
from ._navigation import End, Moment, Reward, Task, action_values
from ._polyline import arcs_of, at_arcs
from ._spaces import Box, CopiedWhole, DictSpace, Env, gymnasium
from ._anatomies import SceneDraw
from .envs import NavigationEnv

Array = npt.NDArray[Any]

SPEEDS = (35.0, 3.14)
"""Largest speeds of each instrument: mm/s and rad/s."""
STEP_S = 1 / 7.5
"""Time of a step."""
_TASK = Task(
    "",
    0.0,
    within_mm=5.0,
    step_s=STEP_S,
    longest_mm=SPEEDS[0] * STEP_S,
    largest_turn_rad=SPEEDS[1] * STEP_S,
    force_limit_mN=1500.0,
    max_steps=1000,
)

# Tracked points, and the observation's bound in units of half of the vessel.
_POINTS = 3
_APART_MM = 2.0
_BOUND = 4.0
# A tip this near to an end of the tree is at the end. The entry is an end, but not for the first part of a wire.
_END_MM = 4
_FREE_MM = 10.0

# Arc of the shaped tip of every device: radius, mm, and angle, rad.
_TIP_RADIUS_MM, _TIP_RAD = 12.1, 0.4 * math.pi
_TIP_MM = _TIP_RADIUS_MM * _TIP_RAD
_TIP = f"tip_mm = {_TIP_MM:.4f}\ntip_angle_deg = {math.degrees(_TIP_RAD):.4f}\n"


def _rigidity_N_mm2(modulus_kPa: float, outer_mm: float, inner_mm: float = 0.0) -> float:
    """EI of a round section. The lengths of stEVE are in mm, its masses in kg, so its moduli are in kPa."""
    return modulus_kPa * 1e-3 * math.pi / 64 * (outer_mm**4 - inner_mm**4)


def _sections(tip: Tuple[float, float, float], shaft: Tuple[float, float, float]) -> str:
    """Keys of a device with two uniform sections, of modulus, outer and inner diameter. The outer radius is that of the
    section, the lumen that of the shaft. GJ / EI is that of Poisson's ratio 0.49."""
    inner = f"inner_radius_mm = {shaft[2] / 2:.4f}\n" if shaft[2] > 0 else ""
    return (
        f"from_tip_mm = [0, {_TIP_MM:.4f}, {_TIP_MM:.4f}]\n"
        f"radius_mm = [{tip[1] / 2:.4f}, {tip[1] / 2:.4f}, {shaft[1] / 2:.4f}]\n"
        f"rigidity_N_mm2 = [{_rigidity_N_mm2(*tip):.6g}, {_rigidity_N_mm2(*tip):.6g}, {_rigidity_N_mm2(*shaft):.6g}]\n"
        f"torsional_rigidity_ratio = {1 / 1.49:.4f}\n{inner}"
    )


# The wire of BasicWireNav and ArchVariety. The realistic one is that of the scene neuro_arch.
_WIRE = {
    False: _sections((17e3, 0.7, 0.0), (80e3, 0.89, 0.0)),
    True: "from_tip_mm = [0, 15, 80, 150]\nrigidity_N_mm2 = [1, 1, 100, 300]\nradius_mm = 0.4445\n",
}
_WIRE_FRICTION = {False: 0.1, True: 0.08}

# The pair of DualDeviceNav. The shaft of its wire is as hollow as it is thick, so that its EI would be 0. Here it has
# the EI of its tip. The realistic pair has devices of host/devices.
_MICROWIRE = {False: _sections((1e3, 0.36, 0.0), (1e3, 0.36, 0.0)), True: 'device = "sion_blue"\n'}
_MICROCATHETER = {False: _sections((1e3, 0.6, 0.57), (1e3, 0.7, 0.57)), True: 'device = "microcatheter_1_8f"\n'}
_PAIR_FRICTION = {False: 0.001, True: 0.08}

_PATIENT = """[vessel]
kind = "surface"
file = "meshes/neuro_arch/surface.obj"
mesh_unit = "mm"
voxel_mm = 0.5
centerlines = "meshes/neuro_arch/centerlines"
wall_stiffness_N_mm2 = 10
[patient_axes]
left = "+y"
posterior = "-z"
superior = "-x"
"""


def _instrument(name: str, length_mm: float, keys: str) -> str:
    return f'[[instrument]]\nname = "{name}"\nmax_length_mm = {length_mm:g}\n{_TIP}{keys}'


def _effects(friction: float, twists: bool = True) -> str:
    return f"[effects.friction]\ncoefficient = {friction:g}\n" + ("[effects.torsion]\n" if twists else "")


@functools.lru_cache(maxsize=None)
def _scene(name: str, rest: str) -> Scene:
    """A scene in the patient's arteries. All environments share its vessel, and the field of distances in it."""
    return Scene.from_text(f'name = "{name}"\n{_PATIENT}{rest}', folder=str(shipped("scenes")))


def _basic(realistic: bool, _: Optional[int]) -> Scene:
    """The arch of a patient. The wire enters the descending aorta 160 mm below it."""
    entry = '[entry]\ncenterline = "curve_02"\nat_mm = 160\ntowards = "curve_02"\ntowards_at_mm = 150\n'
    wire = _instrument("guidewire", 450, _WIRE[realistic])
    return _scene("basic_wire_nav", entry + wire + _effects(_WIRE_FRICTION[realistic]))


def _dual(realistic: bool, _: Optional[int]) -> Scene:
    """The arteries of a patient, from the left groin to the head. In the published pair, torsion would make a step four
    times as slow."""
    rest = "[entry]\npoint_mm = [-35, 65, 5]\ndirection = [-1, -1, 0]\n"
    rest += _instrument("microwire", 900, _MICROWIRE[realistic])
    rest += _instrument("microcatheter", 900, _MICROCATHETER[realistic])
    return _scene("dual_device_nav", rest + _effects(_PAIR_FRICTION[realistic], twists=realistic))


def _arch_scene(seed: Union[int, np.random.Generator], realistic: bool) -> Scene:
    """An arch whose trunk, left carotid and left subclavian artery begin at the aorta."""
    given = arches.draw(seed, types=("I", "II", "III"))
    vessel = given.text[: given.text.index("[entry]")].replace("[vessel]", "[vessel]\nvoxel_mm = 0.5")
    entry = '[entry]\ncenterline = "aorta"\nat_mm = 2\n'
    wire = _instrument("guidewire", 450, _WIRE[realistic])
    return Scene.from_text(vessel + entry + wire + _effects(_WIRE_FRICTION[realistic]))


_kept_arch = functools.lru_cache(maxsize=256)(_arch_scene)


def _draw_arch(random: np.random.Generator, realistic: bool, count: Optional[int]) -> Scene:
    return _arch_scene(random, realistic) if count is None else _kept_arch(int(random.integers(count)), realistic)


def _arch(realistic: bool, count: Optional[int]) -> SceneDraw:
    return functools.partial(_draw_arch, realistic=realistic, count=count)


@dataclasses.dataclass(frozen=True)
class _Definition:
    scene: Callable[[bool, Optional[int]], Union[Scene, SceneDraw]]
    targets: Tuple[Tuple[str, float, float], ...]
    """Centerlines, and the ranges on them outside of all vessels without targets."""
    axes: Tuple[Tuple[int, int, int], ...]
    """Directions to the patient's left, back and head, in the vessel's frame."""
    turn_deg: Tuple[float, float]
    """Angles of the picture about the axes to the head and to the left."""

    def task(self) -> Task:
        first, *others = self.targets
        return dataclasses.replace(
            _TASK, centerline=first[0], at_mm=first[2], other_targets=tuple([first, *others])
        )

    def plane(self) -> Array:
        """Matrix from a point of the vessel to its two coordinates in the picture."""
        z, x = np.radians(np.negative(self.turn_deg))
        about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
        about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
        out: Array = (about_z @ about_x @ np.array(self.axes, float))[[0, 2]]
        return out


_NEURO_AXES = ((0, 1, 0), (0, 0, -1), (-1, 0, 0))
_DEFINITIONS = {
    "BasicWireNav": _Definition(
        _basic,
        (("curve_11", 15.6, 48.1), ("lcca", 17.7, 130.0), ("rcca", 0.0, 100.0), ("curve_18", 12.7, 43.4)),
        _NEURO_AXES,
        (0.0, 0.0),
    ),
    "ArchVariety": _Definition(
        _arch,
        (
            ("brachiocephalic", 22.0, 44.0),
            ("lcca", 22.0, 90.0),
            ("rcca", 0.0, 85.0),
            ("lsa", 22.0, 85.0),
            ("rsa", 0.0, 70.0),
        ),
        ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        (25.0, 0.0),
    ),
    "DualDeviceNav": _Definition(
        _dual,
        (("lcca", 17.7, 264.2), ("lva", 4.6, 206.8), ("rcca", 6.4, 234.9), ("rva", 6.3, 234.7)),
        _NEURO_AXES,
        (20.0, 5.0),
    ),
}
NAMES = tuple(_DEFINITIONS)
"""Names of the tasks."""


def published_reward(moment: Moment) -> float:
    """1 at the target, 0.001 for each mm of progress along the route, and -0.005 for each step."""
    success = float(moment.info["success"])
    # Torquer's own reward is progress_mm / 10 - 0.01 + 10 at the target.
    progress_mm = 10 * (moment.reward + 0.01 - 10 * success)
    return success + 0.001 * progress_mm - 0.005


def _check(name: str) -> None:
    if name not in _DEFINITIONS:
        raise Error(f"there is no task {shown(name)} of stEVE_bench; {did_you_mean(name, NAMES)}there are: {', '.join(NAMES)}")


def task(name: str, training: bool = False) -> Task:
    """Task with the published targets and limits. training: True: with the faster, less accurate steps of
    Task.for_training. The published speeds stay."""
    _check(name)
    given = _DEFINITIONS[name].task()
    return dataclasses.replace(given.for_training(), longest_mm=given.longest_mm) if training else given


class _Ends:
    """Places near the ends of a vessel's tree."""

    def __init__(self, scene: Scene) -> None:
        self.scene_hash = scene.content_hash
        lines = [scene.centerline_mm(name, 1.0) for name in scene.centerlines]
        if "surface" in scene.text:
            # Some centerlines run past the ends of the surface.
            lines = [line[scene.clearance_mm(line) > 0] for line in lines]
        lines = [line for line in lines if len(line) > 0]
        self._points: Array = np.vstack(lines)
        near = []
        for k, line in enumerate(lines):
            others = np.vstack(lines[:k] + lines[k + 1 :])
            last = np.zeros(len(line), bool)
            for end, part in ((line[0], slice(_END_MM)), (line[-1], slice(-_END_MM, None))):
                if np.linalg.norm(others - end, axis=1).min() > _END_MM:
                    last[part] = True
            near.append(last)
        self._near: npt.NDArray[np.bool_] = np.concatenate(near)

    def has(self, place_mm: Array) -> bool:
        """True if the nearest point of all centerlines is near an end."""
        return bool(self._near[np.linalg.norm(self._points - place_mm, axis=1).argmin()])


class SteveEnv(CopiedWhole, Env):  # type: ignore[misc]
    """A task of stEVE_bench, with the interface of Gymnasium.

    Actions: speeds of each instrument, mm/s and rad/s, shape (instruments, 2).

    Observations: a dict. "tracking": three points of the wire in the picture, from the tip on, 2 mm apart; after them
    those of the step before; shape (2, 3, 2). "target": the target there. "last_action": the last action as a
    fraction of the speeds. The picture is a parallel projection. Its coordinates are -1 to 1 in a box of the vessel's
    centerlines, with their coordinates widened by a tenth.

    `info` is that of NavigationEnv, and has "path_ratio", the part of the route that is done. "at_end" is True at an end
    of the vessel's tree. No instrument is pushed farther in there, as in stEVE.
    """

    metadata = NavigationEnv.metadata

    def __init__(
        self,
        name: str,
        realistic: bool = False,
        task: Optional[Task] = None,
        render_mode: Optional[str] = None,
        reward: Optional[Reward] = published_reward,
        end: Optional[End] = None,
        arch_count: Optional[int] = None,
    ) -> None:
        """name: one of NAMES. realistic: True: stiffness and friction of real devices. reward: None: that of
        NavigationEnv. arch_count: None: each reset of ArchVariety draws a new arch; otherwise one of so many, which are
        kept."""
        _check(name)
        definition = _DEFINITIONS[name]
        self._env = NavigationEnv(
            definition.scene(realistic, arch_count), task or definition.task(), "vector", render_mode, reward, end
        )
        self.name = name
        self.realistic = realistic
        self.render_mode = render_mode
        self._plane = definition.plane()
        self._ends: Optional[_Ends] = None
        count = self._env.action_space.shape[0] // 2
        self._speeds = np.tile(np.array(SPEEDS, np.float32), (count, 1))
        self.action_space = Box(-self._speeds, self._speeds, dtype=np.float32)

        def box(bound: float, *shape: int) -> Any:
            return Box(-bound, bound, shape, np.float32)

        self.observation_space = DictSpace(
            {
                "tracking": box(_BOUND, 2, _POINTS, 2),
                "target": box(_BOUND, 2),
                "last_action": box(1.0, count, 2),
            }
        )

    def __repr__(self) -> str:
        return f"SteveEnv({self.name!r}, realistic={self.realistic!r}, time_s={self.simulation.time_s!r})"

    @property
    def task(self) -> Task:
        """Targets and limits."""
        return self._env.task

    @property
    def scene(self) -> Scene:
        """Scene of the episode."""
        return self._env.scene

    @property
    def simulation(self) -> Simulation:
        """Simulation of the environment. Only the environment may step it."""
        return self._env.simulation

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[Dict[str, Any]] = None
    ) -> Tuple[Dict[str, Array], Dict[str, Any]]:
        """Returns to the start. The seed and the options are those of NavigationEnv.reset."""
        _, info = self._env.reset(seed=seed, options=options)
        if gymnasium is not None and (seed is not None or self._np_random is None):
            super().reset(seed=seed)
        lines = np.vstack([self.scene.centerline_mm(name, 2.0) for name in self.scene.centerlines]) @ self._plane.T
        low, high = lines.min(axis=0), lines.max(axis=0)
        low, high = low - 0.1 * np.abs(low), high + 0.1 * np.abs(high)
        self._low, self._size = low, high - low
        if self._ends is None or self._ends.scene_hash != self.scene.content_hash:
            self._ends = _Ends(self.scene)
        self._target = self._seen(self.scene.route_mm(info["target"], info["target_at_mm"])[-1:])[0]
        self._tracking = np.repeat(self._track()[None], 2, axis=0)
        self._last_action = np.zeros_like(self._speeds)
        self._route_mm = info["remaining_mm"]
        return self._observe(), self._with_more(info)

    def step(self, action: npt.ArrayLike) -> Tuple[Dict[str, Array], float, bool, bool, Dict[str, Any]]:
        """Moves the instruments with these speeds for a step of 1 / 7.5 s. Speeds beyond the limits are clipped."""
        shares = action_values(action, self._speeds.shape, "the action is") / self._speeds
        shares = np.clip(shares, -1, 1)
        self._last_action = shares.astype(np.float32)
        if self._at_end():
            inserted_mm = self.simulation.hands[:, 0]
            shares[shares[:, 0] * self.task.longest_mm > inserted_mm.max() - inserted_mm, 0] = 0
        _, reward, terminated, truncated, info = self._env.step(shares.ravel())
        self._tracking = np.stack([self._track(), self._tracking[0]])
        return self._observe(), reward, terminated, truncated, self._with_more(info)

    def render(self) -> Optional[Array]:
        """As NavigationEnv.render."""
        return self._env.render()

    def close(self) -> None:
        """As NavigationEnv.close."""
        # Gymnasium calls this also for an object that could not be made.
        if hasattr(self, "_env"):
            self._env.close()

    def _with_more(self, info: Dict[str, Any]) -> Dict[str, Any]:
        return {**info, "path_ratio": 1 - info["remaining_mm"] / self._route_mm, "at_end": self._at_end()}

    def _at_end(self) -> bool:
        nodes_mm = self.simulation.nodes_mm
        return self._ends is not None and bool(arcs_of(nodes_mm)[-1] > _FREE_MM) and self._ends.has(nodes_mm[-1])

    def _seen(self, points_mm: Array) -> Array:
        """Coordinates in the picture."""
        places = 2 * (points_mm @ self._plane.T - self._low) / self._size - 1
        out: Array = np.clip(places, -_BOUND, _BOUND).astype(np.float32)
        return out

    def _track(self) -> Array:
        nodes_mm = self.simulation.nodes_mm
        return self._seen(at_arcs(nodes_mm, arcs_of(nodes_mm)[-1] - _APART_MM * np.arange(_POINTS)))

    def _observe(self) -> Dict[str, Array]:
        return {
            "tracking": self._tracking.copy(),
            "target": self._target.copy(),
            "last_action": self._last_action.copy(),
        }
