"""torquer train, with a stand-in for the learning, which takes minutes otherwise. It saves the policy twice."""

import sys

import numpy as np
from torquer import __main__, baselines


def updates(name, realistic, steps, seed):
    for episodes in (1, 2):
        yield 2048 * episodes, episodes, 1, [np.full((2, 2), episodes), np.zeros(2)]


baselines._updates = updates
baselines._SAVED = 1
sys.argv = ["torquer", "train", "BasicWireNav", sys.argv[1], "--steps", "4096"]
sys.exit(__main__.command())
