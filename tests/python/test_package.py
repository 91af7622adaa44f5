"""The Python package returns the values of the simulation."""

import copy
import gc
import json
import pathlib
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import torquer

SCENES = pathlib.Path(__file__).parents[2] / "host/scenes"


@pytest.fixture(scope="module")
def phantom():
    return torquer.Scene(str(SCENES / "ty_phantom.toml"))


def push(simulation, steps, millimeters=1.0):
    hands = simulation.hands
    for _ in range(steps):
        hands[0, 0] += millimeters
        report = simulation.step(simulation.time_s + 0.1, hands)
    return report


def test_a_step_moves_the_wire(phantom):
    simulation = torquer.Simulation(phantom)
    before = simulation.tips_mm[0]
    start = simulation.places[0, 0]
    report = push(simulation, 5)
    assert report.converged and not report.budget_spent and report.ticks >= 1
    assert simulation.time_s == pytest.approx(0.5)
    assert simulation.places[0, 0] == pytest.approx(start + 5)
    assert np.allclose(simulation.hands, simulation.places)
    assert 0 < np.linalg.norm(simulation.tips_mm[0] - before) < 10
    assert simulation.residual < 1e-3 and simulation.max_penetration_mm < 0.1
    assert simulation.solver_error_mm() < 1e-2
    error_mm = simulation.discretization_error_mm()
    assert np.isnan(error_mm) or 0 <= error_mm < 1
    assert not simulation.outside_lumen


def test_instruments_with_room_have_curves_of_their_own():
    scene = torquer.Scene.from_text(
        """name = "room"
[vessel]
kind = "ty_phantom"
wall_stiffness_N_mm2 = 0.5
[entry]
centerline = "main"
at_mm = 1
[[instrument]]
max_length_mm = 200
radius_mm = 0.2
rigidity_N_mm2 = 0.02
inserted_at_start_mm = 110
[[instrument]]
name = "catheter"
max_length_mm = 150
inserted_at_start_mm = 90
inner_radius_mm = 0.6
radius_mm = 0.8
rigidity_N_mm2 = 0.05
[effects.clearance]
"""
    )
    simulation = torquer.Simulation(scene)
    wire, catheter = (simulation.instrument_nodes_mm(k) for k in range(2))
    assert np.allclose(wire, simulation.nodes_mm)
    for k, nodes in enumerate((wire, catheter)):
        assert np.allclose(nodes[-1], simulation.tips_mm[k])
        along = np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum()
        assert along == pytest.approx(simulation.places[k, 0])
    apart = np.linalg.norm(wire[: len(catheter) - 1] - catheter[:-1], axis=1)
    assert 0.1 < apart.max() < 0.5
    with pytest.raises(torquer.Error, match="no instrument 2"):
        simulation.instrument_nodes_mm(2)


def test_nodes_are_a_view_that_cannot_be_written(phantom):
    simulation = torquer.Simulation(phantom)
    push(simulation, 20)
    nodes = simulation.nodes_mm
    assert nodes.shape[1] == 3 and nodes.dtype == np.float64
    assert np.allclose(nodes[-1], simulation.tips_mm[0])
    lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    assert np.allclose(lengths[1:], lengths[1])
    assert not nodes.flags.writeable and not nodes.flags.owndata
    with pytest.raises(ValueError):
        nodes[0, 0] = 1
    # The copy stays unchanged whatever happens to the simulation.
    kept = nodes.copy()
    push(simulation, 1)
    simulation.restart()
    del simulation
    gc.collect()
    assert np.array_equal(nodes, kept)


def test_copies_and_restoring(phantom):
    simulation = torquer.Simulation(phantom)
    push(simulation, 10)
    saved = simulation.copy()
    shallow = copy.copy(simulation)
    here = simulation.state_hash
    push(simulation, 5)
    there = simulation.state_hash
    assert saved.state_hash == shallow.state_hash == here != there
    push(saved.copy(), 2, -1)
    assert saved.state_hash == here
    simulation.restore(saved)
    assert simulation.state_hash == here
    push(simulation, 5)
    assert simulation.state_hash == there
    simulation.restart()
    assert simulation.state_hash == torquer.Simulation(phantom).state_hash


def test_scenes_are_pickled_by_their_text(phantom):
    again = pickle.loads(pickle.dumps(phantom))
    assert again.content_hash == phantom.content_hash
    assert again.text == phantom.text
    assert torquer.Simulation(again).state_hash == torquer.Simulation(phantom).state_hash


def test_a_scene_from_text(phantom):
    other = phantom.text.replace('"ty_phantom"', '"renamed"', 1)
    scene = torquer.Scene.from_text(other, phantom.folder)
    assert scene.name == "renamed" and scene.content_hash != phantom.content_hash
    with pytest.raises(torquer.Error, match="scene:1"):
        torquer.Scene.from_text("nonsense")


def test_a_scene_describes_its_vessel(phantom):
    assert phantom.name == "ty_phantom"
    assert [i.name for i in phantom.instruments] == ["guidewire"]
    assert phantom.instruments[0].max_length_mm > 0
    low, high = phantom.bounds_mm
    assert (low < high).all()
    middle = phantom.centerline_mm(phantom.centerlines[0], 0.5)
    assert middle.shape[1] == 3
    assert (phantom.clearance_mm(middle[2:-2]) > 0).all()
    assert phantom.clearance_mm([low - 10]) < 0
    route = phantom.route_mm(phantom.centerlines[0], 10.0)
    assert np.allclose(np.linalg.norm(np.diff(route, axis=0)[:-1], axis=1), 1, atol=1e-3)


def test_pictures_and_forces():
    scene = torquer.Scene(str(SCENES / "everything.toml"))
    simulation = torquer.Simulation(scene)
    assert simulation.picture() is None
    simulation.step(0.1, simulation.hands, xray=True)
    picture = simulation.picture()
    assert picture.dtype == np.uint8 and picture.ndim == 2 and picture.std() > 5
    turned = simulation.copy()
    turned.step(0.2, simulation.hands, lao_deg=40, xray=True)
    assert not np.array_equal(turned.picture(), picture)
    assert np.array_equal(simulation.picture(), picture)
    readings = simulation.readings()
    assert readings["xray_pulses"] >= 1
    forces = simulation.forces()
    if "internal_forces" in scene.effects:
        assert forces["tension_mN"].shape == (len(simulation.nodes_mm),)
        assert forces["contact_mN"].shape == simulation.nodes_mm.shape
    else:
        assert False, "the scene has internal forces"


@pytest.fixture(scope="module")
def beating():
    return torquer.Scene(str(SCENES / "coronary.toml"))


def test_a_step_calls_back_for_each_tick(beating):
    simulation = torquer.Simulation(beating)
    pictures = []

    def look(tick):
        assert tick.ticks == 1
        if simulation.picture_due():
            pictures.append(simulation.picture())
            assert not simulation.picture_due()

    report = simulation.step(0.5, simulation.hands, xray=True, after_tick=look)
    assert report.finished and report.ticks == 100  # of 5 ms
    assert len(pictures) == simulation.readings()["xray_pulses"] > 1
    assert not np.array_equal(pictures[0], pictures[-1])


def test_a_step_is_ended_by_false_or_an_exception(beating):
    simulation = torquer.Simulation(beating)
    report = simulation.step(0.1, simulation.hands, after_tick=lambda tick: simulation.time_s < 0.012)
    assert not report.finished and report.ticks == 3
    assert simulation.time_s == pytest.approx(0.015)

    def fail(tick):
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        simulation.step(0.1, simulation.hands, after_tick=fail)
    assert simulation.time_s == pytest.approx(0.02)
    assert simulation.step(0.1, simulation.hands).ticks == 16


def test_settings_of_the_x_ray_system(beating):
    imaging = torquer.Imaging("plain", left=0.25, bottom=0.125, magnification=2)
    assert (imaging.mode, imaging.left, imaging.magnification) == ("plain", 0.25, 2)
    simulation = torquer.Simulation(beating)
    simulation.step(0.1, simulation.hands, xray=True, imaging=imaging)
    picture = simulation.picture()
    height, width = picture.shape
    assert (picture[:, : width // 4] == 0).all() and (picture[-(height // 8) :] == 0).all()
    assert np.median(picture[: height // 2, width // 2 :]) > 0
    with pytest.raises(torquer.Error, match="'fancy'; give as_scene, plain"):
        torquer.Imaging("fancy")
    with pytest.raises(torquer.Error, match="magnification 9"):
        simulation.step(0.2, simulation.hands, imaging=torquer.Imaging(magnification=9))


def test_record_and_contacts(beating):
    simulation = torquer.Simulation(beating)
    hands = simulation.hands
    for k in range(10):
        hands[0, 0] += 1
        simulation.step(0.1 * (k + 1), hands)
    record = json.loads(simulation.record())
    assert record["scene_file"] == beating.path == str(SCENES / "coronary.toml")
    # An unknown value is null in JSON, and not a number in Python.
    readings = {name: None if np.isnan(value) else value for name, value in simulation.readings().items()}
    assert record["readings"] == readings
    contacts = simulation.contacts()
    assert max(contacts.values()) == pytest.approx(simulation.max_penetration_mm)
    assert all(0 < node < len(simulation.nodes_mm) for node in contacts)
    assert simulation.dissipated_mJ >= 0
    assert beating.keep_field() == ""  # tubes


@pytest.mark.parametrize(
    "time_s, hands, said",
    [
        (-1.0, None, "give increasing times"),
        *((float(v), None, f"time_s is {v}, not a finite number; give seconds, at least 0") for v in ("nan", "inf")),
        (1.0, [[0, 0], [0, 0]], "2 entries"),
        (1.0, [0, 0], r"shape \(2\)"),
        (1.0, [[0, 0, 0]], r"shape \(1, 3\)"),
        (1.0, [[float("inf"), 0]], "guidewire"),
    ],
)
def test_unusable_values_are_refused(phantom, time_s, hands, said):
    simulation = torquer.Simulation(phantom)
    here = simulation.state_hash
    with pytest.raises(torquer.Error, match=said):
        simulation.step(time_s, simulation.hands if hands is None else hands)
    assert simulation.state_hash == here and simulation.time_s == 0


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
def test_nan_is_refused(phantom, bad):
    simulation = torquer.Simulation(phantom)
    here = simulation.state_hash
    hands = simulation.hands
    for name in ("lao_deg", "cra_deg"):
        with pytest.raises(torquer.Error, match="C-arm"):
            simulation.step(1, hands, **{name: bad})
    for name in ("pulses_per_s", "magnification", "left", "right", "top", "bottom"):
        with pytest.raises(torquer.Error, match=name):
            simulation.step(1, hands, imaging=torquer.Imaging(**{name: bad}))
    with pytest.raises(torquer.Error, match="point_mm"):
        phantom.clearance_mm([[0, 0, 0], [0, bad, 0]])
    for call in (lambda: phantom.centerline_mm("side", bad), lambda: phantom.route_mm("side", 40, bad),
                 lambda: phantom.route_mm("side", bad)):
        with pytest.raises(torquer.Error):
            call()
    assert simulation.state_hash == here


def test_absurd_numbers_of_points_are_refused(phantom):
    for step_mm in (1e-9, 5e-324, 0, -1):
        with pytest.raises(torquer.Error, match="step_mm is"):
            phantom.centerline_mm("side", step_mm)


def test_an_object_that_was_not_made_is_refused(phantom):
    simulation = torquer.Simulation(phantom)
    for kind in (torquer.Scene, torquer.Simulation, torquer.StepReport, torquer.Imaging, torquer.InstrumentInfo, torquer.Injector,
                 torquer.SurfaceCheck, torquer._torquer.Navigation, torquer._torquer.NavigationPool, torquer._torquer.NavigationTask):
        empty = kind.__new__(kind)
        tried = 0
        for name in dir(kind):
            if name.startswith("_"):
                continue
            if isinstance(getattr(kind, name), property):
                with pytest.raises(torquer.Error, match="was not made"):
                    getattr(empty, name)
            else:
                with pytest.raises((torquer.Error, TypeError)):
                    getattr(empty, name)()
            tried += 1
        assert tried > 0 or kind is torquer._torquer.NavigationTask
    with pytest.raises(torquer.Error, match="was not made"):
        torquer.Simulation(torquer.Scene.__new__(torquer.Scene))
    with pytest.raises(torquer.Error, match="was not made"):
        simulation.restore(torquer.Simulation.__new__(torquer.Simulation))
    with pytest.raises(torquer.Error, match="was not made"):
        torquer.Simulation.__new__(torquer.Simulation).restart()


def test_a_step_in_use_is_not_moved(phantom, beating):
    simulation = torquer.Simulation(phantom)
    saved = simulation.copy()
    nodes = simulation.nodes_mm
    refused = []
    others = []

    def after_tick(tick):
        for call in (simulation.restart, lambda: simulation.restore(saved), lambda: simulation.step(9, simulation.hands)):
            with pytest.raises(torquer.Error, match="a step of this object is running"):
                call()
            refused.append(call)

        def elsewhere():
            for call in (simulation.restart, simulation.copy, lambda: simulation.nodes_mm, lambda: simulation.hands):
                try:
                    call()
                except torquer.Error as error:
                    others.append(str(error))

        thread = threading.Thread(target=elsewhere)
        thread.start()
        thread.join()
        # Reading it is allowed.
        assert simulation.nodes_mm.shape[1] == 3 and simulation.copy().state_hash == simulation.state_hash

    report = simulation.step(0.05, simulation.hands, after_tick=after_tick)
    assert len(refused) == 3 * report.ticks and len(others) == 4 * report.ticks
    assert all("another thread uses this object" in text for text in others)
    other = torquer.Simulation(beating)
    scene = simulation.scene
    with pytest.raises(torquer.Error, match="give one of the same scene"):
        simulation.restore(other)
    simulation.restore(torquer.Simulation(torquer.Scene(str(SCENES / "ty_phantom.toml"))))
    gc.collect()
    assert np.isfinite(nodes).all() and scene.name == simulation.scene.name == "ty_phantom"


def test_random_calls_of_threads_are_carried_out_or_refused(phantom):
    simulation = torquer.Simulation(phantom)
    saved = simulation.copy()
    readers = [name for name in dir(simulation) if not name.startswith(("_", "step", "rest", "exchange", "places_in", "track_"))]
    unexpected = []

    def calls(seed):
        random = np.random.default_rng(seed)
        for _ in range(400):
            what = random.integers(7)
            try:
                if what == 0:
                    hands = simulation.hands + random.uniform(-1, 2, (1, 2))
                    simulation.step(simulation.time_s + 0.02, np.maximum(hands, 0))
                elif what == 1:
                    random.choice([simulation.restart, lambda: simulation.restore(saved)])()
                elif what == 2:
                    # The hand is withdrawn first; another thread may advance it meanwhile.
                    simulation.step(simulation.time_s + 0.02, [[0, 0]])
                    simulation.exchange("guidewire", random.choice(["sion", "samurai"]))
                else:
                    read = getattr(simulation, random.choice(readers))
                    if callable(read):
                        read(0) if read.__name__.startswith("instrument_") else read()
            except torquer.Error:
                pass
            except BaseException as error:
                unexpected.append(repr(error))

    threads = [threading.Thread(target=calls, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120)
    assert not unexpected
    # After a restart it behaves as a new one.
    simulation.restart()
    fresh = torquer.Simulation(phantom)
    push(simulation, 5)
    push(fresh, 5)
    assert simulation.state_hash == fresh.state_hash


LONG = {
    "a step": "torquer.Simulation(scene).step(1e5, [[1, 0]])",
    "a step of years": "torquer.Simulation('ty_phantom').step(1e9, [[1, 0]])",
    "a step of many": "many.step(numpy.ones((2, 2)))",
    "a step of an environment": "env.step([1, 1])",
}


@pytest.mark.parametrize("what", LONG)
def test_an_interrupt_ends_what_takes_long(what):
    text = f"""
import numpy, os, torquer, torquer.envs
scene = torquer.Scene(torquer.scene_path("coronary"))
task = torquer.envs.Task("lad", 60.0, step_s=600)
if "env" in {LONG[what]!r}:
    (env := torquer.envs.NavigationEnv(scene, task)).reset(seed=1)
if "many" in {LONG[what]!r}:
    many = torquer.envs.VectorEnv(scene, 2, 2, task=task)
    many.reset(seed=1)
try:
    print("begun", flush=True)
    {LONG[what]}
except KeyboardInterrupt:
    print("interrupted", flush=True)
    os._exit(0)  # ends without waiting for steps of other threads
"""
    child = subprocess.Popen([sys.executable, "-B", "-c", text], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout.readline() == "begun\n"
        time.sleep(0.3)
        child.send_signal(signal.SIGINT)
        assert child.communicate(timeout=60)[0] == "interrupted\n"
    finally:
        child.kill()


def test_threads_run_beside_each_other(phantom):
    # Stepping releases Python's lock, so another thread runs; both get the same results as alone.
    alone = torquer.Simulation(phantom)
    push(alone, 30)
    results = [None] * 3

    def run(k):
        simulation = torquer.Simulation(phantom)
        push(simulation, 30)
        results[k] = simulation.state_hash

    threads = [threading.Thread(target=run, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [alone.state_hash] * 3
