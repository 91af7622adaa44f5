"""Centerlines of VMTK in every encoding of VTK's XML, and refused files."""

import base64
import json
import pathlib
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest
import torquer
import torquer.centerlines

POINTS = [0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 10.0, 3.0, 0.0, 12.5]
RADII = [2.0, 1.5, 1.25, 1.0]
LINES = [0, 1, 2, 1, 3]
ENDS = [3, 5]


def pack(values, kind, encoding, block=16):
    raw = struct.pack(f"<{len(values)}{kind}", *values)
    if encoding.startswith("zlib"):
        parts = [raw[k : k + block] for k in range(0, len(raw), block)]
        packed = [zlib.compress(part) for part in parts]
        header = struct.pack(
            f"<{3 + len(parts)}I", len(parts), block, len(raw) % block, *map(len, packed)
        )
        body = b"".join(packed)
        if encoding.endswith("raw"):
            return header + body
        return base64.b64encode(header) + base64.b64encode(body)
    data = struct.pack("<I", len(raw)) + raw
    return data if encoding == "raw" else base64.b64encode(data)


def vtp(encoding="ascii", points=POINTS, radii=RADII, lines=LINES, ends=ENDS):
    """encoding: ascii, inline, base64, raw, zlib-inline, zlib-base64 or zlib-raw."""
    appended = b""

    def array(name, kind, values, columns=1):
        nonlocal appended
        head = (
            f'<DataArray type="{ {"d": "Float64", "f": "Float32", "q": "Int64"}[kind] }" '
            f'Name="{name}" NumberOfComponents="{columns}" format='
        ).encode()
        if encoding == "ascii":
            return head + b'"ascii">' + " ".join(map(str, values)).encode() + b"</DataArray>"
        data = pack(values, kind, encoding)
        if encoding.endswith("inline"):
            return head + b'"binary">\n' + data + b"\n</DataArray>"
        appended += data
        return head + f'"appended" offset="{len(appended) - len(data)}"/>'.encode()

    compressor = ' compressor="vtkZLibDataCompressor"' if encoding.startswith("zlib") else ""
    text = (
        f'<?xml version="1.0"?><VTKFile type="PolyData" version="0.1" '
        f'byte_order="LittleEndian" header_type="UInt32"{compressor}><PolyData>'
        f'<Piece NumberOfPoints="{len(radii)}" NumberOfLines="{len(ends)}"><PointData>'
    ).encode()
    text += array("MaximumInscribedSphereRadius", "d", radii)
    text += b"</PointData><Points>" + array("Points", "f", points, 3)
    text += b"</Points><Lines>" + array("connectivity", "q", lines) + array("offsets", "q", ends)
    text += b"</Lines></Piece></PolyData>"
    if appended:
        kind = "raw" if encoding.endswith("raw") else "base64"
        text += f'<AppendedData encoding="{kind}">\n_'.encode() + appended + b"\n</AppendedData>"
    return text + b"</VTKFile>"


def convert(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "torquer", "convert", *map(str, arguments)], capture_output=True, text=True
    )


@pytest.mark.parametrize(
    "encoding", ["ascii", "inline", "base64", "raw", "zlib-inline", "zlib-base64", "zlib-raw"]
)
def test_every_encoding(tmp_path, encoding):
    (tmp_path / "lines.vtp").write_bytes(vtp(encoding))
    first, second = torquer.centerlines.read_vtp(tmp_path / "lines.vtp")
    assert first.points.ravel().tolist() == POINTS[:9] and first.radii.tolist() == RADII[:3]
    assert second.points.ravel().tolist() == POINTS[3:6] + POINTS[9:]
    assert second.radii.tolist() == [1.5, 1.0]


def test_curves_for_a_scene(tmp_path):
    (tmp_path / "lines.vtp").write_bytes(vtp())
    done = convert(tmp_path / "lines.vtp", tmp_path / "curves")
    assert done.returncode == 0 and "2 centerlines, 5 points" in done.stdout
    (markup,) = json.loads((tmp_path / "curves/line_1.mrk.json").read_text())["markups"]
    assert [point["position"] for point in markup["controlPoints"]] == [POINTS[k : k + 3] for k in (0, 3, 6)]
    assert markup["measurements"][0]["controlPointValues"] == RADII[:3]
    done = convert(tmp_path / "lines.vtp", tmp_path / "curves")
    assert done.returncode == 2 and "exists already" in done.stderr


def test_a_scene_reads_them(tmp_path):
    scenes = pathlib.Path(__file__).parents[2] / "host/scenes"
    scene = torquer.Scene(str(scenes / "neuro_arch.toml"))
    lines = [scene.centerline_mm(name, 1.0) for name in scene.centerlines]
    points = [x for rows in lines for x in rows.ravel().tolist()]
    ends, count = [], 0
    for rows in lines:
        count += len(rows)
        ends.append(count)
    (tmp_path / "lines.vtp").write_bytes(vtp("zlib-raw", points, [3.0] * count, list(range(count)), ends))
    assert convert(tmp_path / "lines.vtp", tmp_path / "curves").returncode == 0
    read = []
    for text in scene.text.splitlines():
        start = text.startswith("centerlines =")
        read.append(f'centerlines = "{tmp_path / "curves"}"' if start else text)
    text = "\n".join(read)
    for k, name in enumerate(scene.centerlines, 1):
        text = text.replace(f'"{name}"', f'"line_{k}"')
    again = torquer.Scene.from_text(text, scene.folder)
    assert sorted(again.centerlines) == sorted(f"line_{k + 1}" for k in range(len(lines)))


def curves_in(folder):
    read = {}
    for path in sorted(folder.iterdir()):
        (markup,) = json.loads(path.read_text())["markups"]
        read[path.name.removesuffix(".mrk.json")] = [point["position"] for point in markup["controlPoints"]]
    return read


def test_lines_of_two_points_are_joined(tmp_path):
    # A trunk of 1200 steps that branches in two, as SimVascular writes it, with steps in any order.
    trunk, branch, other = list(range(1201)), [1200, *range(1201, 1301)], [1200, *range(1301, 1401)]
    points = [[0, 0, 0.1 * k] for k in trunk]
    points += [[0.1 * k, 0, 120 + 0.1 * k] for k in range(1, 101)]
    points += [[-0.1 * k, 0, 120 + 0.1 * k] for k in range(1, 101)]
    steps = [pair for line in (trunk, branch, other) for pair in zip(line, line[1:])]
    steps = steps[::2] + steps[1::2]
    flat = [x for point in points for x in point]
    nodes = [x for step in steps for x in step]
    (tmp_path / "a.vtp").write_bytes(vtp("raw", flat, [2.0] * len(points), nodes, list(range(2, len(nodes) + 1, 2))))
    lines = torquer.centerlines.read_vtp(tmp_path / "a.vtp")
    found = sorted([round(float(line.points[k, 2]), 3) for k in (0, -1)] + [len(line.points)] for line in lines)
    assert found == [[0.0, 120.0, 1201], [120.0, 130.0, 101], [120.0, 130.0, 101]]
    for line in lines:
        assert np.linalg.norm(np.diff(line.points, axis=0), axis=1).max() < 0.15


def test_a_surface_is_named_as_such(tmp_path):
    surface = vtp().replace(b'NumberOfLines="2"', b'NumberOfLines="0" NumberOfPolys="2"')
    (tmp_path / "a.vtp").write_bytes(surface)
    done = convert(tmp_path / "a.vtp", tmp_path / "curves")
    assert done.returncode == 2
    assert "is a surface (NumberOfPolys is '2') and holds no lines; give its centerlines" in done.stderr


def test_a_shared_trunk_appears_once(tmp_path):
    # Sampled as by VMTK: points of the second line lie between those of the first.
    first = [[0, 0, 2.0 * k] for k in range(16)] + [[2.0 * k, 0, 30 + 2.0 * k] for k in range(1, 11)]
    second = [[0, 0, 0]] + [[0, 0, 2.0 * k + 1] for k in range(15)] + [[-2.0 * k, 0, 30 + 2.0 * k] for k in range(11)]
    count, whole = len(first), len(first) + len(second)
    flat = [x for point in first + second + first for x in point]
    (tmp_path / "a.vtp").write_bytes(
        vtp("ascii", flat, [3.0] * (whole + count), list(range(whole + count)), [count, whole, whole + count])
    )
    done = convert(tmp_path / "a.vtp", tmp_path / "curves", "--unit", "cm")
    assert done.returncode == 0, done.stderr
    assert "2 centerlines, 37 points in cm; 42 repeated points of shared trunks were left out" in done.stdout
    curves = curves_in(tmp_path / "curves")
    assert curves["line_1"] == first
    assert curves["line_2"] == second[-11:]
    (markup,) = json.loads((tmp_path / "curves/line_1.mrk.json").read_text())["markups"]
    assert markup["coordinateUnits"] == markup["measurements"][0]["units"] == "cm"
    assert "coordinateSystem" not in markup


def test_a_unit_is_refused_for_states(tmp_path):
    done = convert(tmp_path / "a.jsonl", tmp_path / "b.csv", "--unit", "cm")
    assert done.returncode == 2 and "--unit cm is for centerlines in a .vtp" in done.stderr


ASCII = vtp()


@pytest.mark.parametrize(
    "contents, message",
    [
        (b"", ":1: not valid XML"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "has a document type"),
        (b"<a>" * 17, "nest deeper than 16"),
        (b"<a/>", "is a of type None"),
        (ASCII.replace(b'"PolyData"', b'"ImageData"'), "of type ImageData"),
        (ASCII.replace(b"LittleEndian", b"Middle"), "byte_order is Middle"),
        (ASCII.replace(b"UInt32", b"UInt8"), "header_type is UInt8"),
        (ASCII.replace(b'"UInt32"', b'"UInt32" compressor="LZ4"'), "compressor is LZ4; save it with ZLib"),
        (ASCII.replace(b"Piece", b"Peace"), "has 0 pieces"),
        (ASCII.replace(b'Points="4"', b'Points="99999999"'), "NumberOfPoints is '99999999', not 2 to"),
        (ASCII.replace(b'Points="4"', b'Points="-1"'), "NumberOfPoints is '-1'"),
        (ASCII.replace(b'Lines="2"', b'Lines="5000001"'), "NumberOfLines is '5000001'"),
        (ASCII.replace(b"MaximumInscribedSphere", b""), "compute it with vmtkcenterlines"),
        (ASCII.replace(b'Components="3"', b'Components="2"'), "Points has 2 components, not 3"),
        (ASCII.replace(b"Float32", b"String"), "Points is of type 'String'"),
        (ASCII.replace(b'"ascii"', b'"hex"'), "has the format 'hex'"),
        (ASCII.replace(b"12.5", b"12.5 1"), "Points has 13 numbers, not 12"),
        (ASCII.replace(b"12.5", b"x"), "could not convert string to float: 'x'"),
        (ASCII.replace(b"12.5", b"nan"), "Points holds a number that is not finite"),
        (ASCII.replace(b">2.0 1.5", b">2.0 -1.5"), "MaximumInscribedSphereRadius[1] is -1.5"),
        (vtp(ends=[4, 5]), "offsets are not those of lines"),
        (vtp(ends=[3, 9]), "connectivity has 5 numbers, not 9"),
        (vtp(lines=[0, 1, 4, 1, 3]), "connectivity goes from 0 to 4, beyond 4 points"),
        (vtp("base64").replace(b"\n_", b"\n"), "AppendedData has no data"),
        (vtp("raw").replace(b'offset="0"', b'offset="999999"'), "offset is '999999'"),
        (vtp("raw").replace(b'offset="0"', b'offset="4"'), "bytes, not 32"),
        (vtp("inline").replace(b'"binary">\n', b'"binary">\n!'), "is not base64"),
        (vtp("raw")[:-45], "ends after"),
        (vtp("zlib-raw").replace(b'offset="0"', b'offset="4"'), "blocks of"),
        (vtp("zlib-raw").replace(b"\x78\x9c", b"\x00\x00"), "block 0: Error -3"),
    ],
)
def test_refused(tmp_path, contents, message):
    (tmp_path / "lines.vtp").write_bytes(contents)
    done = convert(tmp_path / "lines.vtp", tmp_path / "curves")
    assert done.returncode == 2 and done.stdout == ""
    assert message in done.stderr and "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["lines.vtp"]


def test_a_block_that_inflates_is_refused(tmp_path):
    bomb = zlib.compress(b"\0" * (1 << 24))
    header = struct.pack("<4I", 1, 32, 0, len(bomb))
    text = vtp("zlib-inline")
    begin = text.index(b'"binary">\n') + len(b'"binary">\n')
    end = text.index(b"\n", begin)
    (tmp_path / "lines.vtp").write_bytes(
        text[:begin] + base64.b64encode(header) + base64.b64encode(bomb) + text[end:]
    )
    with pytest.raises(torquer.Error, match="block 0 does not have 32 bytes"):
        torquer.centerlines.read_vtp(tmp_path / "lines.vtp")
