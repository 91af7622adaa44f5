"""Trains a policy to steer a wire into the first diagonal branch of a beating heart. The method is proximal policy
optimization (Schulman et al. 2017) with generalized advantages, in PyTorch (Debian's python3-torch). The policy is then
tested in 30 unseen episodes, at the accuracy of the training and of the task. The script prints the number of episodes
that reach the target, and of those that do so safely. A hand that only pushes is tested, too.

    PYTHONPATH=build/release/lib/python /usr/bin/python3 -m torquer.examples.train_ppo [PICTURE [UPDATES [SEED]]]
"""

import sys
import time

import matplotlib.pyplot as plt
import numpy as np
import torch
import torquer
import torquer.envs
from torch import nn

COUNT = 16  # environments
LENGTH = 128  # steps of each between two updates
EPOCHS = 6
BATCH = 256
DISCOUNT, TRACE, CLIP = 0.99, 0.95, 0.2
HELD_OUT = 30  # episodes
HELD_OUT_SEED = 10_000  # of the first episode; training by default has 0 to 15 and random numbers from them
FORCE_LIMIT_MN = 25.0  # of a patch of the wall; above it a success is not safe


def network(inputs, outputs, gain):
    layers = [nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs)]
    nn.init.orthogonal_(layers[-1].weight, gain)
    nn.init.zeros_(layers[-1].bias)
    return nn.Sequential(*layers)


class Policy(nn.Module):
    """Normally distributed actions whose mean depends on the observation, and the value of an observation."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.mean = network(inputs, outputs, 0.01)
        self.value = network(inputs, 1, 1.0)
        self.log_width = nn.Parameter(torch.full((outputs,), -0.5))

    def actions(self, x):
        return torch.distributions.Normal(self.mean(x), self.log_width.exp())


def optimizer(policy):
    return torch.optim.Adam(
        [
            {"params": [*policy.mean.parameters(), policy.log_width], "lr": 5e-4},
            {"params": policy.value.parameters(), "lr": 1e-3},
        ]
    )


def advantages(gains, last, ends, before, behind):
    """Generalized advantages of each step and environment. last: the episode terminated; ends: it ended; before, behind:
    values of the observations before and behind a step."""
    out, carried = torch.zeros_like(before), torch.zeros(before.shape[1])
    for k in reversed(range(len(before))):
        surprise = gains[k] + DISCOUNT * behind[k] * ~last[k] - before[k]
        carried = surprise + DISCOUNT * TRACE * ~ends[k] * carried
        out[k] = carried
    return out


def improve(policy, adam, x, a, old, advantage, target):
    """One update of the policy. old: logarithms of the probabilities of the actions a; target: values of x."""
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(x)).split(BATCH):
            ratio = (policy.actions(x[rows]).log_prob(a[rows]).sum(1) - old[rows]).exp()
            gain = torch.minimum(ratio * advantage[rows], ratio.clamp(1 - CLIP, 1 + CLIP) * advantage[rows])
            error = policy.value(x[rows]).squeeze(1) - target[rows]
            adam.zero_grad()
            (-gain.mean() + 0.5 * (error**2).mean()).backward()
            adam.step()


def scaled(observations):
    """Scales millimeters to about one; cosine and sine stay."""
    out = torch.tensor(observations, dtype=torch.float32)
    out[:, :-2] /= 50
    return out


def held_out(act, task):
    """Numbers of held-out episodes that reach the target, and do so safely; largest force on a patch of the wall."""
    env = torquer.envs.VectorEnv(torquer.scene_path("coronary"), HELD_OUT, task=task)
    observations, _ = env.reset(seed=HELD_OUT_SEED)
    going, reached, safe, largest_mN = np.ones(HELD_OUT, bool), 0, 0, 0.0
    while going.any():
        observations, _, terminated, truncated, info = env.step(act(scaled(observations)))
        reached += int((info["success"] & going).sum())
        safe += int((info["safe_success"] & going).sum())
        largest_mN = np.fmax.reduce(info["wall_force_mN"][going], initial=largest_mN)  # NaN: not known
        going &= ~(terminated | truncated)
    return reached, safe, largest_mN


def push(x):
    return np.tile([1.0, 0.0], (len(x), 1))


def main(picture="train_ppo.png", updates=25, seed=1):
    """Trains and tests the policy, and draws the learning curve."""
    updates, seed = int(updates), int(seed)
    torch.manual_seed(seed)
    torch.set_num_threads(1)  # the networks are small; the environments use the cores
    fine = torquer.envs.Task("diagonal_1", 30.0, longest_mm=1.0, max_steps=80, force_limit_mN=FORCE_LIMIT_MN)
    task = fine.for_training()
    env = torquer.envs.VectorEnv(torquer.scene_path("coronary"), COUNT, task=task)
    policy = Policy(env.single_observation_space.shape[0], env.single_action_space.shape[0])
    adam = optimizer(policy)

    curve = []
    now = scaled(env.reset(seed=COUNT * (seed - 1))[0])
    skipped = np.zeros(COUNT, bool)  # the step only resets
    began, in_env_s = time.perf_counter(), 0.0
    for update in range(1, updates + 1):
        seen, acts, gains, last, ends, valid, after = [], [], [], [], [], [], []
        reached = safe = episodes = 0
        for _ in range(LENGTH):
            with torch.no_grad():
                action = policy.actions(now).sample()
            start = time.perf_counter()
            observations, rewards, terminated, truncated, info = env.step(action.clamp(-1, 1).numpy())
            in_env_s += time.perf_counter() - start
            seen.append(now)
            acts.append(action)
            gains.append(torch.tensor(rewards, dtype=torch.float32))
            last.append(torch.tensor(terminated))
            ends.append(torch.tensor(terminated | truncated))
            valid.append(torch.tensor(~skipped))
            now = scaled(observations)
            after.append(now)
            skipped = terminated | truncated
            reached += int(info["success"].sum())
            safe += int(info["safe_success"].sum())
            episodes += int(skipped.sum())
        x, a, keep = torch.cat(seen), torch.cat(acts), torch.cat(valid)
        with torch.no_grad():
            before = policy.value(x).reshape(LENGTH, COUNT)
            behind = policy.value(torch.cat(after)).reshape(LENGTH, COUNT)
            old = policy.actions(x).log_prob(a).sum(1)[keep]
        advantage = advantages(gains, last, ends, before, behind)
        target = (advantage + before).flatten()[keep]
        improve(policy, adam, x[keep], a[keep], old, advantage.flatten()[keep], target)
        rates = [count / max(1, episodes) for count in (reached, safe)]
        curve.append((update * LENGTH * COUNT, *rates))
        if update % 5 == 0 or update == updates:
            print(
                f"{curve[-1][0]:7d} steps: {100 * rates[0]:3.0f} % of {episodes} episodes reach the target, "
                f"{100 * rates[1]:3.0f} % safely",
                flush=True,
            )
    took_s = time.perf_counter() - began
    print(f"{took_s:.0f} s, {curve[-1][0] / in_env_s:.0f} steps a second in the environments")

    def learned(x):
        with torch.no_grad():
            return policy.mean(x).clamp(-1, 1).numpy()

    for who, act in (("learned", learned), ("only pushed", push)):
        for accuracy, of in (("training", task), ("task", fine)):
            reached, safe, largest_mN = held_out(act, of)
            print(
                f"{who:11}, accuracy of the {accuracy:8}: {reached} of {HELD_OUT} reach the target, {safe} safely; "
                f"{largest_mN:.0f} mN at most"
            )

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    steps, success, safely = np.array(curve).T
    axes.plot(steps, 100 * success, linewidth=4, alpha=0.4, label="reached")
    axes.plot(steps, 100 * safely, label=f"reached with less than {FORCE_LIMIT_MN:.0f} mN on every patch of the wall")
    axes.set(xlabel="steps", ylabel="episodes (%)", title=f"PPO in coronary: diagonal branch (seed {seed})", ylim=(0, 102))
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(picture, dpi=150)
    print(f"picture: {picture}")


if __name__ == "__main__":
    main(*sys.argv[1:])
