"""Guidewires and catheters that Torquer ships, with the sources of their values."""

from __future__ import annotations

import dataclasses
import pathlib
import tomllib
from typing import Any, Dict, List

from ._names import did_you_mean, shown
from ._torquer import Error


@dataclasses.dataclass(frozen=True)
class Device:
    """A guidewire or catheter. A scene uses it by `device = "NAME"` in an [[instrument]]."""

    name: str
    kind: str
    """Either "guidewire" or "catheter"."""
    product: str
    """Name and size of the product."""
    assumed: str
    """Values that no source states, and their basis."""
    instrument: Dict[str, Any]
    """Keys of an [[instrument]] and their values, in the units of a scene: radius_mm, rigidity_N_mm2 and others."""
    sources: List[Dict[str, Any]]
    """Published figures: citation, figure, from_tip_mm, and the numbers for the calculation of EI."""


def shipped(folder: str) -> pathlib.Path:
    """Folder of files that Torquer ships, such as "scenes"."""
    package = pathlib.Path(__file__).resolve()
    for parent in package.parents:
        # In an installation, or in the source tree.
        for candidate in (parent / "share/torquer" / folder, parent / "host" / folder):
            if candidate.is_dir():
                return candidate
    raise Error(f"{package}: there are no {folder} beside the package; install the folder share/torquer")


def device_names() -> List[str]:
    """Names of the devices that Torquer ships."""
    return sorted(path.stem for path in shipped("devices").glob("*.toml"))


def device(name: str) -> Device:
    """A device that Torquer ships."""
    names = device_names()
    if name not in names:
        raise Error(f"there is no device {shown(name)}; {did_you_mean(name, names)}there are: {', '.join(names)}")
    table = tomllib.loads((shipped("devices") / f"{name}.toml").read_text(encoding="utf-8"))
    return Device(name, table["kind"], table["product"], table["assumed"].strip(), table["instrument"], table["source"])
