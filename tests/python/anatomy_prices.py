"""Prices of anatomies that change, for the table in host/python/README.md.

usage: PYTHONPATH=build/release/lib/python python3 tests/python/anatomy_prices.py
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from typing import Optional

if __name__ == "__main__":
    # Help needs no packages.
    argparse.ArgumentParser(usage="PYTHONPATH=build/release/lib/python %(prog)s", description="prices of anatomies that change").parse_args()

import numpy as np

import torquer.arches
import torquer.trees
from torquer import envs

_LANES = 16
_EPISODES = 4
_STEPS = 100


def _core_ms(many: envs.VectorEnv) -> float:
    """Processor time of a step, in random episodes."""
    random = np.random.default_rng(1)
    many.reset(seed=1)
    steps = ended = 0
    began = time.process_time()
    while ended < _EPISODES * _LANES:
        actions = random.uniform(-1, 1, (_LANES, 2))
        actions[:, 0] = np.abs(actions[:, 0])
        _, _, terminated, truncated, _ = many.step(actions)
        steps += _LANES
        ended += int((terminated | truncated).sum())
    return 1e3 * (time.process_time() - began) / steps


def main() -> None:
    print("| vessels | another one at each reset | 16 that are kept | always the same |\n|---|---|---|---|")
    for name, module, task in (
        ("arches", torquer.arches, torquer.arches.TASK),
        ("trees of 3 generations", torquer.trees, torquer.trees.task()),
    ):
        short = dataclasses.replace(task.for_training(), max_steps=_STEPS)
        prices = []
        count: Optional[int]
        for count in (None, 16, 1):
            many = module.make_vec(_LANES, task=short, count=count, threads=2)
            if count is not None:
                _core_ms(many)  # pays for the vessels that are kept
            prices.append(f"{_core_ms(many):.2f} ms")
        print(f"| {name} | {' | '.join(prices)} |")


if __name__ == "__main__":
    main()
