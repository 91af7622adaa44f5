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
from typing import Any, List, Optional, Union
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
_TYPES = {"Float32": "f4", "Float64": "f8", "Int32": "i4", "Int64": "i8"}
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
        # Raw appended data is no XML, so it is removed before the parsing.
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
                raise self.refuse(f"{name} is no base64 ({error})") from None
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


def read_vtp(path: Union[str, "os.PathLike[str]"]) -> List[Line]:
    """Reads the centerlines in a file of VMTK: ascii, base64 or raw, with zlib or without."""
    reader = _Reader(os.fspath(path))
    pieces = reader.root.findall("PolyData/Piece")
    if len(pieces) != 1:
        raise reader.refuse(f"has {len(pieces)} pieces, not one")
    piece = pieces[0]
    points_count = reader.count(piece, "NumberOfPoints", 2, _MOST_POINTS)
    lines_count = reader.count(piece, "NumberOfLines", 1, _MOST_LINES)
    points = reader.array(piece.find("Points"), None, points_count, 3).astype(float)
    radii = reader.array(piece.find("PointData"), _RADIUS, points_count).astype(float)
    if (radii < 0).any():
        k = int((radii < 0).argmax())
        raise Error(f"{reader.path}: {_RADIUS}[{k}] is {radii[k]}; a radius is not negative: compute it again")
    cells = piece.find("Lines")
    ends = reader.array(cells, "offsets", lines_count).astype(np.int64)
    starts = np.concatenate([[0], ends[:-1]])
    if (ends - starts < 2).any() or ends[-1] > _MOST_POINTS:
        raise reader.refuse(f"offsets are not those of lines of 2 or more points, {_MOST_POINTS} in all")
    nodes = reader.array(cells, "connectivity", int(ends[-1])).astype(np.int64)
    if nodes.min() < 0 or nodes.max() >= points_count:
        raise reader.refuse(f"connectivity goes from {nodes.min()} to {nodes.max()}, beyond {points_count} points")
    return [Line(points[nodes[a:b]], radii[nodes[a:b]]) for a, b in zip(starts, ends)]


def convert(source: Union[str, "os.PathLike[str]"], folder: Union[str, "os.PathLike[str]"]) -> str:
    """Writes each line of a .vtp as a curve in a new folder; returns a description."""
    lines = read_vtp(source)
    write_folder(
        folder,
        {f"line_{k}.mrk.json": slicer_curve(line.points, line.radii) for k, line in enumerate(lines, 1)},
    )
    return f"{len(lines)} centerlines, {sum(len(line.points) for line in lines)} points in the file's unit"
