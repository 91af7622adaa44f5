"""Baselines of the tasks in torquer.steve: torquer train makes a policy, torquer evaluate tests policies.

A policy is trained by the PPO of torquer.examples.train_ppo, at the accuracy of training, with the published
observation and actions. Its reward is that of NavigationEnv: progress in mm / 10, -0.01 for each step, +10 at the
target. Episodes of the training end after 250 steps, or at an end of the vessel. In ArchVariety they take place in 48
arches. The file of a policy has the hash of the build. Another build may find other shapes, so an evaluation refuses the
file.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import os
import pathlib
import secrets
import time
import zipfile
from typing import Any, Callable, Dict, Iterator, List, Optional, TextIO, Tuple

import numpy as np
import numpy.typing as npt

from . import Error, __build__, steve
from ._command import need
from ._navigation import whole
from ._user_file import open_file

Array = npt.NDArray[Any]
Act = Callable[[Array], Array]
"""Speeds as fractions of the limits, from the features of an observation."""

HELD_OUT_SEED = 1_000_000
"""Seed of the first episode of an evaluation. Training draws its episodes from other seeds."""
_COUNT = 16
_LENGTH = 128
_TRAINING_STEPS = 250
_ARCHES = 48
_SAVED = 8  # updates between two saves
# Differences between places in the picture, in units of its half, to about one.
_SCALE = 30.0


def features(observation: Dict[str, Array]) -> Array:
    """Linear features of an observation: place of the tip; other tracked points and the target, from the tip; action."""
    tracking, target = observation["tracking"], observation["target"]
    tip = tracking[0, 0]
    near = _SCALE * (tracking.reshape(-1, 2)[1:] - tip)
    parts = [tip, near.ravel(), target, 4 * (target - tip), observation["last_action"].ravel()]
    out: Array = np.clip(np.concatenate(parts), -5, 5).astype(np.float32)
    return out


@dataclasses.dataclass(frozen=True)
class Policy:
    """A trained policy, and its origin."""

    task: str
    realistic: bool
    seed: int
    weights: List[Array]
    """Matrix and offset of each layer. All layers but the last one have tanh."""
    curve: Array
    """Learning curve: rows of steps, episodes, episodes that reached the target, seconds."""

    def act(self, x: Array) -> Array:
        """Fractions of the speeds, for the features of one observation."""
        for k in range(0, len(self.weights), 2):
            x = self.weights[k] @ x + self.weights[k + 1]
            x = np.tanh(x) if k + 2 < len(self.weights) else x
        out: Array = np.clip(x, -1, 1)
        return out

    def save(self, path: str) -> None:
        """Writes the policy as a new file, .npz. An existing file is refused."""
        refuse_existing(path)
        self._write(path)

    def _write(self, path: str) -> None:
        """Writes or replaces a file, which is the old one or complete at any time."""
        about = {"build": __build__, "task": self.task, "realistic": self.realistic, "seed": self.seed}
        arrays = {f"weight_{k}": value for k, value in enumerate(self.weights)}
        data = io.BytesIO()
        np.savez_compressed(data, about=np.array(json.dumps(about)), curve=self.curve, **arrays)
        temporary = pathlib.Path(path).with_name(f".torquer-{secrets.token_hex(8)}")
        try:
            with open(temporary, "xb", buffering=0) as file:
                left = data.getbuffer()
                while left:
                    left = left[file.write(left) :]
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException as error:
            with contextlib.suppress(OSError):
                temporary.unlink()
            if not isinstance(error, OSError):
                raise
            raise Error(f"{path}: cannot be written ({error.strerror}); check the disk and permissions") from None


def refuse_existing(path: str) -> None:
    """Refuses a path that exists, or whose folder does not."""
    if os.path.lexists(path):
        raise Error(f"{path}: exists already; move it away, or give another name")
    folder = pathlib.Path(path).absolute().parent
    if not folder.is_dir():
        raise Error(f"{path}: there is no folder {folder}; make it first")


def load(path: str) -> Policy:
    """Reads a policy. One of another build is refused."""
    try:
        with open_file(path) as opened, np.load(opened, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            build, task = about["build"], about["task"]
            weights = [file[f"weight_{k}"] for k in range(sum(name.startswith("weight_") for name in file.files))]
            policy = Policy(task, about["realistic"], about["seed"], weights, file["curve"])
    except Error:
        raise
    except (KeyError, OSError, TypeError, ValueError, zipfile.BadZipFile, EOFError):
        raise Error(f"{path}: is no policy; give a file that torquer train wrote") from None
    if build != __build__:
        raise Error(f"{path}: is a policy of the build {build}, but this is {__build__}; train it again with this build")
    return policy


class _Many:
    """Environments that return to the start when their episodes end."""

    def __init__(self, name: str, realistic: bool, seed: int) -> None:
        task = dataclasses.replace(steve.task(name, training=True), max_steps=_TRAINING_STEPS)
        self._envs = [steve.SteveEnv(name, realistic, task, reward=None, arch_count=_ARCHES) for _ in range(_COUNT)]
        self.speeds = self._envs[0].action_space.high
        self.now = np.stack([features(env.reset(seed=_COUNT * seed + k)[0]) for k, env in enumerate(self._envs)])

    def step(self, actions: Array) -> Tuple[Array, Array, Array, Array, int]:
        """Features after a step, rewards, terminated, ended, and the number of targets that were reached. `now` has the
        features before the next step."""
        after = np.empty_like(self.now)
        rewards, terminated, ended, reached = np.zeros(_COUNT), np.zeros(_COUNT, bool), np.zeros(_COUNT, bool), 0
        for k, env in enumerate(self._envs):
            observation, rewards[k], terminated[k], truncated, info = env.step(actions[k].reshape(-1, 2) * self.speeds)
            after[k] = self.now[k] = features(observation)
            ended[k] = terminated[k] or truncated or info["at_end"]
            reached += info["success"]
            if ended[k]:
                self.now[k] = features(env.reset()[0])
        return after, rewards, terminated, ended, reached


def train(name: str, path: str, realistic: bool, steps: int, seed: int, out: Optional[TextIO] = None) -> Policy:
    """Trains a policy for a task and saves it as a new file, now and then and at the end. steps: of all environments;
    rounded up to whole updates of 2048."""
    steve.task(name)
    whole("steps", steps, 1, 10**9)
    whole("seed", seed, 1, 50_000)
    refuse_existing(path)
    curve: List[Tuple[float, ...]] = []
    saved = False
    began = time.monotonic()
    for episodes, reached, weights in _updates(name, realistic, seed):
        curve.append(((len(curve) + 1) * _COUNT * _LENGTH, episodes, reached, time.monotonic() - began))
        if out is not None:
            print(f"{curve[-1][0]:8.0f} steps: {reached} of {episodes} episodes reached the target", file=out, flush=True)
        ends = curve[-1][0] >= steps
        if len(curve) % _SAVED == 0 or ends:
            policy = Policy(name, realistic, seed, weights, np.array(curve))
            if saved:
                policy._write(path)
            else:
                policy.save(path)
            saved = True
        if ends:
            break
    return policy


def _updates(name: str, realistic: bool, seed: int) -> Iterator[Tuple[int, int, List[Array]]]:
    """Trains without end. Yields after each update the numbers of episodes that ended, and of those at the target, and
    the weights of the policy."""
    torch = need("torquer train", "torch", "python3-torch")
    ppo = need("torquer train", "torquer.examples.train_ppo", "python3-matplotlib")
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    many = _Many(name, realistic, seed)
    policy = ppo.Policy(many.now.shape[1], many.speeds.size)
    with torch.no_grad():
        policy.mean[-1].bias[::2] = 0.5  # pushes at half speed at first, or it would stay near the entry
    adam = ppo.optimizer(policy)
    while True:
        episodes, reached = _update(torch, ppo, many, policy, adam)
        yield episodes, reached, [value.detach().numpy().copy() for value in policy.mean.parameters()]


def _update(torch: Any, ppo: Any, many: _Many, policy: Any, adam: Any) -> Tuple[int, int]:
    """One update of the policy. Returns the numbers of episodes that ended, and of those at the target."""
    seen, acts, gains, last, ends, after = [], [], [], [], [], []
    episodes = reached = 0
    for _ in range(_LENGTH):
        seen.append(torch.tensor(many.now))
        with torch.no_grad():
            acts.append(policy.actions(seen[-1]).sample())
        behind, rewards, terminated, ended, success = many.step(acts[-1].clamp(-1, 1).numpy())
        after.append(torch.tensor(behind))
        gains.append(torch.tensor(rewards, dtype=torch.float32))
        last.append(torch.tensor(terminated))
        ends.append(torch.tensor(ended))
        episodes, reached = episodes + int(ended.sum()), reached + success
    x, a = torch.cat(seen), torch.cat(acts)
    with torch.no_grad():
        before = policy.value(x).reshape(_LENGTH, _COUNT)
        beyond = policy.value(torch.cat(after)).reshape(_LENGTH, _COUNT)
        old = policy.actions(x).log_prob(a).sum(1)
    advantage = ppo.advantages(gains, last, ends, before, beyond)
    ppo.improve(policy, adam, x, a, old, advantage.flatten(), (advantage + before).flatten())
    return episodes, reached


def evaluate(
    name: str, realistic: bool, act: Optional[Act], episodes: int, training: bool = False, out: Optional[TextIO] = None
) -> Dict[str, Any]:
    """Tests a policy in held-out episodes of a task, with its published step limit. act: None: all instruments are only
    pushed, at full speed. training: True: at the accuracy of training. Values that are not known are None. The rate is
    that of steps that do not begin at an end of the vessel."""
    env = steve.SteveEnv(name, realistic, steve.task(name, training))
    speeds = env.action_space.high
    push = np.tile([1.0, 0.0], (len(speeds), 1))
    rows = []
    steps, core_s = 0, 0.0
    for k in range(whole("episodes", episodes, 1, 10**6)):
        observation, info = env.reset(seed=HELD_OUT_SEED + k)
        ended, largest_mN, unknown = False, 0.0, 0
        began_s = info["time_s"]
        while not ended:
            shares = push if act is None else act(features(observation)).reshape(-1, 2)
            at_end, began_core_s = info["at_end"], time.process_time()
            observation, _, terminated, truncated, info = env.step(shares * speeds)
            if not at_end:
                steps, core_s = steps + 1, core_s + time.process_time() - began_core_s
            ended = terminated or truncated
            largest_mN = float(np.fmax(largest_mN, info["wall_force_mN"]))
            unknown += bool(np.isnan(info["wall_force_mN"]))
        rows.append((info["success"], info["safe_success"], info["time_s"] - began_s, info["path_ratio"], largest_mN, unknown))
        if out is not None:
            print(f"episode {k}: {info['target']}, {'reached' if info['success'] else 'missed'}", file=out, flush=True)
    success = np.array([row[0] for row in rows], bool)
    times = [row[2] for row in rows if row[0]]
    return {
        "task": name,
        "realistic": realistic,
        "episodes": episodes,
        "reached": int(success.sum()),
        "safe": sum(row[1] is True for row in rows),
        "safety_unknown": sum(row[1] is None for row in rows),
        "time_s": float(np.mean(times)) if times else None,
        "path_ratio": float(np.mean([row[3] for row in rows])),
        "force_p50_mN": float(np.median([row[4] for row in rows])),
        "force_max_mN": max(row[4] for row in rows),
        "steps_of_unknown_force": sum(row[5] for row in rows),
        "steps": steps,
        "steps_core_s": steps / max(core_s, 1e-9),
    }


def as_table(results: List[Dict[str, Any]]) -> str:
    """Results as a table in Markdown."""
    lines = [
        "| task | policy | reached | safely, unknown | time, s | path ratio | largest force of an episode p50, max, mN | "
        "steps/s a core |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in results:
        time_s = "-" if row["time_s"] is None else f"{row['time_s']:.1f}"
        lines.append(
            f"| {row['task']}{', realistic' if row['realistic'] else ''} | {row['policy']} | "
            f"{row['reached']} of {row['episodes']} | {row['safe']}, {row['safety_unknown']} | {time_s} | "
            f"{row['path_ratio']:.2f} | {row['force_p50_mN']:.0f}, {row['force_max_mN']:.0f} | {row['steps_core_s']:.0f} |"
        )
    return "\n".join(lines)
