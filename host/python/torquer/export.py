"""Wire shapes for other programs: ParaView, 3D Slicer, tables, meshio, pyvista.

    states = torquer.export.read_states("states.jsonl")
    torquer.export.write(states, "wire.pvd")  # or .vtp, .mrk.json, .csv
    torquer.export.to_meshio(torquer.export.State.of(simulation))
    torquer.export.to_pyvista(simulation).plot()

A file is written under a temporary name and then renamed, so that it is complete or absent.
"""

from __future__ import annotations

import base64
import dataclasses
import json
import os
import pathlib
import secrets
import shutil
import struct
import tempfile
from typing import Any, Callable, Dict, Iterator, List, Mapping, Sequence, Tuple, Union
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from . import Error, Simulation, Surface
from ._user_file import load_json, open_file
from .states import MAGIC
from .states import read_states as read_fields

Array = npt.NDArray[np.float64]
Path = Union[str, "os.PathLike[str]"]

# Fields of --states with a value for each node, and the number of columns of a value.
_NODE_FIELDS = {
    "contact_force_mN": 3,
    "line_load_mN_mm": 1,
    "tension_mN": 1,
    "bending_mN_mm": 1,
    "twisting_mN_mm": 1,
}
_OWN_NODES = ".nodes_mm"  # end of the name of an instrument's field
_MOST_NODES = 100_000
_MOST_LINE_BYTES = 64 << 20


@dataclasses.dataclass(frozen=True)
class State:
    """The curve of the instrument that reaches farthest, from its entry to its tip, and the others."""

    time_s: float
    nodes_mm: Array
    """Shape (n, 3)."""
    point_data: Dict[str, Array]
    """Values of each node: contact_force_mN (n, 3), tension_mN and others (n,); empty without forces."""
    instruments: Dict[str, Array] = dataclasses.field(default_factory=dict)
    """Nodes of each instrument by its name, if they lie on several curves; empty if all lie on nodes_mm."""

    @staticmethod
    def of(simulation: Simulation) -> State:
        """Copies the present state of a simulation."""
        scene = simulation.scene
        forces = simulation.forces() if "internal_forces" in scene.effects else {}
        if "contact_mN" in forces:
            forces["contact_force_mN"] = forces.pop("contact_mN")
        several = "clearance" in scene.effects or any(one.is_beside for one in scene.instruments)
        names = [one.name for one in scene.instruments] if several else []
        nodes = {name: simulation.instrument_nodes_mm(k) for k, name in enumerate(names)}
        return State(simulation.time_s, simulation.nodes_mm.copy(), forces, nodes)

    def lines(self) -> List[Tuple[str, Array, Dict[str, Array]]]:
        """Name, nodes and values of each polyline, nodes_mm first. Values are NaN on the others."""

        def is_first(nodes: Array) -> bool:
            return len(nodes) == len(self.nodes_mm) and np.allclose(nodes, self.nodes_mm, rtol=0, atol=1e-9)

        first = [name for name, nodes in self.instruments.items() if is_first(nodes)][:1]
        out = [("".join(first), self.nodes_mm, self.point_data)]
        for name, nodes in self.instruments.items():
            if name not in first:
                shape = {key: (len(nodes), *values.shape[1:]) for key, values in self.point_data.items()}
                out.append((name, nodes, {key: np.full(size, np.nan) for key, size in shape.items()}))
        return out


def _numbers(where: str, field: str, value: Any, columns: int, may_be_unknown: bool = False) -> Array:
    shape = f"a list of {'[x, y, z]' if columns == 3 else 'numbers'}"
    remedy = "write the file again with torquer-simulator --states"
    rows = value if isinstance(value, list) else None
    if rows is None:
        raise Error(f"{where}: field {field} is {str(value)[:40]}, not {shape}; {remedy}")
    if not 1 <= len(rows) <= _MOST_NODES:
        raise Error(f"{where}: field {field} has {len(rows)} entries, not 1 to {_MOST_NODES}; {remedy}")
    kinds = (int, float, type(None)) if may_be_unknown else (int, float)  # null: not known
    for k, row in enumerate(rows):
        parts = row if columns == 3 and isinstance(row, list) else [row]
        if len(parts) != columns or any(type(part) not in kinds for part in parts):
            raise Error(f"{where}: field {field}[{k}] is {str(row)[:40]}; {field} is {shape}; {remedy}")
    # A number that a double cannot hold becomes infinite here, or cannot be converted.
    try:
        out = np.array(rows, float)
    except OverflowError:
        out = np.array([np.inf])
    if np.isinf(out).any():
        raise Error(f"{where}: field {field} holds a number that is not finite; {remedy}")
    return out


def _parse_state(where: str, line: bytes) -> State:
    try:
        fields = load_json(line)
    except ValueError as error:
        raise Error(
            f"{where}: not valid JSON ({error}); the file is damaged or cut short: write it again"
        ) from None
    if not isinstance(fields, dict):
        raise Error(f"{where}: not a JSON object; give a file of torquer-simulator --states")
    for field in ("time_s", "nodes_mm"):
        if field not in fields:
            raise Error(f"{where}: field {field} is missing; give a file of torquer-simulator --states")
    time_s = fields["time_s"]
    if type(time_s) not in (int, float) or not abs(time_s) <= 1e9:
        raise Error(f"{where}: field time_s is {str(time_s)[:40]}, not a number up to 1e9; repair it")
    nodes = _numbers(where, "nodes_mm", fields["nodes_mm"], 3)
    data = {}
    for field, columns in _NODE_FIELDS.items():
        if field in fields:
            data[field] = _numbers(where, field, fields[field], columns, may_be_unknown=True)
            if len(data[field]) != len(nodes):
                raise Error(
                    f"{where}: field {field} has {len(data[field])} entries for {len(nodes)} nodes; "
                    "write the file again with torquer-simulator --states"
                )
    instruments = {
        field.removesuffix(_OWN_NODES): _numbers(where, field, values, 3)
        for field, values in fields.items()
        if field.endswith(_OWN_NODES)
    }
    return State(float(time_s), nodes, data, instruments)


def _lines(path: str) -> Iterator[bytes]:
    try:
        with open_file(path) as file:
            while line := file.readline(_MOST_LINE_BYTES + 1):
                yield line
    except OSError as error:
        raise Error(f"{path}: cannot be read ({error.strerror}); check the disk") from None


def _read_binary(path: str) -> List[State]:
    fields = read_fields(path)
    for field in ("time_s", "nodes_mm"):
        if field not in fields:
            raise Error(f"{path}: field {field} is missing; name it in torquer-simulator --fields")
    names = [name for name in _NODE_FIELDS if name in fields]
    own = [name for name in fields if name.endswith(_OWN_NODES)]
    states = [
        State(
            float(fields["time_s"][k]),
            np.asarray(fields["nodes_mm"][k]),
            {name: np.asarray(fields[name][k]) for name in names},
            {name.removesuffix(_OWN_NODES): np.asarray(fields[name][k]) for name in own},
        )
        for k in range(fields.rows)
    ]
    if not states:
        raise Error(f"{path}: holds no state; give a file of torquer-simulator --states")
    return states


def read_states(path: Path) -> List[State]:
    """Reads the states in a file of torquer-simulator --states, JSON or binary."""
    path = os.fspath(path)
    if next(_lines(path), b"").startswith(MAGIC):
        return _read_binary(path)
    states: List[State] = []
    for number, line in enumerate(_lines(path), 1):
        where = f"{path}:{number}"
        if len(line) > _MOST_LINE_BYTES:
            raise Error(f"{where}: longer than {_MOST_LINE_BYTES} bytes; give a file of --states")
        state = _parse_state(where, line)
        if states and state.time_s <= states[-1].time_s:
            raise Error(
                f"{where}: field time_s is {state.time_s}, not after {states[-1].time_s} of the line "
                "before; give the states of one run"
            )
        states.append(state)
    if not states:
        raise Error(f"{path}: holds no state; give a file of torquer-simulator --states")
    return states


def _data_array(name: str, values: npt.NDArray[Any]) -> str:
    values = np.ascontiguousarray(values)
    kind = "Float64" if values.dtype.kind == "f" else "Int64"
    columns = 1 if values.ndim == 1 else values.shape[1]
    raw = values.astype("<f8" if kind == "Float64" else "<i8").tobytes()
    text = base64.b64encode(struct.pack("<Q", len(raw)) + raw).decode()
    return (
        f'<DataArray type="{kind}" Name={quoteattr(name)} NumberOfComponents="{columns}" '
        f'format="binary">{text}</DataArray>\n'
    )


_VTK_FILE = (
    '<?xml version="1.0"?>\n<VTKFile type="{}" version="1.0" byte_order="LittleEndian" '
    'header_type="UInt64">\n'
)


def _vtp(state: State) -> str:
    lines = state.lines()
    ends = np.cumsum([len(nodes) for _, nodes, _ in lines])
    data = "".join(
        _data_array(name, np.concatenate([values[name] for _, _, values in lines])) for name in state.point_data
    )
    return (
        _VTK_FILE.format("PolyData")
        + f'<PolyData>\n<Piece NumberOfPoints="{ends[-1]}" NumberOfVerts="0" NumberOfLines="{len(lines)}" '
        f'NumberOfStrips="0" NumberOfPolys="0">\n<PointData>\n{data}</PointData>\n<Points>\n'
        + _data_array("Points", np.concatenate([nodes for _, nodes, _ in lines]))
        + "</Points>\n<Lines>\n"
        + _data_array("connectivity", np.arange(ends[-1]))
        + _data_array("offsets", ends)
        + "</Lines>\n</Piece>\n</PolyData>\n</VTKFile>\n"
    )


def slicer_curve(
    points: Array, radii: Union[Array, None] = None, unit: str = "mm", system: Union[str, None] = "LPS"
) -> str:
    """Curve of 3D Slicer through points: left-posterior-superior, as in surfaces of patients."""
    markup: Dict[str, Any] = {
        "type": "Curve",
        **({"coordinateSystem": system} if system else {}),
        "coordinateUnits": unit,
        "controlPoints": [
            {"id": str(k + 1), "position": list(map(float, point)), "positionStatus": "defined"}
            for k, point in enumerate(points)
        ],
        "measurements": [],
    }
    if radii is not None:
        markup["measurements"] = [
            {
                "name": "Radius",
                "enabled": True,
                "units": unit,
                "controlPointValues": list(map(float, radii)),
            }
        ]
    schema = (
        "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
        "Resources/Schema/markups-schema-v1.0.3.json#"
    )
    return json.dumps({"@schema": schema, "markups": [markup]}, indent=1) + "\n"


def _csv(states: Sequence[State]) -> str:
    names = list(states[0].point_data)
    several = bool(states[0].instruments)
    header = ["time_s", *(["instrument"] if several else []), "node", "x_mm", "y_mm", "z_mm"]
    for name in names:
        stem, unit = name.rsplit("_", 1)
        three = states[0].point_data[name].ndim == 2
        header += [f"{stem}_{axis}_{unit}" for axis in "xyz"] if three else [name]
    lines = [",".join(header)]
    for state in states:
        if list(state.point_data) != names or bool(state.instruments) != several:
            raise Error(f"the state at {state.time_s} s has other data than the first; give one run")
        for name, nodes, values in state.lines():
            begin = f"{state.time_s!r},{name}," if several else f"{state.time_s!r},"
            for node, row in enumerate(np.column_stack([nodes, *values.values()])):
                lines.append(f"{begin}{node}," + ",".join(map(repr, map(float, row))))
    return "\n".join(lines) + "\n"


def _write_text(path: pathlib.Path, text: str) -> None:
    if path.exists() and not path.is_file():
        raise Error(f"{path}: is not an ordinary file; give another name")
    # Torquer's programs, too, write the file that a link points to.
    target = pathlib.Path(os.path.realpath(path))
    temporary = target.with_name(f".torquer-{secrets.token_hex(8)}")
    try:
        with temporary.open("x") as file:
            file.write(text)
        temporary.replace(target)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        raise Error(f"{path}: cannot be written ({error.strerror}); check the folder and its space") from None


def write_folder(
    folder: Path, files: Mapping[str, Union[str, bytes]], before: Callable[[], None] = lambda: None
) -> None:
    """Makes a folder with these files, by their names. After an error there is no folder.

    `before` is called when all files are written, and the folder has yet to get its name.
    """
    folder = pathlib.Path(folder)
    if os.path.lexists(folder):
        raise Error(f"{folder}: exists already; remove it, or give another name")
    temporary = None
    try:
        temporary = pathlib.Path(tempfile.mkdtemp(prefix=".torquer-", dir=folder.parent))
        for name, contents in files.items():
            (temporary / name).write_bytes(contents if isinstance(contents, bytes) else contents.encode())
        temporary.chmod(0o755)
        before()
        temporary.rename(folder)
    except BaseException as error:
        if temporary:
            shutil.rmtree(temporary, ignore_errors=True)
        if not isinstance(error, OSError):
            raise
        raise Error(f"{folder}: cannot be written ({error.strerror}); check the folder and its space") from None


def _write_series(states: Sequence[State], path: pathlib.Path) -> None:
    folder = path.with_suffix("")
    files = {f"state_{k:06}.vtp": _vtp(state) for k, state in enumerate(states)}
    sets = "".join(
        f'<DataSet timestep="{state.time_s!r}" part="0" file={quoteattr(f"{folder.name}/{name}")}/>\n'
        for state, name in zip(states, files)
    )
    text = f"{_VTK_FILE.format('Collection')}<Collection>\n{sets}</Collection>\n</VTKFile>\n"
    is_new = not os.path.lexists(path)
    try:
        # The folder comes last: an existing one is refused, so that a killed run could not be repeated.
        write_folder(folder, files, lambda: _write_text(path, text))
    except BaseException:
        if is_new:
            path.unlink(missing_ok=True)
        raise


def _listed(states: Any, path: pathlib.Path) -> List[State]:
    """The states that a user gave, as a list."""
    given = [states] if isinstance(states, State) else states
    if isinstance(given, Simulation):
        raise Error(f"{path}: a simulation is given; give torquer.export.State.of(simulation)")
    if not isinstance(given, (list, tuple)) or not all(isinstance(one, State) for one in given):
        raise Error(f"{path}: {type(states).__name__} is given; give a State of torquer.export, or a list of them")
    if not given:
        raise Error(f"{path}: there is no state to write; give one at least")
    return list(given)


def write(states: Union[State, Sequence[State]], path: Path) -> str:
    """Writes a state or several in the format of the path's ending, and returns a description.

    A .pvd is a series for ParaView, with a .vtp for each state in the folder of the same name. This folder must not
    exist yet. A .csv has a row for each node. A .vtp or .mrk.json has only the last state. For instruments on several
    curves, .mrk.json has the curve that reaches farthest; the other formats have all curves.
    """
    path = pathlib.Path(path)
    states = _listed(states, path)
    last = f"the state at {states[-1].time_s} s, {len(states[-1].nodes_mm)} nodes in mm"
    every = f"{len(states)} states, {states[0].time_s} to {states[-1].time_s} s, nodes in mm"
    if path.name.endswith(".mrk.json"):
        _write_text(path, slicer_curve(states[-1].nodes_mm))
        return last
    if path.suffix == ".vtp":
        _write_text(path, _vtp(states[-1]))
        return last
    if path.suffix == ".csv":
        _write_text(path, _csv(states))
        return every
    if path.suffix == ".pvd":
        _write_series(states, path)
        return every
    raise Error(f"{path}: no known ending; give .pvd, .vtp, .mrk.json or .csv")


def to_meshio(state: State) -> Any:
    """A state as a meshio.Mesh of polylines. Needs Debian's python3-meshio."""
    try:
        import meshio  # type: ignore[import]
    except ImportError:
        raise Error("meshio is missing; install the package python3-meshio") from None
    lines = state.lines()
    ends = np.cumsum([len(nodes) for _, nodes, _ in lines])
    index = np.delete(np.arange(ends[-1]), ends - 1)  # no segment begins at the end of a line
    cells = [("line", np.column_stack([index, index + 1]))]
    data = {name: np.concatenate([values[name] for _, _, values in lines]) for name in state.point_data}
    return meshio.Mesh(np.concatenate([nodes for _, nodes, _ in lines]), cells, point_data=data)


def to_vtk(state: State) -> Any:
    """A state as a vtkPolyData of polylines. Needs Debian's python3-vtk9."""
    try:
        from vtkmodules.vtkIOXML import vtkXMLPolyDataReader  # type: ignore[import]
    except ImportError:
        raise Error("vtkmodules is missing; install the package python3-vtk9") from None
    reader = vtkXMLPolyDataReader()
    reader.ReadFromInputStringOn()
    reader.SetInputString(_vtp(state))
    reader.Update()
    return reader.GetOutput()


def to_pyvista(given: Union[Simulation, State, Surface]) -> Any:
    """Wires or a surface as a pyvista.PolyData, in mm. The wires of a simulation or a state are polylines, with the forces
    at their nodes, and "time_s" in field_data. A surface, as that of Scene.surface(), has triangles. Needs pyvista, of
    which Debian has no package."""
    try:
        import pyvista  # type: ignore[import]
    except ImportError:
        raise Error("pyvista is missing; install it with pip install pyvista, or use to_vtk") from None
    if isinstance(given, Surface):
        return pyvista.PolyData(given.points_mm, faces=np.insert(given.triangles, 0, 3, axis=1).ravel())
    state = State.of(given) if isinstance(given, Simulation) else given
    if not isinstance(state, State):
        raise Error(f"{type(given).__name__} is given; give a Simulation, a State of torquer.export, or a Surface")
    cells: List[int] = []
    first = 0
    for _, nodes, _ in state.lines():
        cells += [len(nodes), *range(first, first + len(nodes))]
        first += len(nodes)
    mesh = pyvista.PolyData(np.concatenate([nodes for _, nodes, _ in state.lines()]), lines=np.array(cells))
    for name in state.point_data:
        mesh.point_data[name] = np.concatenate([values[name] for _, _, values in state.lines()])
    mesh.field_data["time_s"] = [state.time_s]
    return mesh
