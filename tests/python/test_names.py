"""A name that is nearly right: the message proposes the right one. A name that is like none gets no proposal."""

import subprocess
import sys

import pytest
import torquer
import torquer.arches as arches
import torquer.envs as envs
import torquer.steve as steve

SIDE = envs.Task("side", 40.0)


def phantom():
    return torquer.Scene("ty_phantom")


def env(**others):
    return envs.NavigationEnv(phantom(), SIDE, **others)


@pytest.mark.parametrize(
    "call, proposed",
    [
        (lambda: torquer.device("sion_bleu"), "sion_blue"),
        (lambda: torquer.scene_path("neuro_arhc"), "neuro_arch"),
        (lambda: torquer.Scene("neuro_arhc"), "neuro_arch"),
        (lambda: torquer.Simulation("neuro_arhc"), "neuro_arch"),
        (lambda: phantom().with_values({"effects.frction": True}), "friction"),
        (lambda: torquer.Simulation(phantom()).exchange("guidewir", "sion_blue"), "guidewire"),
        (lambda: envs.make("ty_fantom"), "ty_phantom"),
        (lambda: envs.make_vec("ty_fantom"), "ty_phantom"),
        (lambda: envs.make("ty_fantom", task=SIDE), "ty_phantom"),
        (lambda: envs.VectorEnv("ty_fantom", 2), "ty_phantom"),
        (lambda: env(observation="vectr"), "vector"),
        (lambda: env(observation=("vector", "trackin")), "tracking"),
        (lambda: env(render_mode="rgb_aray"), "rgb_array"),
        (lambda: env().reset(options={"targt": ("side", 40.0)}), "target"),
        (lambda: env().reset(options={"target": ("sied", 40.0)}), "side"),
        (lambda: steve.task("basicwirenav"), "BasicWireNav"),
        (lambda: steve.SteveEnv("ArchVarety"), "ArchVariety"),
        (lambda: arches.draw(1, types=["I", "bovin"]), "bovine"),
        (lambda: torquer.Imaging("subtracton"), "subtraction"),
        (lambda: torquer.Injector("injct"), "inject"),
        (lambda: torquer.Simulation(phantom().with_values({"effects.internal_forces": True})).readings()["guidewire.hand_force"], "guidewire.hand_force_mN"),
    ],
)
def test_the_nearest_name_is_proposed(call, proposed):
    with pytest.raises(torquer.Error, match=f"did you mean {proposed}\\? "):
        call()


def test_a_vessel_that_is_nearly_right_gets_the_nearest_ones():
    with pytest.raises(torquer.Error, match='the nearest names are "side"'):
        envs.NavigationEnv(phantom(), envs.Task("sied", 40.0))


def test_a_field_of_states_gets_the_nearest_one():
    states = torquer.States({"time_s": [], "tension_mN": []}, {}, 0)
    with pytest.raises(KeyError, match="did you mean tension_mN"):
        states["tenson_mN"]


def test_a_name_like_none_gets_no_proposal():
    for call in (
        lambda: torquer.device("aquarium"),
        lambda: envs.make("aquarium"),
        lambda: env(observation="aquarium"),
        lambda: env(observation=7),
        lambda: env().reset(options={"target": 7}),
        lambda: torquer.Imaging("aquarium"),
    ):
        with pytest.raises((torquer.Error, TypeError)) as refused:
            call()
        assert "did you mean" not in str(refused.value)


def test_commands_propose_a_task():
    for words in (["benchmark", "coronry"], ["train", "ArchVarety", "a.npz"], ["evaluate", "--pushed", "ArchVarety"]):
        ended = subprocess.run([sys.executable, "-m", "torquer", *words], capture_output=True, text=True)
        assert ended.returncode == 2 and "did you mean" in ended.stderr
