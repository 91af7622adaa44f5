"""Studies that torquer-batch refuses, and studies of very many scenes."""

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
        (f'scenes = ["ty_phantom"]\n{MOTION.replace("duration_s = 1", "duration_s = 1e4")}', "study.toml: motion push:"),
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
