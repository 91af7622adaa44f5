"""Baselines of the tasks in torquer.steve: torquer train makes a policy, torquer evaluate tests policies.

A policy learns from a scripted teacher, which sees the whole state of the simulation and of the vessel. The method is
DAgger (Ross, Gordon and Bagnell 2011): the policy steers, the teacher says at each step how it would steer, and the
policy learns that by regression. The policy sees the published observation alone, and sets the published actions. It
has a memory, a gated recurrent unit (Cho et al. 2014). Training is at the accuracy of training; its episodes end after
150 steps. In ArchVariety they take place in 48 arches. The file of a policy has the hash of the build. Another build
may find other shapes, so an evaluation refuses the file.
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
from ._teacher import Teacher
from ._user_file import open_file

Array = npt.NDArray[Any]
Observation = Dict[str, Array]
Act = Callable[[Observation], Array]
"""Speeds as fractions of the limits, shape (instruments, 2), from an observation. It may remember the episode."""
Begin = Callable[[steve.SteveEnv, Dict[str, Any]], Act]
"""Act for the episode that a reset has begun, from the environment and the info of the reset."""

HELD_OUT_SEED = 1_000_000
"""Seed of the first episode of an evaluation. Training draws its episodes from other seeds."""
_WIDTH = 64  # of the network
_WEIGHTS = 8  # arrays of its three layers
_UPDATE_STEPS = 4096  # of the environment, for each update
_SAMPLES = 150_000  # steps that an update learns from, some of them several times
_EPISODES = 24  # that the regression takes at once
_TRAINING_STEPS = 150
_TAUGHT = 4  # updates after which the teacher no longer steers
_ARCHES = 48
_SAVED = 4  # updates between two saves
_LEARNING_RATE = 2e-3

# Differences between places in the picture, in units of its half, to about one.
_SCALE = 30.0
_LONGEST_MM, _LARGEST_RAD = (speed * steve.STEP_S for speed in steve.SPEEDS)


class _Senses:
    """Features of the observations of an episode."""

    def __init__(self) -> None:
        self._turned_rad = self._fed_mm = 0.0
        self._bend = np.zeros(2)

    def __call__(self, observation: Observation) -> Array:
        """Places and the action; waves of the tip and the target; sums of the wire's actions so far, and the bend."""
        tracking, target, action = (observation[name].astype(float) for name in ("tracking", "target", "last_action"))
        tip = tracking[0, 0]
        near = _SCALE * (tracking.reshape(-1, 2)[1:] - tip)
        octaves = np.pi * 2.0 ** np.arange(5)
        waves = np.concatenate([np.outer(octaves, tip).ravel(), np.outer(octaves[:3], target).ravel()])
        way = target - tip
        parts = [tip, near.ravel(), target, 4 * way, 10 * way, action.ravel(), np.sin(waves), np.cos(waves)]
        out: Array = np.clip(np.concatenate([*parts, self._summed(tracking[0], action[0])]), -5, 5).astype(np.float32)
        return out

    def _summed(self, points: Array, action: Array) -> Array:
        """Rotation and feed so far; the bend in the picture, and what of it goes with the rotation."""
        self._fed_mm = max(0.0, self._fed_mm + action[0] * _LONGEST_MM)
        self._turned_rad += action[1] * _LARGEST_RAD
        first, second = _SCALE * (points[0] - points[1]), _SCALE * (points[1] - points[2])
        lengths = np.linalg.norm(first) * np.linalg.norm(second)
        bend = 20 * (first[0] * second[1] - first[1] * second[0]) / (lengths + 0.05)
        cos, sin = np.cos(self._turned_rad), np.sin(self._turned_rad)
        self._bend += 0.1 * (bend * np.array([cos, sin]) - self._bend)
        along = 2 * np.array([[cos, sin], [sin, -cos]]) @ self._bend
        fed = self._fed_mm / np.array([10.0, 30.0])
        out: Array = np.concatenate([[bend, cos, sin], along, [self._fed_mm / 200], np.sin(fed), np.cos(fed)])
        return out


def _sigmoid(x: Array) -> Array:
    out: Array = 1 / (1 + np.exp(-x))
    return out


@dataclasses.dataclass(frozen=True)
class Policy:
    """A trained policy, and its origin."""

    task: str
    realistic: bool
    seed: int
    weights: List[Array]
    """Matrix and offset of the first layer; two matrices and two offsets of the gated recurrent unit, as in PyTorch;
    matrix and offset of the last layer."""
    curve: Array
    """Learning curve: rows of steps, episodes that the policy steered alone, those that reached the target, seconds."""

    def begin(self, env: steve.SteveEnv, info: Dict[str, Any]) -> Act:
        """Act for one episode. It uses the observations alone."""
        senses, memory = _Senses(), np.zeros(len(self.weights[0]), np.float32)

        def act(observation: Observation) -> Array:
            memory[:], shares = self.step(senses(observation), memory)
            return shares.reshape(-1, 2)

        return act

    def step(self, x: Array, memory: Array) -> Tuple[Array, Array]:
        """Next memory, and fractions of the speeds, for the features of an observation."""
        first, first_offset, inner, own, inner_offset, own_offset, last, last_offset = self.weights
        new = np.split(inner @ np.tanh(first @ x + first_offset) + inner_offset, 3)
        old = np.split(own @ memory + own_offset, 3)
        reset, keep = _sigmoid(new[0] + old[0]), _sigmoid(new[1] + old[1])
        memory = (1 - keep) * np.tanh(new[2] + reset * old[2]) + keep * memory
        return memory, np.tanh(last @ memory + last_offset)

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
            if len(weights) != _WEIGHTS:
                raise KeyError("weights")
            policy = Policy(task, about["realistic"], about["seed"], weights, file["curve"])
    except Error:
        raise
    except (KeyError, OSError, TypeError, ValueError, zipfile.BadZipFile, EOFError):
        raise Error(f"{path}: is no policy; give a file that torquer train wrote") from None
    if build != __build__:
        raise Error(f"{path}: is a policy of the build {build}, but this is {__build__}; train it again with this build")
    return policy


def pushed(env: steve.SteveEnv, info: Dict[str, Any]) -> Act:
    """All instruments are only pushed, at full speed."""
    push = np.tile([1.0, 0.0], (len(env.action_space.high), 1))
    return lambda observation: push


def taught(env: steve.SteveEnv, info: Dict[str, Any]) -> Act:
    """The teacher. It sees the whole state."""
    teacher = Teacher(env, info)
    return lambda observation: teacher.act()


def train(name: str, path: str, realistic: bool, steps: int, seed: int, out: Optional[TextIO] = None) -> Policy:
    """Trains a policy for a task and saves it as a new file, now and then and at the end. The last episode of an update
    is completed, so there are some more steps."""
    steve.task(name)
    whole("steps", steps, 1, 10**9)
    whole("seed", seed, 1, 50_000)
    refuse_existing(path)
    curve: List[Tuple[float, ...]] = []
    saved = False
    began = time.monotonic()
    for done, episodes, reached, weights in _updates(name, realistic, steps, seed):
        curve.append((done, episodes, reached, time.monotonic() - began))
        if out is not None:
            print(f"{done:8d} steps: {reached} of {episodes} episodes reached the target", file=out, flush=True)
        if len(curve) % _SAVED == 0 or done >= steps:
            policy = Policy(name, realistic, seed, weights, np.array(curve))
            if saved:
                policy._write(path)
            else:
                policy.save(path)
            saved = True
    return policy


def _updates(name: str, realistic: bool, steps: int, seed: int) -> Iterator[Tuple[int, int, int, List[Array]]]:
    """Trains until so many steps are done. Yields after each update the steps so far, the episodes that the policy
    steered alone, those at the target, and the weights of the policy."""
    torch = need("torquer train", "torch", "python3-torch")
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    random = np.random.default_rng(seed)
    task = dataclasses.replace(steve.task(name, training=True), max_steps=_TRAINING_STEPS)
    env = steve.SteveEnv(name, realistic, task, reward=None, arch_count=_ARCHES)
    inputs, outputs = len(_Senses()(env.reset(seed=seed)[0])), env.action_space.high.size
    layers = torch.nn.Linear(inputs, _WIDTH), torch.nn.GRU(_WIDTH, _WIDTH), torch.nn.Linear(_WIDTH, outputs)
    network = torch.nn.ModuleList(layers)
    adam = torch.optim.Adam(network.parameters(), lr=_LEARNING_RATE)
    lessons: List[_Lesson] = []
    done = update = 0
    while done < steps:
        policy = Policy(name, realistic, seed, _weights(network), np.empty((0, 4)))
        first, episodes, reached = done, 0, 0
        while done < min(first + _UPDATE_STEPS, steps):
            taught_share = 1.0 if update == 0 else 0.3 if update < _TAUGHT else 0.0
            led, noisy = random.random() < taught_share, random.random() < 0.5
            lesson, success = _lesson(env, policy, random, led, noisy)
            lessons.append(lesson)
            done += len(lesson[0])
            if not led and not noisy:
                episodes, reached = episodes + 1, reached + success
        for group in adam.param_groups:
            group["lr"] = _LEARNING_RATE * max(0.1, 1 - first / steps)
        _learn(torch, network, adam, lessons, random)
        update += 1
        yield done, episodes, reached, _weights(network)


_Lesson = Tuple[Array, Array]
"""Features of the steps of an episode, and the teacher's actions."""


def _weights(network: Any) -> List[Array]:
    return [value.detach().numpy().copy() for value in network.parameters()]


def _lesson(
    env: steve.SteveEnv, policy: Policy, random: np.random.Generator, led: bool, noisy: bool
) -> Tuple[_Lesson, bool]:
    """An episode, and True if it reached the target. led: the teacher steers. noisy: bursts disturb the actions."""
    observation, info = env.reset()
    teacher, senses = Teacher(env, info), _Senses()
    memory, burst = np.zeros(_WIDTH, np.float32), np.zeros(env.action_space.high.shape)
    seen, wanted, ended = [], [], False
    while not ended:
        seen.append(senses(observation))
        wanted.append(teacher.act())
        memory, own = policy.step(seen[-1], memory)
        if noisy and random.random() < 0.1:
            burst = random.normal(0, 0.7, burst.shape) * (random.random() < 0.5)
        shares = np.clip((wanted[-1] if led else own.reshape(-1, 2)) + burst, -1, 1)
        observation, _, terminated, truncated, info = env.step(shares * env.action_space.high)
        ended = terminated or truncated
    return (np.array(seen), np.array(wanted, np.float32).reshape(len(wanted), -1)), info["success"]


def _learn(torch: Any, network: Any, adam: Any, lessons: List[_Lesson], random: np.random.Generator) -> None:
    """Regression of the teacher's actions. Episodes of about the same length are learned together."""
    by_length = sorted(lessons, key=lambda lesson: len(lesson[0]))
    left = _SAMPLES
    while left > 0:
        first = int(random.integers(-_EPISODES, len(by_length)))
        chosen = by_length[max(0, min(first, len(by_length) - _EPISODES)) :][:_EPISODES]
        sequences = [[torch.tensor(part[k]) for part in chosen] for k in (0, 1)]
        seen, wanted = (torch.nn.utils.rnn.pad_sequence(sequence) for sequence in sequences)
        valid = torch.nn.utils.rnn.pad_sequence([torch.ones(len(part[0]), 1) for part in chosen])
        first_layer, recurrent, last_layer = network
        found = torch.tanh(last_layer(recurrent(torch.tanh(first_layer(seen)))[0]))
        loss = (valid * (found - wanted) ** 2).sum() / valid.sum()
        adam.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        adam.step()
        left -= int(valid.sum())


def evaluate(
    name: str, realistic: bool, begin: Begin, episodes: int, training: bool = False, out: Optional[TextIO] = None
) -> Dict[str, Any]:
    """Tests a policy in held-out episodes of a task, with its published step limit. training: True: at the accuracy
    of training. Values that are not known are None. The rate is that of steps that do not begin at an end of the
    vessel."""
    env = steve.SteveEnv(name, realistic, steve.task(name, training))
    speeds = env.action_space.high
    rows = []
    steps, core_s = 0, 0.0
    for k in range(whole("episodes", episodes, 1, 10**6)):
        observation, info = env.reset(seed=HELD_OUT_SEED + k)
        act = begin(env, info)
        ended, largest_mN, unknown = False, np.nan, 0
        began_s = info["time_s"]
        while not ended:
            shares = act(observation)
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
    forces_mN = [row[4] for row in rows if not np.isnan(row[4])]
    return {
        "task": name,
        "realistic": realistic,
        "episodes": episodes,
        "reached": int(success.sum()),
        "safe": sum(row[1] is True for row in rows),
        "safety_unknown": sum(row[1] is None for row in rows),
        "time_s": float(np.mean(times)) if times else None,
        "path_ratio": float(np.mean([row[3] for row in rows])),
        "force_p50_mN": float(np.median(forces_mN)) if forces_mN else None,
        "force_max_mN": max(forces_mN, default=None),
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
        forces = "-" if row["force_max_mN"] is None else f"{row['force_p50_mN']:.0f}, {row['force_max_mN']:.0f}"
        lines.append(
            f"| {row['task']}{', realistic' if row['realistic'] else ''} | {row['policy']} | "
            f"{row['reached']} of {row['episodes']} | {row['safe']}, {row['safety_unknown']} | {time_s} | "
            f"{row['path_ratio']:.2f} | {forces} | {row['steps_core_s']:.0f} |"
        )
    return "\n".join(lines)
