"""Scenes, simulations and reports as Python objects: how they are made, copied and shown."""

import copy
import pickle
import tomllib

import numpy as np
import pytest
import torquer


@pytest.fixture(scope="module")
def phantom():
    return torquer.Scene("ty_phantom")


def test_a_path_and_a_name_make_a_scene_and_a_simulation(tmp_path):
    file = tmp_path / "copy.toml"
    file.write_text(torquer.Scene("ty_phantom").text)
    for given in (file, str(file)):
        assert torquer.Scene(given).path == str(file)
        assert torquer.Simulation(given).scene.path == str(file)
    assert torquer.Simulation("ty_phantom").state_hash == torquer.Simulation(file).state_hash
    with pytest.raises(torquer.Error, match="no such file.*ty_phantom"):
        torquer.Simulation("ty_fantom")
    for bad in (7, None, ["ty_phantom"]):
        with pytest.raises(TypeError):
            torquer.Scene(bad)
        with pytest.raises(TypeError):
            torquer.Simulation(bad)


def test_a_deep_copy_continues_alone(phantom):
    simulation = torquer.Simulation(phantom)
    hands = simulation.hands + [[5, 0.3]]
    simulation.step(0.1, hands)
    (twin,) = copy.deepcopy([simulation])
    before = simulation.state_hash
    assert twin.state_hash == before and twin is not simulation
    twin.step(0.2, hands + [[3, 0]])
    assert simulation.state_hash == before != twin.state_hash


def test_objects_show_their_contents(phantom):
    simulation = torquer.Simulation(phantom)
    report = simulation.step(0.1, simulation.hands)
    assert repr(phantom) == f"Scene(name={phantom.name!r}, path={phantom.path!r})"
    assert repr(simulation) == f"Simulation(scene={phantom!r}, time_s=0.1)"
    assert repr(report).startswith(f"StepReport(ticks={report.ticks}, ") and "finished=True" in repr(report)
    assert repr(phantom.instruments[0]).startswith("InstrumentInfo(name='guidewire', max_length_mm=")
    imaging = torquer.Imaging("plain", magnification=2, left=0.1)
    assert repr(eval(repr(imaging), {"Imaging": torquer.Imaging})) == repr(imaging)
    assert "left=0.1" in repr(imaging)


def test_a_scene_with_values_of_python(phantom):
    scene = phantom.with_values({"effects.friction.coefficient": 0.2})
    assert "coefficient = 0.2" in scene.text and "coefficient = 0.1" in phantom.text
    values = {
        "instrument.guidewire.from_tip_mm": np.array([0, 40]),
        "instrument.guidewire.rigidity_N_mm2": (0.01, np.float32(0.5)),
        "relaxation.budget_units": np.int64(7),
        "entry.at_mm": np.float32(2),
        "effects.friction": np.bool_(False),
        "effects.internal_forces": True,
        "case": None,
    }
    other = phantom.with_values(values)
    assert other.effects == ["internal_forces"] and "[case]" not in other.text
    table = tomllib.loads(other.text)
    assert table["relaxation"] == {"budget_units": 7} and table["entry"]["at_mm"] == 2
    assert table["instrument"][0]["from_tip_mm"] == [0, 40] and table["instrument"][0]["rigidity_N_mm2"] == [0.01, 0.5]
    assert pickle.loads(pickle.dumps(other)).content_hash == other.content_hash
    for bad in (object(), [1, "a"], [[1, 2]], {"a": 1}, 2**70, []):
        with pytest.raises(torquer.Error, match="relaxation.budget_units"):
            phantom.with_values({"relaxation.budget_units": bad})
    with pytest.raises(torquer.Error, match="a key of values is 7; give a text"):
        phantom.with_values({7: 1})
    with pytest.raises(torquer.Error, match=r"mine\.toml:4: vessel.kind"):
        torquer.Scene.from_text('name = "x"\n\n[vessel]\nkind = "sponge"\n', path="mine.toml")
