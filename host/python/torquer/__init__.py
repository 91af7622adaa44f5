"""Guidewires and catheters in a patient's arteries.

    import numpy as np
    import torquer

    simulation = torquer.Simulation("neuro_arch")
    hands = simulation.hands
    for k in range(100):
        hands[0, 0] += 1  # mm
        simulation.step(0.1 * (k + 1), hands)
    print(simulation.tips_mm[0])

Lengths are in mm, angles in rad, angles of the C-arm in degrees, times in s.
"""

import importlib.util

from ._torquer import (
    Error,
    Imaging,
    Injector,
    InstrumentInfo,
    Scene,
    ScriptRow,
    Sensitivity,
    Simulation,
    StepReport,
    Surface,
    SurfaceCheck,
    __build__,
    __version__,
    check_mesh,
    unit_of,
)
from ._devices import Device, device, device_names, shipped
from ._names import did_you_mean as _did_you_mean, shown as _shown
from .states import States, read_states

__all__ = [
    "Device",
    "Error",
    "Imaging",
    "Injector",
    "InstrumentInfo",
    "Scene",
    "ScriptRow",
    "Sensitivity",
    "Simulation",
    "States",
    "StepReport",
    "Surface",
    "SurfaceCheck",
    "__build__",
    "__version__",
    "check_mesh",
    "device",
    "device_names",
    "read_states",
    "scene_names",
    "scene_path",
    "unit_of",
]


def scene_names() -> list[str]:
    """Names of the scenes that Torquer ships."""
    return sorted(path.stem for path in shipped("scenes").glob("*.toml"))


def scene_path(name: str) -> str:
    """Path of a scene that Torquer ships."""
    names = scene_names()
    if name not in names:
        raise Error(f"there is no scene {_shown(name)}; {_did_you_mean(name, names)}there are: {', '.join(names)}")
    return str(shipped("scenes") / f"{name}.toml")


if importlib.util.find_spec("gymnasium") is not None:
    from . import envs as _envs  # registers the environments with Gymnasium
