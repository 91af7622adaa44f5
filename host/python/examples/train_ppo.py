"""Teaches a policy to steer a wire into the first diagonal branch of a beating heart, by proximal policy optimization
(Schulman et al. 2017) with generalized advantages, in numpy alone: a network of two hidden layers each
for the policy and for the value. What it has learned is tried at the training accuracy and at that of
the task. Where it only pushes, a quarter of the episodes ends there.

    PYTHONPATH=build/release/lib/python /usr/bin/python3 host/python/examples/train_ppo.py [PICTURE [UPDATES]]
"""

import sys
import time

import matplotlib.pyplot as plt
import numpy as np
import torquer
import torquer.envs

COUNT = 16  # environments
LENGTH = 128  # steps of each between two updates
EPOCHS = 6
BATCH = 256
DISCOUNT, TRACE, CLIP = 0.99, 0.95, 0.2


class Network:
    """Two hidden layers of tanh, with Adam."""

    def __init__(self, random, sizes, scale, rate):
        self.weights = [random.normal(0, 1 / np.sqrt(a), (a, b)) for a, b in zip(sizes, sizes[1:])]
        self.weights[-1] *= scale
        self.weights += [np.zeros(b) for b in sizes[1:]]
        self.layers = len(sizes) - 1
        self.adam = Adam(self.weights, rate)

    def __call__(self, x):
        self.seen = [x]
        for k in range(self.layers):
            x = x @ self.weights[k] + self.weights[self.layers + k]
            if k < self.layers - 1:
                x = np.tanh(x)
                self.seen.append(x)
        return x

    def learn(self, slope):
        """One step against the slope of the loss by the output of the last call."""
        slopes = [None] * len(self.weights)
        for k in reversed(range(self.layers)):
            slopes[k] = self.seen[k].T @ slope
            slopes[self.layers + k] = slope.sum(0)
            slope = slope @ self.weights[k].T * (1 - self.seen[k] ** 2)
        self.adam.step(slopes)


class Adam:
    def __init__(self, weights, rate):
        self.weights, self.rate, self.count = weights, rate, 0
        self.means = [np.zeros_like(w) for w in weights]
        self.squares = [np.zeros_like(w) for w in weights]

    def step(self, slopes):
        self.count += 1
        for weight, mean, square, slope in zip(self.weights, self.means, self.squares, slopes):
            mean += 0.1 * (slope - mean)
            square += 0.001 * (slope**2 - square)
            weight -= self.rate * (mean / (1 - 0.9**self.count)) / (np.sqrt(square / (1 - 0.999**self.count)) + 1e-8)


def scaled(observations):
    """Millimeters become numbers about one; cosine and sine stay."""
    out = np.array(observations, float)
    out[:, :-2] /= 50
    return out


def success_rate(policy, task):
    """Of 16 episodes without noise."""
    env = torquer.envs.VectorEnv(torquer.scene_path("coronary"), COUNT, task=task)
    observations, _ = env.reset(seed=10_000)
    going, reached = np.ones(COUNT, bool), 0
    while going.any():
        observations, _, terminated, truncated, info = env.step(policy(scaled(observations)))
        reached += int((info["success"] & going).sum())
        going &= ~(terminated | truncated)
    return reached / COUNT


picture = sys.argv[1] if len(sys.argv) > 1 else "train_ppo.png"
updates = int(sys.argv[2]) if len(sys.argv) > 2 else 25
random = np.random.default_rng(1)
fine = torquer.envs.Task("diagonal_1", 30.0, longest_mm=1.0, max_steps=80)
task = fine.for_training()
env = torquer.envs.VectorEnv(torquer.scene_path("coronary"), COUNT, task=task)
inputs, outputs = env.single_observation_space.shape[0], env.single_action_space.shape[0]
policy = Network(random, (inputs, 64, 64, outputs), 0.01, 5e-4)
value = Network(random, (inputs, 64, 64, 1), 1.0, 1e-3)
log_width = np.full(outputs, -0.5)
width_adam = Adam([log_width], 5e-4)

curve = []
now = scaled(env.reset(seed=0)[0])
skipped = np.zeros(COUNT, bool)  # the step only resets
began, in_env_s = time.perf_counter(), 0.0
for update in range(1, updates + 1):
    seen, acts, noise, gains, last, ends, valid, after = [], [], [], [], [], [], [], []
    reached = episodes = 0
    for _ in range(LENGTH):
        drawn = random.normal(size=(COUNT, outputs))
        action = policy(now) + np.exp(log_width) * drawn
        start = time.perf_counter()
        observations, rewards, terminated, truncated, info = env.step(np.clip(action, -1, 1))
        in_env_s += time.perf_counter() - start
        seen.append(now)
        acts.append(action)
        noise.append(drawn)
        gains.append(rewards)
        last.append(terminated)
        ends.append(terminated | truncated)
        valid.append(~skipped)
        now = scaled(observations)
        after.append(now)
        skipped = terminated | truncated
        reached += int(info["success"].sum())
        episodes += int(skipped.sum())
    before = value(np.concatenate(seen)).reshape(LENGTH, COUNT)
    behind = value(np.concatenate(after)).reshape(LENGTH, COUNT)
    advantages, carried = np.zeros((LENGTH, COUNT)), np.zeros(COUNT)
    for k in reversed(range(LENGTH)):
        surprise = gains[k] + DISCOUNT * behind[k] * ~last[k] - before[k]
        carried = surprise + DISCOUNT * TRACE * ~ends[k] * carried
        advantages[k] = carried
    keep = np.concatenate(valid)
    x, a = np.concatenate(seen)[keep], np.concatenate(acts)[keep]
    old = (-0.5 * np.concatenate(noise) ** 2 - log_width).sum(1)[keep]
    advantage = advantages.ravel()[keep]
    target = (advantages + before).ravel()[keep]
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    for _ in range(EPOCHS):
        for rows in np.array_split(random.permutation(len(x)), max(1, len(x) // BATCH)):
            width = np.exp(log_width)
            drawn = (a[rows] - policy(x[rows])) / width
            ratio = np.exp((-0.5 * drawn**2 - log_width).sum(1) - old[rows])
            # Where the clipped ratio is the smaller gain, nothing is to be gained.
            free = np.where(advantage[rows] > 0, ratio < 1 + CLIP, ratio > 1 - CLIP)
            weight = (free * ratio * advantage[rows] / len(rows))[:, None]
            policy.learn(-weight * drawn / width)
            width_adam.step([-(weight * (drawn**2 - 1)).sum(0)])
            value.learn((value(x[rows]) - target[rows, None]) / len(rows))
    rate = reached / max(1, episodes)
    curve.append((update * LENGTH * COUNT, rate))
    if update % 5 == 0 or update == updates:
        print(f"{curve[-1][0]:7d} steps: {100 * rate:3.0f} % of {episodes} episodes reach the target")
took_s = time.perf_counter() - began
print(f"{took_s:.0f} s, {curve[-1][0] / in_env_s:.0f} steps a second in the environments")
print(f"without noise: {100 * success_rate(policy, task):.0f} % at the training accuracy")
print(f"without noise: {100 * success_rate(policy, fine):.0f} % at the accuracy of the task")

figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
axes.plot([steps for steps, _ in curve], [100 * rate for _, rate in curve])
axes.set(xlabel="steps", ylabel="episodes that reach the target (%)", title="PPO in coronary: diagonal branch", ylim=(0, 102))
axes.grid(alpha=0.3)
figure.savefig(picture, dpi=150)
print(f"picture: {picture}")
