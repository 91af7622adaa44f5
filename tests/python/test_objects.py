"""Scenes, simulations and reports as Python objects: how they are made, copied and shown."""

import copy
import importlib
import pathlib
import pickle
import pkgutil
import tomllib

import numpy as np
import pytest
import torquer
import torquer.envs


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


def test_settings_are_copied_and_pickled():
    for given in (torquer.Imaging("cine", magnification=2, wedge_left=(0.2, 10)), torquer.Injector("arm", volume_mL=5)):
        for other in (copy.copy(given), copy.deepcopy(given), pickle.loads(pickle.dumps(given))):
            assert other is not given and repr(other) == repr(given)


def test_objects_show_their_contents(phantom):
    simulation = torquer.Simulation(phantom)
    report = simulation.step(0.1, simulation.hands)
    assert repr(phantom) == f"Scene(name={phantom.name!r}, path={phantom.path!r})"
    assert repr(simulation) == f"Simulation(scene={phantom!r}, time_s=0.1)"
    assert repr(report).startswith(f"StepReport(ticks={report.ticks}, ") and "finished=True" in repr(report)
    assert repr(phantom.instruments[0]).startswith("InstrumentInfo(name='guidewire', max_length_mm=")
    imaging = torquer.Imaging("plain", magnification=2, left=0.1, wedge_right=(0.25, -30))
    assert repr(eval(repr(imaging), {"Imaging": torquer.Imaging})) == repr(imaging)
    assert "left=0.1" in repr(imaging)
    for mode in ("as_scene", "plain", "subtraction", "roadmap", "cine"):
        assert torquer.Imaging(mode).mode == mode


def test_every_public_class_shows_its_contents():
    seen = {getattr(torquer, name) for name in torquer.__all__} | {torquer.envs.VectorEnv, torquer.envs.Task}
    for module in pkgutil.walk_packages(torquer.__path__, "torquer."):
        if any(part.startswith("_") for part in module.name.split(".")) or module.name.startswith("torquer.examples"):
            continue
        try:
            contents = vars(importlib.import_module(module.name))
        except torquer.Error:
            continue  # stable-baselines3 is missing
        seen |= {one for one in contents.values() if getattr(one, "__module__", None) == module.name}
    classes = {one for one in seen if isinstance(one, type) and not one.__name__.startswith("_")}
    assert {torquer.envs.NavigationEnv, torquer.envs.VectorEnv, torquer.Scene, torquer.States} < classes
    assert not [one for one in classes if one.__repr__ is object.__repr__]
    env = torquer.envs.make("ty_phantom")
    assert repr(env) == "NavigationEnv(scene='ty_phantom', target=('side', 40.0), observation='vector', time_s=0.0)"
    many = torquer.envs.VectorEnv("ty_phantom", 3, 1)
    assert repr(many) == "VectorEnv(scene='ty_phantom', num_envs=3, observation='vector')"


def test_devices_are_those_of_scenes(phantom):
    folder = pathlib.Path(__file__).parents[2] / "host/devices"
    assert torquer.device_names() == sorted(path.stem for path in folder.glob("*.toml")) != []
    for name in torquer.device_names():
        device = torquer.device(name)
        assert device.kind in ("guidewire", "catheter") and device.product and device.sources[0]["citation"]
        # The scene reads the file itself.
        of_scene = ("radius_mm", "tip_mm", "tip_angle_deg")
        values = {f"instrument.guidewire.{key}": None for key in of_scene}
        one = phantom.with_values({**values, "instrument.guidewire.device": name}).instruments[0]
        assert one.tip_radius_mm == np.atleast_1d(device.instrument["radius_mm"])[0], name
        assert one.inner_radius_mm == device.instrument.get("inner_radius_mm", 0)
    with pytest.raises(torquer.Error, match="no device 'sion_red'; did you mean sion. there are: amplatz, .*sion_blue"):
        torquer.device("sion_red")


def test_names_have_units():
    assert torquer.unit_of("wall_force_sum_mN") == "mN" and torquer.unit_of("heart_rate_per_min") == "1/min"
    assert torquer.unit_of("residual") == "1"


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
    assert other.effects == ["torsion", "wall_force", "internal_forces", "assessment"] and "[case]" not in other.text
    table = tomllib.loads(other.text)
    assert table["relaxation"] == {"budget_units": 7} and table["entry"]["at_mm"] == 2
    assert table["instrument"][0]["from_tip_mm"] == [0, 40] and table["instrument"][0]["rigidity_N_mm2"] == [0.01, 0.5]
    assert pickle.loads(pickle.dumps(other)).content_hash == other.content_hash
    for bad in (object(), [1, "a"], [[1, 2]], {"a": 1}, 2**70, []):
        with pytest.raises(torquer.Error, match="relaxation.budget_units"):
            phantom.with_values({"relaxation.budget_units": bad})
    assert "coefficient = 0.25" in phantom.with_values({"effects.friction.coefficient": np.array(0.25)}).text
    with pytest.raises(torquer.Error, match="not Unicode"):
        phantom.with_values({"\ud800": 1})
    with pytest.raises(torquer.Error, match="is no path"):
        torquer.Scene("\ud800")
    with pytest.raises(torquer.Error, match="a key of values is 7; give a text"):
        phantom.with_values({7: 1})
    with pytest.raises(torquer.Error, match=r"mine\.toml:4: vessel.kind"):
        torquer.Scene.from_text('name = "x"\n\n[vessel]\nkind = "sponge"\n', path="mine.toml")


def test_missing_values_and_impossible_positions_are_errors(phantom):
    simulation = torquer.Simulation(phantom)
    with pytest.raises(torquer.Error, match=r"ty_phantom: has no forces along the wire; add \[effects.internal_forces\]"):
        simulation.forces()
    with pytest.raises(torquer.Error, match="ty_phantom.toml: vessel.kind = \"ty_phantom\": has no surface"):
        phantom.surface()
    with pytest.raises(torquer.Error, match="the hand of guidewire is at -3 mm; give 0 or more"):
        simulation.step(0.1, [[-3.0, 0.0]])
    simulation.step(0.1, [[-1e-12, 0.0]])  # rounding
    for bad in ({"magnification": 5}, {"pulses_per_s": 0.5}, {"left": 0.6}):
        with pytest.raises(torquer.Error, match=f"imaging has .*{next(iter(bad))}"):
            torquer.Imaging(**bad)
    assert [torquer.Imaging(mode).mode for mode in torquer.Imaging.MODES] == list(torquer.Imaging.MODES)


def test_a_surface_is_that_of_the_vessel(tmp_path):
    scene = torquer.Scene("neuro_arch")
    surface = scene.surface()
    low, high = scene.bounds_mm
    assert np.allclose(surface.points_mm.min(axis=0), low) and np.allclose(surface.points_mm.max(axis=0), high)
    corners = surface.points_mm[surface.triangles]
    assert surface.findings == scene.findings and len(corners) > 1000
    # Counterclockwise from outside: a step against the normal leads into the lumen.
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    inside = scene.clearance_mm(corners.mean(axis=1)[::500] - 0.2 * normals[::500])
    assert (inside > 0).mean() > 0.95
    file = pathlib.Path(torquer.scene_path("neuro_arch")).parent / tomllib.loads(scene.text)["vessel"]["file"]
    check = torquer.check_mesh(file)
    assert check.is_usable and "triangles" in str(check) and "[vessel]" in check.proposal
    (tmp_path / "bad.obj").write_text("v 0 0 0\n")
    assert not torquer.check_mesh(tmp_path / "bad.obj").is_usable
    with pytest.raises(torquer.Error, match="none.obj"):
        torquer.check_mesh(tmp_path / "none.obj")


def test_wedge_filters_darken_a_side_of_the_picture(phantom):
    scene = phantom.with_values({"effects.fluoroscopy.photons": 1e6})
    pictures, doses = [], []
    for wedge in ((0.5, 0), (0, 0)):
        simulation = torquer.Simulation(scene)
        imaging = torquer.Imaging("plain", wedge_left=wedge)
        assert (imaging.wedge_left, imaging.wedge_right) == (wedge, (0, 0))
        simulation.step(0.1, simulation.hands, xray=True, imaging=imaging)
        pictures.append(simulation.picture().astype(float))
        doses.append(simulation.readings()["kerma_area_Gy_cm2"])
    darker = pictures[1] - pictures[0]
    width = darker.shape[1]
    assert darker[:, : width // 3].mean() > 20 and darker[:, width // 2 :].mean() == 0
    # 0.5 mm of copper transmit 49 % at 60 keV; within the ramp, a tenth of the width, more passes.
    assert 1 - 0.5 * 0.51 < doses[0] / doses[1] < 1 - 0.4 * 0.51
    for bad in (float("nan"), -0.1, 0.6):
        with pytest.raises(torquer.Error, match=f"wedges left {bad} at 0 deg, .*; give .* wedges 0 to 0.5 at -90 to 90 deg"):
            torquer.Imaging(wedge_left=(bad, 0))
    for bad in (float("nan"), -91, 1e9):
        with pytest.raises(torquer.Error, match="right 0.1 at"):
            torquer.Imaging(wedge_right=(0.1, bad))
    with pytest.raises(TypeError):
        torquer.Imaging(wedge_left=0.3)


def test_the_power_injector_injects_its_volume_once():
    simulation = torquer.Simulation("coronary")

    def injected(order, until_s, **set_up):
        injector = torquer.Injector(order, **set_up)
        assert eval(repr(injector), {"Injector": torquer.Injector}).order == injector.order == order
        simulation.step(until_s, simulation.hands, injector=injector)
        return simulation.readings()["contrast_injected_mL"]

    set_up = {"volume_mL": 2, "rate_mL_s": 10, "delay_s": 0.05, "rise_s": 0.1}
    assert injected("inject", 0.01, **set_up) == 0
    assert injected("arm", 0.02, **set_up) == 0
    # 0.1 s of rise, and 0.05 s at 10 mL/s.
    assert injected("inject", 0.22, **set_up) == pytest.approx(0.5 + 0.5)
    assert injected("inject", 0.33, **set_up) == pytest.approx(2)
    readings = simulation.readings()
    assert (readings["injector_phase"], readings["injections"]) == (3, 1)
    assert torquer.Injector().volume_mL == -1
    with pytest.raises(torquer.Error, match="order is 'fire'; give off, arm or inject"):
        torquer.Injector("fire")
    with pytest.raises(torquer.Error, match="injector has volume_mL 200; give 0.1 to 150, or -1 for the scene's value"):
        torquer.Injector(volume_mL=200)


def test_points_are_where_the_picture_shows_them():
    scene = torquer.Scene("everything").with_values({"effects.fluoroscopy.photons": 1e6, "effects.heartbeat": False})
    simulation = torquer.Simulation(scene)
    for time_s, lao_deg, magnification, table_mm in ((0.1, 0, 1, (0, 0, 0)), (0.2, 30, 2, (0, 0, 0)), (0.3, 0, 1, (12, -8, 40))):
        imaging = torquer.Imaging("plain", magnification=magnification)
        simulation.step(time_s, simulation.hands, lao_deg=lao_deg, xray=True, imaging=imaging, table_mm=table_mm)
        for plane in range(2):
            picture = simulation.picture(plane).astype(float)
            places = simulation.places_in_picture(simulation.instrument_nodes_mm(0), plane)
            height, width = picture.shape
            seen = [(round(row), round(column)) for column, row in places if 8 <= row < height - 8 and 8 <= column < width - 8]
            assert len(seen) > 5
            # The wire is darker than its surroundings.
            there = [picture[row, column] for row, column in seen]
            around = [picture[row - 8 : row + 9, column - 8 : column + 9].mean() for row, column in seen]
            assert np.mean(np.less(there, around)) > 0.8
    for bad in ((151, 0, 0), (0, float("nan"), 0), (0, 0, -151)):
        with pytest.raises(torquer.Error, match="the table is at"):
            simulation.step(1, simulation.hands, table_mm=bad)
    assert np.isnan(simulation.places_in_picture([[0, 0, 1e6], [0, 1e6, 0], [1e6, 0, 0], [0, 0, -1e6], [0, -1e6, 0], [-1e6, 0, 0]])).any()
    with pytest.raises(torquer.Error, match="plane 2 does not exist; give 0 to 1"):
        simulation.places_in_picture([[0, 0, 0]], 2)


def test_the_citation_is_of_this_version():
    file = pathlib.Path(__file__).parents[2] / "CITATION.cff"
    cited = dict(line.partition(": ")[::2] for line in file.read_text().splitlines() if line[:1].isalpha())
    assert cited["version"] == torquer.__version__ and cited["license"] == "Apache-2.0"
    # The fields that the format requires.
    assert cited["cff-version"] == "1.2.0" and cited["message"] and cited["title"] == "Torquer" and "authors:" in cited


def test_errors_are_value_errors_that_name_the_file():
    with pytest.raises(ValueError, match="no/such.toml"):
        torquer.Scene("no/such.toml")
