"""Measures speed and error of environments on this machine: torquer benchmark."""

from __future__ import annotations

import dataclasses
import json
import os
import pickle
import platform
import subprocess
import sys
import time
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import numpy.typing as npt

from . import __version__, envs, scene_path

_EPISODES = 3
_STEPS = 200
_COUNT = 16
# Default tolerance of a scene.
_ACCURATE = 1e-6


def _actions(size: int) -> npt.NDArray[np.float64]:
    """Random actions of each episode, more forward than backward."""
    random = np.random.default_rng(7)
    actions = random.uniform(-1, 1, (_EPISODES, _STEPS, size))
    actions[:, :, ::2] = random.uniform(-0.2, 1, (_EPISODES, _STEPS, size // 2))
    return actions


def _single(name: str, task: envs.Task, observation: str) -> Tuple[Dict[str, float], npt.NDArray[np.float64]]:
    """Steps per second of the clock and of a core, and the tip after each step."""
    env = envs.NavigationEnv(scene_path(name), task, observation)
    # The first episode builds the field of distances where the wire goes. Training does so once.
    env.reset(seed=0)
    for action in _actions(env.action_space.shape[0])[0]:
        env.step(action)
    tips: List[npt.NDArray[np.float64]] = []
    wall_s = core_s = 0.0
    for seed, episode in enumerate(_actions(env.action_space.shape[0])):
        env.reset(seed=seed)
        wall, core = time.perf_counter(), time.process_time()
        for action in episode:
            env.step(action)
            tips.append(env.simulation.tips_mm[task.instrument])
        wall_s += time.perf_counter() - wall
        core_s += time.process_time() - core
    return {"steps_s": len(tips) / wall_s, "steps_core_s": len(tips) / core_s}, np.array(tips)


def _vector(name: str, task: envs.Task, observation: str) -> Dict[str, float]:
    env = envs.VectorEnv(scene_path(name), _COUNT, observation=observation, task=task, copy=False)
    episodes = _actions(env.single_action_space.shape[0])
    # The first round builds the field, like the first episode of _single.
    for _ in range(2):
        env.reset(seed=0)
        wall, core = time.perf_counter(), time.process_time()
        for k in range(_STEPS):
            env.step(episodes[np.arange(_COUNT) % _EPISODES, k])
    wall, core = time.perf_counter() - wall, time.process_time() - core
    return {"steps_s": _COUNT * _STEPS / wall, "steps_core_s": _COUNT * _STEPS / core}


def _growth_MB(count: int, task: envs.Task, name: str, observation: str) -> float:
    """Growth of this process by `count` environments, after a few steps of each; for one environment."""

    def resident_bytes() -> int:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def stepped(environments: int) -> envs.VectorEnv:
        env = envs.VectorEnv(scene_path(name), environments, observation=observation, task=task, copy=False)
        env.reset(seed=0)
        for _ in range(20):
            env.step(np.ones(env.action_space.shape))
        return env

    first = stepped(1)  # has the vessel and its field of distances, which all environments share
    before = resident_bytes()
    others = stepped(count)
    grown = resident_bytes() - before
    del first, others
    return grown / count / 1e6


def _memory_MB(name: str, task: envs.Task, observation: str) -> Optional[float]:
    """Memory of an environment; None where /proc does not tell it."""
    if not os.path.exists("/proc/self/statm"):
        return None
    # Here, memory that an earlier task freed would be used again, and hide the growth.
    code = "import pickle, sys; from torquer import benchmark; print(benchmark._growth_MB(*pickle.load(sys.stdin.buffer)))"
    given = pickle.dumps((_COUNT, task, name, observation))
    return float(subprocess.run([sys.executable, "-c", code], input=given, stdout=subprocess.PIPE, check=True).stdout)


def run(names: Optional[List[str]] = None) -> Dict[str, Any]:
    """Measures each task at 1 mm a step: at its own accuracy, for training, and with pictures."""
    rows = []
    for name in names or list(envs.TASKS):
        task = dataclasses.replace(envs.TASKS[name], longest_mm=1.0, max_steps=10**6, within_mm=0.0)
        accurate = dataclasses.replace(task, tolerance=_ACCURATE)
        _, reference_mm = _single(name, accurate, "vector")
        kinds = [
            ("accurate", accurate, "vector"),
            ("default", task, "vector"),
            ("training", task.for_training(), "vector"),
        ]
        if "fluoroscopy" in envs.VectorEnv(name, 1, 1).scene.effects:
            small = dataclasses.replace(task.for_training(), picture_px=128)
            kinds.append(("training", small, "picture"))
        for accuracy, kind, observation in kinds:
            single, tips_mm = _single(name, kind, observation)
            error_mm = np.linalg.norm(tips_mm - reference_mm, axis=1)
            rows.append(
                {
                    "task": name,
                    "accuracy": accuracy,
                    "tolerance": kind.tolerance,
                    "segment_mm": kind.segment_mm,
                    "observation": observation if observation == "vector" else "picture 128 x 128",
                    "single": single,
                    "vector": _vector(name, kind, observation),
                    "memory_MB": _memory_MB(name, kind, observation),
                    "tip_error_p50_mm": float(np.quantile(error_mm, 0.5)),
                    "tip_error_p95_mm": float(np.quantile(error_mm, 0.95)),
                    "tip_error_max_mm": float(error_mm.max()),
                }
            )
    return {
        "torquer": __version__,
        "machine": platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "episodes": _EPISODES,
        "steps": _STEPS,
        "vector_count": _COUNT,
        "rows": rows,
    }


def as_json(result: Dict[str, Any]) -> str:
    return json.dumps(result)


def as_table(result: Dict[str, Any]) -> str:
    """Result as a table in Markdown."""
    lines = [
        "| task | accuracy | observation | steps/s a core | in threads, a core | "
        f"in threads, by the clock ({result['cores']} cores) | MB an environment | tip error p50, p95, mm |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in result["rows"]:
        lines.append(
            f"| {row['task']} | {row['accuracy']} | {row['observation']} | {row['single']['steps_core_s']:.0f} | "
            f"{row['vector']['steps_core_s']:.0f} | {row['vector']['steps_s']:.0f} | "
            f"{'unknown' if row['memory_MB'] is None else format(row['memory_MB'], '.2g')} | "
            f"{row['tip_error_p50_mm']:.2g}, {row['tip_error_p95_mm']:.2g} |"
        )
    return "\n".join(lines)
