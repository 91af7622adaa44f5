"""Studies and scripts that torquer-batch refuses, and studies of very many scenes."""

import pytest
import torquer
import torquer.batch
from batch_runs import MOTION, study


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("scenes = [", "study.toml: "),
        (MOTION, "scenes is None; give a list"),
        (f'scenes = ["ty_fantom"]\n{MOTION}', "nor a shipped scene 'ty_fantom'; shipped scenes: "),
        (f'scenes = ["ty_phantom"]\nseds = [1]\n{MOTION}', "no key seds; did you mean seeds?"),
        (f'scenes = ["{"a" * 300}"]\n{MOTION}', "File name too long; name scenes or their files"),
        ('scenes = ["ty_phantom"]\n', "there is no motion; add one"),
        (f'scenes = ["ty_phantom"]\nseeds = [1, 1]\n{MOTION}', "seeds has a number twice"),
        (f'scenes = ["ty_phantom"]\nseeds = [-1]\n{MOTION}', "seeds has -1; give whole numbers from 0"),
        (f'scenes = ["ty_phantom"]\nshapes = "all"\n{MOTION}', "shapes is 'all'; give one of last, rows, none"),
        (f'scenes = ["ty_phantom"]\n{MOTION}{MOTION}', "two motions have the same name"),
        (f'scenes = ["ty_phantom"]\n{MOTION.replace("guidewire", "catheter")}', "no such instrument; it has: guidewire"),
        (f'scenes = ["ty_phantom"]\n{MOTION.replace("duration_s = 1", "duration_s = 0")}', "duration_s is 0; give a number"),
        (f'scenes = ["ty_phantom"]\n{MOTION.replace("spread", "spred")}', "no key spred; did you mean spread?"),
        (f'scenes = ["ty_phantom"]\n[axes]\neffects.friction.coefficient = [1]\n{MOTION}', "put the whole key into quotes"),
        (f'scenes = ["ty_phantom"]\n[axes]\n"instrument.wire.tip_mm" = [1]\n{MOTION}', 'names no instrument; there are: guidewire'),
        (f'scenes = ["ty_phantom"]\n[axes]\n"effects.friction.coefficient" = [0.1, -1]\n{MOTION}', "coefficient = -1: is out of range; give"),
        (f'scenes = ["ty_phantom"]\n[axes]\n"instrument.guidewire.tip_mm" = [10, 0]\n{MOTION}', "ty_phantom.toml:22: instrument[0].tip_angle_deg = 30: needs tip_mm"),
        (f'scenes = ["ty_phantom"]\n[axes]\n"effects.friction.coefficient" = [{{ a = 1 }}]\n{MOTION}', "effects.friction.coefficient is {'a': 1}; give True"),
        (f'scenes = ["ty_phantom"]\nplots = "some"\n{MOTION}', "plots is 'some'; give one of valid, all"),
        (f'scenes = ["ty_phantom"]\n[axes]\n"a" = [1, 1]\n{MOTION}', "axes.a has a value twice"),
        (f'scenes = ["ty_phantom"]\n[random]\n"a" = [2, 1]\n{MOTION}', "random.a is [2, 1]; give the lowest and the highest"),
        ('scenes = ["ty_phantom"]\n[[motion]]\nname = "m"\nscript = "none.csv"\n', "none.csv: cannot be read (No such file"),
        ('scenes = ["ty_phantom"]\nseeds = [1, 2]\n[[motion]]\nname = "m"\nscript = "none.csv"\n', "the study draws no random value"),
    ],
)
def test_a_study_that_makes_no_sense_is_refused(study, tmp_path, text, said):
    with pytest.raises(torquer.Error) as refused:
        torquer.batch.run(str(study(text)), str(tmp_path / "out"))
    assert said in str(refused.value)
    assert str(tmp_path) in str(refused.value)


def test_a_study_of_very_many_scenes_is_read_at_once(study, monkeypatch):
    listed = []
    names = torquer.scene_names()
    for module in (torquer, torquer._batch_study):
        monkeypatch.setattr(module, "scene_names", lambda: listed.append(1) or names)
    read = torquer._batch_study.read_study(str(study(f'scenes = {["ty_phantom"] * 1000}\n{MOTION}')))
    assert read.scenes == [torquer.scene_path("ty_phantom")] * 1000
    # Names are listed as often as Torquer has scenes, not as often as the study names one.
    assert len(listed) < 100


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("", "the file is empty"),
        ("time_s,guidewire.speed\n1,2\n", ":1: column 'guidewire.speed' is unknown or given twice"),
        ("guidewire.insertion_mm\n1\n", ":1: there is no column time_s"),
        ("time_s;lao_deg\n1;2\n", ":1: semicolons separate the columns"), ("time_s\tlao_deg\n1\t2\n", ":1: tabs separate"),
        ("time_s\r1\r", ":1: carriage returns alone end the lines"), ("sep=,\r\ntime_s\r\n1\r\n,\r\nx\r\n", ":5: 'x' are not"),
        ('"","time_s"\n"1",2\n', ":1: column 1 has no name; name it or remove it (in R: row.names = FALSE)"), ("time_s\n1\n1\n", ":3: time_s is 1, not later than the previous row"),
        ("# rows\ntime_s\n1,2\n", ":3: the row has 2 values, but the header names 1"),
        ("time_s\nx\n", ":2: 'x' are not all numbers"),
        ("time_s\ninf\n", ":2: 'inf' are not all finite"),
    ],
)
def test_a_script_that_makes_no_sense_is_refused(study, tmp_path, rows, said):
    (tmp_path / "moves.csv").write_bytes(rows.encode())
    path = study('scenes = ["ty_phantom"]\n[[motion]]\nname = "m"\nscript = "moves.csv"\n')
    with pytest.raises(torquer.Error) as refused:
        torquer.batch.run(str(path), str(tmp_path / "out"))
    assert f"moves.csv{said}" in str(refused.value) or said in str(refused.value)
