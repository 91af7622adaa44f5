"""Cases from scans: a synthetic angiography of known truth with bone, its label map, and refused files."""

import json
import pathlib
import re
import signal
import subprocess
import sys

import nibabel
import numpy as np
import pydicom
import pytest
import torquer
from pydicom.dataset import FileDataset, FileMetaDataset
from scipy import ndimage
from torquer.importer import body, centerlines, lumen, scan, surface, views

VOXEL_MM = 0.8
LOW = np.array([-40.0, -40.0, 0.0])
# Start and end, mm, and the radii there. The trunk leaves the scan, the others end within it.
TUBES = [
    ((0, 0, -20), (0, 0, 55), 7.5, 7.0), ((0, 0, 55), (-20, 0, 92), 4.5, 3.5),
    ((0, 0, 55), (20, 8, 92), 4.0, 3.0), ((0, 0, 28), (34, -5, 38), 2.5, 2.0),
]
SPINE = ((0, -19, -20), (0, -19, 130), 9.5, 9.5)


def depth(points, tube):
    """Depth in a cone between two balls, mm."""
    a, b = (np.array(end, float) for end in tube[:2])
    share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return tube[2] + (tube[3] - tube[2]) * share - np.linalg.norm(points - a - share[..., None] * (b - a), axis=-1)


def vessel_depth(points):
    return np.max([depth(points, tube) for tube in TUBES], axis=0)


@pytest.fixture(scope="module")
def angiography():
    """Values in HU of the shape (slices, rows, columns), and their affine to LPS."""
    k, j, i = np.meshgrid(*(np.arange(n) for n in (125, 100, 100)), indexing="ij")
    points = np.stack([i, j, k], -1) * VOXEL_MM + LOW
    vessel, bone = vessel_depth(points), depth(points, SPINE)
    part = lambda d: np.clip(0.5 + d / VOXEL_MM, 0, 1)
    values = 50 + 300 * part(vessel) + 850 * part(bone) - 650 * part(bone - 1.5)
    values = ndimage.gaussian_filter(values, 0.6 / VOXEL_MM) + np.random.default_rng(1).normal(0, 25, values.shape)
    affine = np.diag([VOXEL_MM] * 3 + [1])
    affine[:3, 3] = LOW
    return values.astype(np.int16), affine


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-B", "-m", "torquer.importer", *map(str, arguments)], capture_output=True, text=True, timeout=300
    )


@pytest.fixture(scope="module")
def imported(angiography, tmp_path_factory):
    folder = tmp_path_factory.mktemp("import")
    scan.write_nifti(folder / "scan.nii.gz", *angiography)
    done = run(folder / "scan.nii.gz", "--seed=0,0,30", "--out", folder / "patient")
    assert done.returncode == 0, done.stderr
    return folder


def curves_of(folder):
    out = []
    for path in sorted((folder / "centerlines").glob("*.mrk.json")):
        (markup,) = json.loads(path.read_text())["markups"]
        points = np.array([point["position"] for point in markup["controlPoints"]])
        out.append((points, np.array(markup["measurements"][0]["controlPointValues"])))
    return out


def surface_of(folder):
    """Triangles of the case, as the file has them: normals and corners."""
    data = (folder / "surface.stl").read_bytes()
    assert b"SPACE=LPS" in data[:80]
    rows = np.frombuffer(data[84:], np.dtype([("n", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")]))
    return rows["n"].astype(float), rows["corners"].astype(float)


def volume_mm3(corners):
    return np.einsum("ij,ij", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6


def test_surface_is_the_true_one(imported):
    normals, corners = surface_of(imported / "patient")
    centers = corners.mean(axis=1)
    # Without the flat end at the border of the scan.
    errors = np.abs(vessel_depth(centers[centers[:, 2] > 1]))
    assert np.percentile(errors, 50) < 0.13 and np.percentile(errors, 95) < 0.6 and errors.max() < 1.5
    # Normals of the file point outward, where the depth falls.
    out = vessel_depth(centers + 0.3 * normals) < vessel_depth(centers - 0.3 * normals)
    assert out[centers[:, 2] > 1].mean() > 0.99


def test_centerlines_are_the_true_tree(imported):
    curves = curves_of(imported / "patient")
    assert len(curves) == 3
    points, _ = curves[0]
    assert points[0][2] < 10 and np.linalg.norm(points[0][:2]) < 2, "the widest end is the root"
    starts = sorted(points[0][2] for points, _ in curves[1:])
    assert abs(starts[0] - 28) < 5 and abs(starts[1] - 55) < 8
    tips = [np.array(tube[1], float) for tube in TUBES[1:]]
    for points, radii in curves:
        assert min(np.linalg.norm(points[-1] - tip) for tip in tips) < 4
        # The middle of the last part lies on the axis of a tube, with its radius.
        at = 2 * len(points) // 3
        assert abs(vessel_depth(points[at]) - radii[at]) < 0.5


def test_scene_runs_and_the_wire_bends_to_the_front(imported):
    scene = torquer.Scene(str(imported / "patient/patient.toml"))
    assert scene.centerlines == ["c00", "c01", "c02"] and {"flow", "fluoroscopy", "contrast"} <= set(scene.effects)
    simulation = torquer.Simulation(scene)
    hands = simulation.hands
    for k in range(1, 9):
        hands[0, 0] = k
        report = simulation.step(0.1 * k, hands)
    assert report.converged and not simulation.outside_lumen
    nodes = simulation.nodes_mm
    begin, end = nodes[1] - nodes[0], nodes[-1] - nodes[-2]
    assert (end - begin)[1] < 0, "front is -y in LPS"


def test_pictures_show_the_scan_without_its_contrast_agent(imported, angiography):
    values, affine = angiography
    read = scan.read(imported / "patient/scan.mha")
    assert (read.values == values).all() and np.allclose(read.affine, affine)
    text = (imported / "patient/patient.toml").read_text()
    blur = float(re.search(r"^ct_blur_mm = ([0-9.]+)$", text, re.M)[1])
    assert abs(blur - 0.6) < 0.08
    # From the left: the trunk of the vessel, tissue in front of it, and the spine behind it.
    text = re.sub(r"isocenter_mm = .*", "isocenter_mm = [0, 9, 40]\ndetector_mm = 100\nphotons = 1e7\ngain = 2", text)
    (imported / "patient/side.toml").write_text(text)
    simulation = torquer.Simulation(str(imported / "patient/side.toml"))
    simulation.step(3.2, simulation.hands, xray=True, lao_deg=90)
    picture = simulation.picture().astype(float)
    grays = []
    for place in ([0, 0, 40], [0, 18, 40], [0, -19, 40]):
        column, row = np.rint(simulation.places_in_picture(np.array([place], float))[0, :2]).astype(int)
        grays.append(picture[row - 4 : row + 5, column - 4 : column + 5].mean())
    vessel, tissue, spine = grays
    # 15 mm of lumen with 300 HU would be darker by 0.11 in the line integral: 35 steps of gray.
    assert abs(vessel - tissue) < 5 and spine < tissue - 20


def test_angles_of_the_c_arm_show_branches(imported):
    trunk = centerlines.Curve("c00", np.array([[0, 0, z] for z in range(100)], float), np.full(100, 5.0), None)
    branches = [
        centerlines.Curve(f"c0{n}", np.array([[s * np.sin(turn), -s * np.cos(turn), 50 + s] for s in range(40)]), np.full(40, 2.0), 0)
        for n, turn in enumerate((np.pi / 2, np.pi / 4, -np.pi / 4), 1)
    ]
    # Views across the planes of branches to the left, the left front and the right front.
    found = views.find([trunk, *branches])
    assert [(view.lao_deg, view.cra_deg) for view in found] == [(0, 0), (-45, 0), (45, 0)]
    assert all(abs(view.seen - 1) < 1e-6 and abs(view.apart_deg - 45) < 1e-3 for view in found)
    text = (imported / "patient/patient.toml").read_text()
    assert re.search(r"^#   c01: (LAO|RAO) \d+, (CRA|CAU) \d+; \d+ % of its length, \d+ degrees from its parent$", text, re.M)


def blur_of(folder):
    return float(re.search(r"^ct_blur_mm = ([0-9.]+)$", next(folder.glob("*.toml")).read_text(), re.M)[1])


def test_label_map_gives_the_same_vessel(imported):
    done = run(
        imported / "patient/lumen.nii.gz", "--label", lumen.LUMEN, "--body", imported / "scan.nii.gz", "--out", imported / "again"
    )
    assert done.returncode == 0, done.stderr
    assert len(curves_of(imported / "again")) == 3
    # The map has no gray values, so its wall is less exact. Its volume is that of the surface from the scan.
    volumes = [volume_mm3(surface_of(imported / name)[1]) for name in ("patient", "again")]
    assert abs(volumes[1] / volumes[0] - 1) < 0.02
    # The scan beside it is the body, as for the case from the scan.
    assert (imported / "again/scan.mha").read_bytes() == (imported / "patient/scan.mha").read_bytes()
    assert abs(blur_of(imported / "again") - 0.6) < 0.12
    assert "body = \"ct\"" in (imported / "again/again.toml").read_text()
    done = run(imported / "patient/lumen.nii.gz", "--label", 7, "--out", imported / "other")
    assert done.returncode == 2 and re.search(r"labels in \S+lumen.nii.gz: 1, 2$", done.stderr, re.M)


def test_images_have_the_same_voxels(angiography, tmp_path):
    values, affine = angiography
    turned = np.eye(4)
    turned[:3, :3] = np.array([[0, -0.8, 0], [0.8, 0, 0], [0, 0, 0.9]])
    turned[:3, 3] = (5, -7, 11)
    part = np.ascontiguousarray(values[:7, :9, :11])
    scan.write_nifti(tmp_path / "a.nii.gz", part, turned)
    sizes = "11 9 7"
    directions = " ".join("(" + ",".join(map(str, turned[:3, n] * [-1, -1, 1])) + ")" for n in range(3))
    (tmp_path / "a.nrrd").write_bytes(
        f"NRRD0004\ntype: short\ndimension: 3\nspace: right-anterior-superior\nsizes: {sizes}\nspace directions: {directions}\n"
        f"endian: little\nencoding: raw\nspace origin: (-5,7,11)\n\n".encode() + part.astype("<i2").tobytes()
    )
    matrix = " ".join(str(x) for x in (turned[:3, :3] / [0.8, 0.8, 0.9]).T.ravel())
    (tmp_path / "a.mha").write_bytes(
        f"ObjectType = Image\nNDims = 3\nTransformMatrix = {matrix}\nOffset = 5 -7 11\nElementSpacing = 0.8 0.8 0.9\n"
        f"DimSize = {sizes}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n".encode() + part.astype("<i2").tobytes()
    )
    for name in ("a.nii.gz", "a.nrrd", "a.mha"):
        read = scan.read(tmp_path / name)
        assert (read.values == part).all() and np.allclose(read.affine, turned, atol=1e-5), name
    (tmp_path / "cut.mha").write_bytes((tmp_path / "a.mha").read_bytes()[:-9])
    with pytest.raises(torquer.Error, match="cut short"):
        scan.read(tmp_path / "cut.mha")


def write_series(folder, values, number=1, tilt_mm=0.0, **other):
    folder.mkdir(exist_ok=True)
    for k, plane in enumerate(values):
        meta = FileMetaDataset()
        meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
        meta.MediaStorageSOPClassUID = "1.2.840.10008.5.1.4.1.1.2"
        meta.MediaStorageSOPInstanceUID = f"1.2.3.{number}.{k + 1}"
        path = folder / f"{number}_{len(values) - k:03}.dcm"  # names in another order than places
        data = FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128)
        data.is_little_endian, data.is_implicit_VR = True, False
        fields = dict(
            SOPClassUID=meta.MediaStorageSOPClassUID, SOPInstanceUID=meta.MediaStorageSOPInstanceUID, Modality="CT",
            SeriesInstanceUID=f"1.2.3.{number}", SeriesNumber=number, Rows=plane.shape[0], Columns=plane.shape[1],
            ImageOrientationPatient=[1, 0, 0, 0, 1, 0], ImagePositionPatient=[-40, -40 + k * tilt_mm, 0.8 * k],
            PixelSpacing=[0.8, 0.8], SamplesPerPixel=1, PhotometricInterpretation="MONOCHROME2", BitsAllocated=16, BitsStored=16,
            HighBit=15, PixelRepresentation=0, RescaleSlope=2, RescaleIntercept=-1024,
        )
        for name, value in {**fields, **other}.items():
            setattr(data, name, value)
        data.PixelData = ((plane.astype(int) + 1024) // 2).astype("<u2").tobytes()
        data.save_as(path)


def test_dicom_series(angiography, tmp_path):
    values = np.ascontiguousarray(angiography[0][:6, :20, :30])
    write_series(tmp_path / "one", values, tilt_mm=0.2)
    read = scan.read(tmp_path / "one")
    assert np.abs(read.values - values.astype(int)).max() <= 1
    assert np.allclose(read.points_mm((1, 2, 5)), (-40 + 0.8, -40 + 1.6 + 1.0, 4.0))
    assert any("Gantry tilt of 14.0 degrees" in fact for fact in read.facts)
    write_series(tmp_path / "one", values, number=2, SeriesDescription="venous")
    with pytest.raises(torquer.Error, match=r"2 series; choose one:(?s:.)*--series 2: venous \(CT, 6 files\)"):
        scan.read(tmp_path / "one")
    assert scan.read(tmp_path / "one", 2).values.shape == (6, 20, 30)


def test_refused_series(angiography, tmp_path):
    values = np.ascontiguousarray(angiography[0][:6, :20, :30])

    def refusal(name, change=lambda folder: None, **other):
        write_series(tmp_path / name, values, **other)
        change(tmp_path / name)
        with pytest.raises(torquer.Error) as caught:
            scan.read(tmp_path / name)
        return str(caught.value)

    assert "a slice is missing" in refusal("missing", lambda folder: (folder / "1_003.dcm").unlink())
    assert "modality MR" in refusal("mr", Modality="MR")
    assert "RGB" in refusal("rgb", SamplesPerPixel=3)

    def interleave(folder):
        write_series(folder, values, number=2, SeriesInstanceUID="1.2.3.1")

    assert "interleaved" in refusal("twice", interleave)


def changed(folder, k, **fields):
    """Changes fields of the slice at a number from below; None removes one."""
    path = sorted(folder.iterdir(), key=lambda path: float(pydicom.dcmread(path).ImagePositionPatient[2]))[k]
    data = pydicom.dcmread(path)
    for name, value in fields.items():
        if value is None:
            delattr(data, name)
        else:
            setattr(data, name, value)
    data.save_as(path)


def test_stacks_under_one_uid_are_refused(angiography, tmp_path):
    values = np.ascontiguousarray(angiography[0][:6, :20, :30])

    def two_stacks(offset_mm, numbers):
        """Stacks of 0.8 mm beside each other; numbers: InstanceNumber of the slices from below."""
        folder = tmp_path / f"{offset_mm}_{len(list(tmp_path.iterdir()))}"
        for n in (1, 2):
            write_series(folder, values, number=n, SeriesInstanceUID="1.2.3.1")
        for n in (1, 2):
            for k in range(6):
                path = folder / f"{n}_{6 - k:03}.dcm"
                data = pydicom.dcmread(path)
                data.ImagePositionPatient = [-40, -40, 0.8 * k + (n - 1) * offset_mm]
                if numbers:
                    data.InstanceNumber = numbers(n, k)
                data.save_as(path)
        return folder

    # Uneven steps; every second place free; steps of half the size, with the numbers of two stacks.
    for folder in (
        two_stacks(0.3, None), two_stacks(0.8 / 3, None), two_stacks(0.4, lambda n, k: k + 1), two_stacks(0.4, lambda n, k: 6 * n + k)
    ):
        with pytest.raises(torquer.Error, match="interleaved, such as two phases"):
            scan.read(folder)
    # One stack that counts on along its places, down or in steps of 2.
    for numbers in (None, lambda n, k: 2 * k + n, lambda n, k: 40 - 2 * k - n, lambda n, k: 4 * k + 2 * n, lambda n, k: 7):
        assert scan.read(two_stacks(0.4, numbers)).values.shape[0] == 12


def test_a_slice_unlike_the_others_is_refused(angiography, tmp_path):
    values = np.ascontiguousarray(angiography[0][:6, :20, :30])
    for k, (fields, said) in enumerate([
        ({"PixelSpacing": [0.5, 0.8]}, r"1_004.dcm: has pixels of 0.5 x 0.8 mm \(PixelSpacing\), and 1_006.dcm has 0.8 x 0.8 mm"),
        ({"ImagePositionPatient": [-40, -39, 1.6]}, r"1_004.dcm: its ImagePositionPatient lies 1.00 mm beside the line"),
        ({"RescaleIntercept": None}, r"1_004.dcm: RescaleIntercept is missing, so its values are no Hounsfield units"),
        ({"RescaleSlope": None}, r"1_004.dcm: RescaleSlope is missing"),
    ]):
        write_series(tmp_path / str(k), values)
        changed(tmp_path / str(k), 2, **fields)
        with pytest.raises(torquer.Error, match=said):
            scan.read(tmp_path / str(k))


def test_refused_seeds(angiography, imported):
    for seed, said in [("0,0,300", "outside the scan"), ("30,30,30", "no contrast agent"), ("0,-11,30", "bone"), ("1,2", "give left")]:
        done = run(imported / "scan.nii.gz", f"--seed={seed}", "--out", imported / "refused")
        assert done.returncode == 2 and said in done.stderr, (seed, done.stderr)
    done = run(imported / "scan.nii.gz", "--seed=0,0,30", "--out", imported / "patient")
    assert done.returncode == 2 and "exists already" in done.stderr
    assert sorted(path.name for path in imported.iterdir()) == ["again", "patient", "scan.nii.gz"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_import_leaves_no_files(imported, tmp_path, number):
    words = [imported / "scan.nii.gz", "--seed=0,0,30", "--out", tmp_path / "patient"]
    process = subprocess.Popen([sys.executable, "-B", "-m", "torquer.importer", *words], stderr=subprocess.PIPE, text=True)
    # The first step is announced when the folder exists and the scan is not read yet.
    assert "Reading the scan" in process.stderr.readline()
    assert list(tmp_path.iterdir())
    process.send_signal(number)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130 and "torquer-import: stopped" in error
    assert not list(tmp_path.iterdir())


def test_metal_and_a_cut_vessel_are_refused(angiography):
    values, affine = angiography
    seeds = np.array([[0.0, 0.0, 30.0]])

    def segment(array):
        one = scan.Scan(array, affine, [], "scan")
        return lumen.segment(one, lumen.smoothed(one), lumen.levels_of(one, seeds), seeds)

    metal = values.copy()
    metal[60:64, 60:63, 50:53] = 3000
    with pytest.raises(torquer.Error, match="metal"):
        segment(metal)
    affine = affine.copy()
    affine[0, 3] += 50 * VOXEL_MM - 1
    seeds = np.array([[2.0, 0.0, 30.0]])
    with pytest.raises(torquer.Error, match="cut off lengthwise"):
        segment(np.ascontiguousarray(values[:, :, 49:]))


def test_smoothing_keeps_the_volume_of_a_ball():
    k, j, i = np.meshgrid(*(np.arange(-10, 11),) * 3, indexing="ij")
    ball = np.clip(0.5 + (6 - np.sqrt(i * i + j * j + k * k)) / 2, 0, 1).astype(np.float32)
    mesh = surface.isosurface(ball, 0.5, np.diag([-1.0, 1, 1, 1]))
    # Facets as long as a voxel lie up to h^2 / 8 r within the ball. By interpolation, so do their corners.
    most = 2 * 3 / (8 * 6**2)
    assert -most < mesh.volume_mm3() / (4 / 3 * np.pi * 6**3) - 1 < 0
    smooth = surface.smooth(mesh)
    assert abs(smooth.volume_mm3() / mesh.volume_mm3() - 1) < 0.001
    fewer = surface.decimate(smooth, 800)
    assert len(fewer.triangles) < 850 and abs(fewer.volume_mm3() / smooth.volume_mm3() - 1) < 0.005


def test_body_of_a_vessel_from_elsewhere(tmp_path):
    k, j, i = np.meshgrid(*(np.arange(-14, 15),) * 3, indexing="ij")
    depths = 8 - np.sqrt(i * i + j * j + k * k)
    ball = np.clip(0.5 + depths / 2, 0, 1).astype(np.float32)
    mesh = surface.isosurface(ball, 0.5, np.eye(4))
    noise = np.random.default_rng(2).normal(0, 20, ball.shape)

    def found(lumen_hu, blur=0.8, shift_mm=0, tissue_hu=45):
        inside = ndimage.gaussian_filter(np.clip(0.5 + depths, 0, 1), blur)
        affine = np.eye(4)
        affine[0, 3] = shift_mm
        values = (tissue_hu + (lumen_hu - tissue_hu) * inside + noise).astype(np.int16)
        read = scan.Scan(values, affine, [], "ct.nii.gz")
        levels = body.levels_at(read, mesh)
        return levels, body.write(tmp_path, read, mesh, levels)

    for blur in (0.5, 0.8, 1.2):
        levels, written = found(345, blur)
        assert abs(levels.tissue - 45) < 10 and abs(levels.lumen - 345) < 10
        given = float(re.search(r"^ct_blur_mm = (.*)$", written.text, re.M)[1])
        # A voxel of the scan is a mean over its box, which blur_mm takes off.
        assert abs(given - blur) < 0.1
    # Without contrast agent no blur can be measured, so the scene keeps the default.
    levels, written = found(50)
    assert "body = \"ct\"" in written.text and "ct_blur_mm" not in written.text
    assert any("it has no contrast agent there" in fact for fact in written.facts)
    # Values of a magnetic resonance picture.
    levels, written = found(900, tissue_hu=600)
    assert written.text == "" and "no Hounsfield units" in written.facts[0]
    # The scan ends 12.5 mm from one side of the ball of 16 mm: 78 % of its area. Then it has no part of it.
    _, written = found(345, shift_mm=-10)
    assert any(re.fullmatch(r"The scan has 7\d % of the vessel.", fact) for fact in written.facts)
    with pytest.raises(torquer.Error, match=r"ct.nii.gz: has 0 % of the vessel, which reaches from \(6.0, 6.0, 6.0\) to"):
        found(345, shift_mm=60)


def test_options_of_the_body_are_refused(angiography, tmp_path):
    scan.write_nifti(tmp_path / "scan.nii.gz", *angiography)
    done = run(tmp_path / "scan.nii.gz", "--seed=0,0,30", "--body", tmp_path / "scan.nii.gz", "--out", tmp_path / "out")
    assert done.returncode == 2 and "--body: is for a label map or a surface" in done.stderr
    assert not (tmp_path / "out").exists()
