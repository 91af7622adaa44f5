"""Source for mypy only, which reads it as a user's program; no test runs it."""

from typing import Dict

import numpy as np
import torquer


def depth_mm(path: str) -> float:
    scene = torquer.Scene(path)
    simulation: torquer.Simulation = torquer.Simulation(scene).copy()
    imaging = torquer.Imaging("plain", magnification=2, wedge_left=(0.3, 15))
    report = simulation.step(
        0.1,
        simulation.hands + np.array([[1.0, 0.0]]),
        xray=True,
        imaging=imaging,
        injector=torquer.Injector("arm", volume_mL=12),
        after_tick=lambda tick: tick.converged and not simulation.picture_due(),
    )
    simulation.exchange("guidewire", device="sion")
    restart: torquer.Scene = simulation.scene_at_start
    readings: Dict[str, float] = simulation.readings()
    if not report.converged or not readings or restart.path != path:
        raise torquer.Error("not at rest")
    return float(scene.clearance_mm(simulation.nodes_mm).min())
