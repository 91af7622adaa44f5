"""Converts centerlines of VMTK (.vtp) to curves for the key "centerlines" of a scene.

    torquer.centerlines.convert("centerline.vtp", "curves")  # curves/line_1.mrk.json and so on
"""

from __future__ import annotations

import base64
import binascii
import dataclasses
import os
import struct
import zlib
from typing import Any, Dict, List, Optional, Tuple, Union
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from . import Error
from ._user_file import open_file
from .export import slicer_curve, write_folder

_RADIUS = "MaximumInscribedSphereRadius"
_MOST_BYTES = 256 << 20
_MOST_POINTS = 5_000_000
_MOST_LINES = 1000
_DEEPEST = 16
# A point within this fraction of its radius from another line lies on that line.
_ON_LINE = 0.1
# Steps of the other line among which the next point's nearest one is searched.
_STEPS_AHEAD = 200
_TYPES = {"Float32": "f4", "Float64": "f8", "Int32": "i4", "Int64": "i8"}
UNITS = ("mm", "m", "cm", "um", "in")
"""Units that a scene's surfaces and curves may have."""
MM = dict(zip(UNITS, (1.0, 1000.0, 10.0, 0.001, 25.4)))
"""Millimeters of each unit."""
_SAVE_AGAIN = "save it again as VTK XML PolyData (.vtp)"


@dataclasses.dataclass(frozen=True)
class Line:
    """A centerline, in the unit of its file."""

    points: npt.NDArray[np.float64]
    """Shape (n, 3)."""
    radii: npt.NDArray[np.float64]
    """Shape (n,)."""


class _Xml:
    """Parses a file, and refuses a document type, which could define entities."""

    def __init__(self, path: str, text: bytes) -> None:
        self._path = path
        self._depth = 0
        self._builder = TreeBuilder()
        parser = expat.ParserCreate()
        parser.StartDoctypeDeclHandler = self._refuse_doctype
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._builder.data
        try:
            parser.Parse(text, True)
        except expat.ExpatError as error:
            raise Error(f"{path}:{error.lineno}: not valid XML ({error}); {_SAVE_AGAIN}") from None
        self.root: Element = self._builder.close()

    def _refuse_doctype(self, *_: Any) -> None:
        raise Error(f"{self._path}: has a document type; no VTK file needs one: {_SAVE_AGAIN}")

    def _start(self, name: str, attributes: Any) -> None:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise Error(f"{self._path}: elements nest deeper than {_DEEPEST}; {_SAVE_AGAIN}")
        self._builder.start(name, attributes)

    def _end(self, name: str) -> None:
        self._depth -= 1
        self._builder.end(name)


class _Reader:
    def __init__(self, path: str) -> None:
        self.path = path
        try:
            with open_file(path) as file:
                contents = file.read(_MOST_BYTES + 1)
        except OSError as error:
            raise Error(f"{path}: cannot be read ({error.strerror}); check the disk") from None
        if len(contents) > _MOST_BYTES:
            raise Error(f"{path}: larger than {_MOST_BYTES} bytes; give the centerlines alone")
        # Raw appended data is not XML, so it is removed before the parsing.
        self._appended = b""
        self._appended_base64 = False
        at = contents.find(b"<AppendedData")
        if at >= 0:
            end = contents.find(b">", at)
            begin = contents.find(b"_", end)
            if end < 0 or begin < 0 or contents[end + 1 : begin].strip():
                raise self.refuse("AppendedData has no data after \"_\"")
            self._appended = contents[begin + 1 :]
            self._appended_base64 = b"base64" in contents[at:end]
            contents = contents[:at] + b"</VTKFile>"
        self.root = _Xml(path, contents).root
        if self.root.tag != "VTKFile" or self.root.get("type") != "PolyData":
            raise self.refuse(f"is {self.root.tag} of type {self.root.get('type')}, not VTKFile of PolyData")
        order = self.root.get("byte_order", "LittleEndian")
        if order not in ("LittleEndian", "BigEndian"):
            raise self.refuse(f"byte_order is {order}")
        self._order = "<" if order == "LittleEndian" else ">"
        header = self.root.get("header_type", "UInt32")
        if header not in ("UInt32", "UInt64"):
            raise self.refuse(f"header_type is {header}")
        self._header = "I" if header == "UInt32" else "Q"
        compressor = self.root.get("compressor")
        if compressor not in (None, "vtkZLibDataCompressor"):
            raise Error(f"{path}: compressor is {compressor}; save it with ZLib or without compression")
        self._compressed = compressor is not None

    def refuse(self, what: str) -> Error:
        return Error(f"{self.path}: {what}; {_SAVE_AGAIN}")

    def count(self, piece: Element, name: str, low: int, high: int) -> int:
        text = piece.get(name, "")
        if not (text.isascii() and text.isdigit() and len(text) < 10 and low <= int(text) <= high):
            raise self.refuse(f"{name} is {text[:40]!r}, not {low} to {high}")
        return int(text)

    def array(self, parent: Optional[Element], name: Optional[str], size: int, columns: int = 1) -> Any:
        """Values of a DataArray, which must have size * columns values."""
        arrays: List[Element] = [] if parent is None else parent.findall("DataArray")
        found = [a for a in arrays if name is None or a.get("Name") == name]
        shown = name or "Points"
        if len(found) != 1:
            remedy = "compute it with vmtkcenterlines" if name == _RADIUS else _SAVE_AGAIN
            raise Error(f"{self.path}: DataArray {shown} is there {len(found)} times, not once; {remedy}")
        array = found[0]
        if array.get("NumberOfComponents", "1") != str(columns):
            raise self.refuse(f"{shown} has {array.get('NumberOfComponents')} components, not {columns}")
        kind = array.get("type", "")
        if kind not in _TYPES:
            raise self.refuse(f"{shown} is of type {kind!r}, not one of {', '.join(_TYPES)}")
        dtype = np.dtype(self._order + _TYPES[kind])
        form = array.get("format")
        if form == "ascii":
            values = self._ascii(shown, array.text or "", size * columns, dtype)
        elif form == "binary":
            # Inline text may have line breaks; appended text has none.
            text = "".join((array.text or "").split()).encode()
            values = self._binary(shown, text, True, size * columns, dtype)
        elif form == "appended":
            offset = self.count(array, "offset", 0, max(0, len(self._appended)))
            values = self._binary(
                shown, self._appended[offset:], self._appended_base64, size * columns, dtype
            )
        else:
            raise self.refuse(f"{shown} has the format {form!r}, not ascii, binary or appended")
        if not np.isfinite(values).all():
            raise self.refuse(f"{shown} holds a number that is not finite")
        return values.reshape(size, columns) if columns > 1 else values

    def _ascii(self, name: str, text: str, count: int, dtype: Any) -> Any:
        words = text.split()
        if len(words) != count:
            raise self.refuse(f"{name} has {len(words)} numbers, not {count}")
        try:
            return np.array([float(w) if dtype.kind == "f" else int(w) for w in words])
        except (ValueError, OverflowError) as error:
            raise self.refuse(f"{name}: {error}") from None

    def _take(self, name: str, data: bytes, encoded: bool, count: int) -> bytes:
        """The first count bytes."""
        length = 4 * ((count + 2) // 3) if encoded else count
        part = data[:length]
        if encoded:
            try:
                part = base64.b64decode(part, validate=True)
            except binascii.Error as error:
                raise self.refuse(f"{name} is not base64 ({error})") from None
        if len(part) < count:
            raise self.refuse(f"{name} ends after {len(part)} of {count} bytes")
        return part[:count]

    def _binary(self, name: str, data: bytes, encoded: bool, count: int, dtype: Any) -> Any:
        width = struct.calcsize(self._order + self._header)
        wanted = count * dtype.itemsize

        def words(number: int) -> Any:
            raw = self._take(name, data, encoded, number * width)
            return struct.unpack(f"{self._order}{number}{self._header}", raw)

        if not self._compressed:
            (length,) = words(1)
            if length != wanted:
                raise self.refuse(f"{name} has {length} bytes, not {wanted}")
            return np.frombuffer(self._take(name, data, encoded, width + wanted)[width:], dtype)
        blocks, full, last = words(3)
        # Each block has at least one byte, so that there are not more blocks than bytes.
        if blocks > wanted or (blocks and (blocks - (last > 0)) * full + last != wanted):
            raise self.refuse(f"{name} has {blocks} blocks of {full} bytes, which is not {wanted} bytes")
        sizes = words(3 + blocks)[3:]
        header = (3 + blocks) * width
        rest = data[4 * ((header + 2) // 3) if encoded else header :]
        packed = self._take(name, rest, encoded, sum(sizes))
        out = b""
        at = 0
        for k, size in enumerate(sizes):
            length = last if last and k == blocks - 1 else full
            stream = zlib.decompressobj()
            try:
                # One byte more than allowed shows a block that is too long.
                part = stream.decompress(packed[at : at + size], length + 1)
            except zlib.error as error:
                raise self.refuse(f"{name}, block {k}: {error}") from None
            if len(part) != length:
                raise self.refuse(f"{name}, block {k} does not have {length} bytes")
            out += part
            at += size
        if len(out) != wanted:
            raise self.refuse(f"{name} has {len(out)} bytes, not {wanted}")
        return np.frombuffer(out, dtype)


def _refuse_surface(reader: _Reader, piece: Element) -> None:
    for name in ("NumberOfPolys", "NumberOfStrips"):
        if piece.get(name, "0") != "0" and piece.get("NumberOfLines", "0") == "0":
            raise Error(
                f"{reader.path}: is a surface ({name} is {piece.get(name, '')[:40]!r}) and holds no lines; "
                "give its centerlines, which vmtkcenterlines computes"
            )


def _joined(lines: List[Any]) -> List[Any]:
    """Joins lines of two points into longer ones, up to the points where they end or branch.

    The lines keep their order; a joined one has the place of its first.
    """
    places: Dict[Tuple[int, int], int] = {}  # by step
    for place, line in enumerate(lines):
        if len(line) == 2:
            places.setdefault((int(line[0]), int(line[1])), place)
    steps = list(places)
    meeting: Dict[int, List[int]] = {}  # the steps at a point; -1 stands for a longer line
    for k, step in enumerate(steps):
        for node in step:
            meeting.setdefault(node, []).append(k)
    joined = {place: line for place, line in enumerate(lines) if len(line) > 2}
    for line in joined.values():
        for node in line.tolist():
            meeting.setdefault(node, []).append(-1)
    used = [False] * len(steps)

    def follow(node: int) -> List[int]:
        way = []
        while len(meeting[node]) == 2:
            k = max(meeting[node], key=lambda step: step >= 0 and not used[step])
            if k < 0 or used[k]:
                break
            used[k] = True
            node = steps[k][1] if steps[k][0] == node else steps[k][0]
            way.append(node)
        return way

    for k, (start, end) in enumerate(steps):
        if used[k]:
            continue
        used[k] = True
        onward = [start, end, *follow(end)]
        joined[places[start, end]] = np.array([*reversed(follow(start)), *onward])
    return [joined[place] for place in sorted(joined)]


def read_vtp(path: Union[str, "os.PathLike[str]"]) -> List[Line]:
    """Reads the centerlines in a file of VMTK: ascii, base64 or raw, with zlib or without.

    Lines of two points each, as SimVascular writes them, are joined up to the next branch.
    """
    reader = _Reader(os.fspath(path))
    pieces = reader.root.findall("PolyData/Piece")
    if len(pieces) != 1:
        raise reader.refuse(f"has {len(pieces)} pieces, not one")
    piece = pieces[0]
    _refuse_surface(reader, piece)
    points_count = reader.count(piece, "NumberOfPoints", 2, _MOST_POINTS)
    lines_count = reader.count(piece, "NumberOfLines", 1, _MOST_POINTS)
    points = reader.array(piece.find("Points"), None, points_count, 3).astype(float)
    radii = reader.array(piece.find("PointData"), _RADIUS, points_count).astype(float)
    if (radii < 0).any():
        k = int((radii < 0).argmax())
        raise Error(f"{reader.path}: {_RADIUS}[{k}] is {radii[k]}; a radius is not negative: compute it again")
    cells = piece.find("Lines")
    ends = reader.array(cells, "offsets", lines_count).astype(np.int64)
    starts = np.concatenate([[0], ends[:-1]])
    if (ends - starts < 2).any() or ends[-1] > 2 * _MOST_POINTS:
        raise reader.refuse(f"offsets are not those of lines of 2 or more points, {2 * _MOST_POINTS} in all")
    nodes = reader.array(cells, "connectivity", int(ends[-1])).astype(np.int64)
    if nodes.min() < 0 or nodes.max() >= points_count:
        raise reader.refuse(f"connectivity goes from {nodes.min()} to {nodes.max()}, beyond {points_count} points")
    lines = _joined([nodes[a:b] for a, b in zip(starts, ends)])
    if len(lines) > _MOST_LINES:
        raise Error(f"{reader.path}: holds {len(lines)} lines, more than {_MOST_LINES}; give fewer branches")
    return [Line(points[line], radii[line]) for line in lines]


def _nearest(line: Line, point: Any, first: int, last: int) -> Tuple[float, int]:
    """Distance of a point from the steps first to last of a line, and the nearest step."""
    begin = line.points[first:last]
    way = line.points[first + 1 : last + 1] - begin
    off = point - begin
    squared = np.einsum("ij,ij->i", way, way)
    share = np.einsum("ij,ij->i", off, way) / np.where(squared > 0, squared, 1.0)
    distances = np.linalg.norm(off - np.clip(share, 0, 1)[:, None] * way, axis=1)
    k = int(distances.argmin())
    return float(distances[k]), first + k


def _points_shared(line: Line, earlier: List[Line]) -> int:
    """Number of first points of a line that lie on an earlier line."""
    most = 0
    for other in earlier:
        steps = len(other.points) - 1
        first, last = 0, steps
        shared = 0
        for point, radius in zip(line.points, line.radii):
            distance, step = _nearest(other, point, first, last)
            if distance > _ON_LINE * radius:
                break
            shared += 1
            first, last = max(0, step - _STEPS_AHEAD), min(steps, step + _STEPS_AHEAD)
        most = max(most, shared)
    return most


def without_trunks(lines: List[Line]) -> List[Line]:
    """Removes the part of a line that lies on an earlier one, except for the point where it branches off.

    VMTK repeats the trunk in the line to each target; blood would flow through it twice.
    """
    kept: List[Line] = []
    for line in lines:
        begin = max(0, _points_shared(line, kept) - 1)
        backward = Line(line.points[::-1], line.radii[::-1])
        end = len(line.points) - max(0, _points_shared(backward, kept) - 1)
        if end - begin > 1:
            kept.append(Line(line.points[begin:end], line.radii[begin:end]))
    return kept


def convert(
    source: Union[str, "os.PathLike[str]"], folder: Union[str, "os.PathLike[str]"], unit: str = "mm"
) -> str:
    """Writes each line of a .vtp as a curve in a new folder; returns a description.

    unit: of the file's coordinates, one of UNITS. Neither the file nor the curves name a coordinate system. The curves
    must be in that of the surface.
    """
    read = read_vtp(source)
    lines = without_trunks(read)
    write_folder(
        folder,
        {f"line_{k}.mrk.json": slicer_curve(line.points, line.radii, unit, None) for k, line in enumerate(lines, 1)},
    )
    before, after = (sum(len(line.points) for line in some) for some in (read, lines))
    shared = f"; {before - after} repeated points of shared trunks were left out" if after < before else ""
    return f"{len(lines)} centerlines, {after} points in {unit}{shared}"
