"""Reads NRRD and MetaImage files, which 3D Slicer, ITK-SNAP and SimVascular write."""

from __future__ import annotations

import bz2
import gzip
import os
import re
import zlib
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import numpy.typing as npt

from .._user_file import open_file
from ._base import Error
from .scan import MOST_VOXELS, Scan, as_int16

_MOST_HEADER_BYTES = 1 << 20
_NRRD_TYPES = {
    "int8": "i1", "signed char": "i1", "int8_t": "i1",
    "uint8": "u1", "uchar": "u1", "unsigned char": "u1", "uint8_t": "u1",
    "int16": "i2", "short": "i2", "short int": "i2", "signed short": "i2", "int16_t": "i2",
    "uint16": "u2", "ushort": "u2", "unsigned short": "u2", "unsigned short int": "u2", "uint16_t": "u2",
    "int32": "i4", "int": "i4", "signed int": "i4", "int32_t": "i4",
    "uint32": "u4", "uint": "u4", "unsigned int": "u4", "uint32_t": "u4",
    "float": "f4", "double": "f8",
}
_META_TYPES = {
    "MET_CHAR": "i1", "MET_UCHAR": "u1", "MET_SHORT": "i2", "MET_USHORT": "u2", "MET_INT": "i4", "MET_UINT": "u4",
    "MET_FLOAT": "f4", "MET_DOUBLE": "f8",
}
# Signs from the file's frame to LPS.
_SPACES = {
    "left-posterior-superior": (1, 1, 1), "lps": (1, 1, 1),
    "right-anterior-superior": (-1, -1, 1), "ras": (-1, -1, 1),
    "left-anterior-superior": (1, -1, 1), "las": (1, -1, 1),
}
_EXPORT = "export it again, as NRRD or NIfTI from 3D Slicer"


def _numbers(path: str, key: str, text: str, count: int) -> npt.NDArray[np.float64]:
    try:
        out = np.array([float(word) for word in re.split(r"[\s,()]+", text.strip(" ()")) if word])
    except ValueError:
        out = np.array([])
    if len(out) != count or not np.isfinite(out).all():
        raise Error(f"{path}: field {key} is {text[:60]!r}, not {count} numbers; {_EXPORT}")
    return out


def _sizes(path: str, key: str, text: str) -> Tuple[int, ...]:
    words = text.split()
    if len(words) != 3 or any(not (word.isascii() and word.isdigit() and len(word) < 8 and int(word)) for word in words):
        if len(words) == 4:
            raise Error(f"{path}: field {key} is {text[:60]!r}: a color image or several volumes; export one gray volume")
        raise Error(f"{path}: field {key} is {text[:60]!r}, not the sizes of a volume; {_EXPORT}")
    sizes = tuple(map(int, words))
    if int(np.prod(sizes)) > MOST_VOXELS:
        raise Error(f"{path}: has {int(np.prod(sizes))} voxels, more than {MOST_VOXELS}; crop it in 3D Slicer")
    return sizes


def _header(path: str, ends: bytes) -> Tuple[List[str], bytes]:
    """Lines of the header up to a line `ends`, and the file's rest."""
    try:
        with open_file(path) as file:
            lines: List[str] = []
            read = 0
            while True:
                line = file.readline(_MOST_HEADER_BYTES)
                read += len(line)
                if read >= _MOST_HEADER_BYTES:
                    raise Error(f"{path}: has no end of its header; {_EXPORT}")
                text = line.strip()
                if not line or (not ends and not text):
                    return lines, file.read()
                lines.append(text.decode("utf-8", "replace"))
                if ends and text.startswith(ends):
                    return lines, file.read()
    except OSError as error:
        raise Error(f"{path}: cannot be read ({error.strerror}); check the disk") from None


def _beside(path: str, key: str, name: str) -> bytes:
    """Contents of the data file that a header names."""
    if "%" in name or name.upper().startswith("LIST"):
        raise Error(f"{path}: field {key} is {name[:60]!r}, a list of files; export it as one file")
    other = os.path.join(os.path.dirname(path), name)
    try:
        with open_file(other) as file:
            return file.read()
    except OSError as error:
        raise Error(f"{other}: cannot be read ({error.strerror}); check the disk") from None


def _unpacked(path: str, encoding: str, data: bytes, wanted: int) -> bytes:
    try:
        if encoding in ("gzip", "gz"):
            return gzip.decompress(data)
        if encoding in ("bzip2", "bz2"):
            return bz2.decompress(data)
        if encoding == "zlib":
            stream = zlib.decompressobj()
            return stream.decompress(data, wanted)
    except (OSError, EOFError, ValueError, zlib.error) as error:
        raise Error(f"{path}: its {encoding} data is damaged ({error}); {_EXPORT}") from None
    if encoding != "raw":
        raise Error(f"{path}: its data is encoded as {encoding[:20]!r}, not raw or gzip; {_EXPORT}")
    return data


def _array(path: str, data: bytes, dtype: Any, sizes: Tuple[int, ...], skip: int) -> npt.NDArray[Any]:
    wanted = int(np.prod(sizes)) * dtype.itemsize
    if skip == -1:
        data = data[-wanted:]
    elif skip > 0:
        data = data[skip:]
    if len(data) < wanted:
        raise Error(f"{path}: ends after {len(data)} of {wanted} bytes; it is cut short: copy it again")
    return np.frombuffer(data, dtype, int(np.prod(sizes))).reshape(sizes[::-1]).astype(dtype.newbyteorder("="), copy=False)


def _fields(path: str, lines: List[str], between: str) -> Dict[str, str]:
    fields: Dict[str, str] = {}
    for line in lines:
        if not line or line.startswith("#") or between not in line:
            continue
        key, value = line.split(between, 1)
        fields[key.strip().lower()] = value.lstrip("=").strip()
    return fields


def _need_field(path: str, fields: Dict[str, str], key: str) -> str:
    if key not in fields:
        raise Error(f"{path}: field {key} is missing; {_EXPORT}")
    return fields[key]


def _nrrd_axes(path: str, fields: Dict[str, str], facts: List[str]) -> npt.NDArray[np.float64]:
    affine = np.eye(4)
    if "space directions" not in fields:
        affine[:3, :3] = np.diag(_numbers(path, "spacings", _need_field(path, fields, "spacings"), 3))
        facts.append("The file does not say how the patient lies (no space directions): left, back and head are assumed.")
        return affine
    vectors = re.findall(r"\(([^)]*)\)|none", fields["space directions"])
    if len(vectors) != 3 or not all(vectors):
        raise Error(f"{path}: field space directions is {fields['space directions'][:60]!r}, not three vectors; {_EXPORT}")
    for axis, vector in enumerate(vectors):
        affine[:3, axis] = _numbers(path, "space directions", vector, 3)
    affine[:3, 3] = _numbers(path, "space origin", fields.get("space origin", "0 0 0"), 3)
    space = fields.get("space", "").lower()
    if space not in _SPACES:
        raise Error(f"{path}: field space is {space[:40]!r}, not one of {', '.join(_SPACES)}; {_EXPORT}")
    affine[:3] *= np.array(_SPACES[space])[:, None]
    return affine


def read_nrrd(path: str) -> Scan:
    lines, rest = _header(path, b"")
    if not lines or not lines[0].startswith("NRRD000"):
        raise Error(f"{path}: does not begin as an NRRD file; {_EXPORT}")
    fields = _fields(path, lines[1:], ":")
    facts = [f"NRRD in the space {fields.get('space', 'unknown')}."]
    kind = _need_field(path, fields, "type")
    if kind not in _NRRD_TYPES:
        raise Error(f"{path}: field type is {kind[:40]!r}, not a number; {_EXPORT}")
    order = ">" if fields.get("endian", "little") == "big" else "<"
    dtype = np.dtype(order + _NRRD_TYPES[kind])
    sizes = _sizes(path, "sizes", _need_field(path, fields, "sizes"))
    affine = _nrrd_axes(path, fields, facts)
    name = fields.get("data file", fields.get("datafile"))
    data = rest if name is None else _beside(path, "data file", name)
    for key in ("line skip", "lineskip"):
        if fields.get(key, "0") != "0":
            raise Error(f"{path}: field {key} is {fields[key][:20]!r}; {_EXPORT}")
    skip = int(_numbers(path, "byte skip", fields.get("byte skip", fields.get("byteskip", "0")), 1)[0])
    data = _unpacked(path, _need_field(path, fields, "encoding").lower(), data, int(np.prod(sizes)) * dtype.itemsize)
    values = _array(path, data, dtype, sizes, skip)
    return Scan(as_int16(path, values, 1, 0), affine, facts, path)


def _flag(fields: Dict[str, str], key: str) -> bool:
    return fields.get(key, "False").lower() in ("true", "1")


def read_meta(path: str) -> Scan:
    lines, rest = _header(path, b"ElementDataFile")
    fields = _fields(path, lines, "=")
    if "ndims" not in fields:
        raise Error(f"{path}: does not begin as a MetaImage file (no NDims); {_EXPORT}")
    if fields.get("elementnumberofchannels", "1") != "1":
        raise Error(f"{path}: is a color or vector image (RGB); export the gray values of the CT")
    kind = _need_field(path, fields, "elementtype")
    if kind not in _META_TYPES:
        raise Error(f"{path}: field ElementType is {kind[:40]!r}, not one of {', '.join(_META_TYPES)}; {_EXPORT}")
    big = _flag(fields, "binarydatabyteordermsb") or _flag(fields, "elementbyteordermsb")
    dtype = np.dtype((">" if big else "<") + _META_TYPES[kind])
    sizes = _sizes(path, "DimSize", _need_field(path, fields, "dimsize"))
    spacing = _numbers(path, "ElementSpacing", fields.get("elementspacing", "1 1 1"), 3)
    facts = ["MetaImage, in LPS."]
    turn: Optional[str] = fields.get("transformmatrix", fields.get("rotation", fields.get("orientation")))
    if turn is None:
        turn = "1 0 0 0 1 0 0 0 1"
        facts.append("The file does not say how the patient lies (no TransformMatrix): left, back and head are assumed.")
    affine = np.eye(4)
    # Rows of the matrix are the directions of the axes.
    affine[:3, :3] = _numbers(path, "TransformMatrix", turn, 9).reshape(3, 3).T * spacing
    affine[:3, 3] = _numbers(path, "Offset", fields.get("offset", fields.get("position", fields.get("origin", "0 0 0"))), 3)
    name = _need_field(path, fields, "elementdatafile")
    data = rest if name == "LOCAL" else _beside(path, "ElementDataFile", name)
    wanted = int(np.prod(sizes)) * dtype.itemsize
    skip = int(_numbers(path, "HeaderSize", fields.get("headersize", "0"), 1)[0])
    data = _unpacked(path, "zlib" if _flag(fields, "compresseddata") else "raw", data, wanted)
    return Scan(as_int16(path, _array(path, data, dtype, sizes, skip), 1, 0), affine, facts, path)
