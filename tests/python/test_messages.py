"""Messages repeat a long value of the caller only in part."""

import dataclasses
import functools

import numpy as np
import pytest
import torquer
import torquer.arches
import torquer.envs
import torquer.steve
import torquer.trees

LONG = "x" * 10_000
# A message may name the value twice, and list all known names.
MOST = 2000


@functools.lru_cache(maxsize=None)
def phantom():
    return torquer.Scene("ty_phantom")


@functools.lru_cache(maxsize=None)
def simulation():
    return torquer.Simulation(phantom())


@functools.lru_cache(maxsize=None)
def env():
    return torquer.envs.make("ty_phantom")


@functools.lru_cache(maxsize=None)
def vector():
    many = torquer.envs.VectorEnv("ty_phantom", 2)
    many.reset(seed=0)
    return many


def step_with_reward(reward):
    rewarded = torquer.envs.make("ty_phantom", reward=lambda moment: reward)
    rewarded.reset(seed=0)
    rewarded.step([0.0, 0.0])


def value(key, given):
    return lambda: phantom().with_values({key: given})


def task(**changed):
    given = dataclasses.replace(torquer.envs.TASKS["ty_phantom"], **changed)
    return lambda: torquer.envs.make("ty_phantom", "tracking" if "tracking_noise_px" in changed else "vector", task=given)


def options(**given):
    return lambda: env().reset(options=given)


CALLS = {
    "Scene": lambda: torquer.Scene(LONG),
    "Simulation": lambda: torquer.Simulation(LONG),
    "text": lambda: torquer.Scene.from_text(LONG),
    "text of a kind": lambda: torquer.Scene.from_text(f'name = "a"\n[vessel]\nkind = "{LONG}"'),
    "key": value(LONG, 1),
    "key of an effect": value(f"effects.{LONG}", 1),
    "key of an instrument": value(f"instrument.{LONG}.radius_mm", 1),
    "key of another type": value((LONG,), 1),
    "text for a number": value("effects.friction.coefficient", LONG),
    "bytes for a number": value("effects.friction.coefficient", LONG.encode()),
    "table for a number": value("effects.friction.coefficient", {LONG: 1}),
    "list for a number": value("effects.friction.coefficient", [LONG, 1]),
    "kind": value("vessel.kind", LONG),
    "device": value("instrument.guidewire.device", LONG),
    "centerline of the entry": value("entry.centerline", LONG),
    "script": lambda: phantom().parse_script(LONG),
    "column": lambda: phantom().parse_script(f"time_s,{LONG}\n"),
    "cell": lambda: phantom().parse_script(f"time_s,guidewire.insertion_mm,guidewire.rotation_rad\n{LONG},0,0"),
    "centerline": lambda: phantom().centerline_mm(LONG),
    "route": lambda: phantom().route_mm(LONG, 1),
    "exchanged instrument": lambda: simulation().exchange(LONG, "sion"),
    "exchanged device": lambda: simulation().exchange("guidewire", LONG),
    "tracked key": lambda: simulation().track_sensitivities([LONG]),
    "tracked key of an effect": lambda: simulation().track_sensitivities([f"effects.{LONG}"]),
    "reading": lambda: simulation().readings()[LONG],
    "Imaging": lambda: torquer.Imaging(LONG),
    "Injector": lambda: torquer.Injector(LONG),
    "device of the library": lambda: torquer.device(LONG),
    "scene_path": lambda: torquer.scene_path(LONG),
    "make": lambda: torquer.envs.make(LONG),
    "observation": lambda: torquer.envs.make("ty_phantom", LONG),
    "observations": lambda: torquer.envs.make("ty_phantom", (LONG,)),
    "render_mode": lambda: torquer.envs.make("ty_phantom", render_mode=LONG),
    "task": lambda: torquer.envs.make("ty_phantom", task=LONG),
    **{
        name: task(**{name: LONG})
        for name in ("centerline", "at_mm", "within_mm", "instrument", "max_steps", "segment_mm", "other_targets", "tracking_noise_px")
    },
    "other target": task(other_targets=((LONG, 1),)),
    "other targets": task(other_targets=((LONG, LONG),)),
    "option": options(**{LONG: 1}),
    "options": lambda: env().reset(options=LONG),
    "target": options(target=LONG),
    "target of two": options(target=(LONG, 1)),
    "rotation_rad": options(rotation_rad=LONG),
    "seed": lambda: env().reset(seed=LONG),
    "action": lambda: env().step(LONG),
    "vector": lambda: torquer.envs.VectorEnv(LONG, 2),
    "count": lambda: torquer.envs.VectorEnv("ty_phantom", LONG),
    "threads": lambda: torquer.envs.VectorEnv("ty_phantom", 2, LONG),
    "seeds": lambda: vector().reset(seed=[LONG, LONG]),
    "reset_mask": lambda: vector().reset(options={"reset_mask": LONG}),
    "actions": lambda: vector().step(LONG),
    "ids": lambda: vector().send(np.zeros((1, 2)), LONG),
    "many ids": lambda: vector().send(np.zeros((5000, 2)), np.arange(5000)),
    "reward": lambda: step_with_reward(LONG),
    "types of arches": lambda: torquer.arches.draw(0, [LONG]),
    "seed of an arch": lambda: torquer.arches.draw(LONG),
    "generations": lambda: torquer.trees.draw(0, LONG),
    "task of stEVE_bench": lambda: torquer.steve.task(LONG),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_message_repeats_a_long_value_only_in_part(name):
    with pytest.raises(torquer.Error) as raised:
        CALLS[name]()
    message = str(raised.value)
    assert len(message) <= MOST and LONG[:1000] not in message
