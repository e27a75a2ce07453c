"""GPU encodings of AMR data, compared by memory, frame time and image error: the program amrtex, from Python.

    import amrtex
    mesh = amrtex.open("data/amrex_tiny/plt00008")
    amrtex.write_picture(mesh.render(size=(512, 512)), "picture.png")

Lengths and positions are in the data set's world units, sizes of memory in bytes, times in seconds. Level 0 is the coarsest, boxes are
half-open. An error is an amrtex.Error with the text that the command line prints. Ctrl-C ends the waiting for every call; see docs/python.md.
"""
from __future__ import annotations

import json
import os
import pathlib
import shutil
import warnings
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from . import _core
from ._core import BudgetError, Error, UnsupportedError, UsageError

__all__ = ["BudgetError", "Error", "Experiment", "Mesh", "Structure", "UnsupportedError", "UsageError", "encodings",
           "hierarchy", "open", "program", "records", "render", "write_picture"]
__version__ = "0.1.0"

Path = Union[str, "os.PathLike[str]"]
Scene = Union[Path, Mapping[str, Any]]
Bytes = Union[int, str]


def _path(path: Path) -> bytes:
    return os.fsencode(os.fspath(path))


def _json(value: Any) -> str:
    """JSON of a dict, in which numbers and arrays of NumPy may stand."""

    def plain(v: Any) -> Any:
        if isinstance(v, (np.generic, np.ndarray)):
            return v.tolist()
        if isinstance(v, os.PathLike):
            return os.fspath(v)
        raise UsageError(f"a {type(v).__name__}; accepted: dicts, lists, texts, numbers, True, False, None")

    try:
        return json.dumps(value, default=plain, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError) as error:  # a key that is no text, a NaN
        raise UsageError(str(error)) from None


def _bytes(value: Optional[Bytes]) -> Optional[int]:
    return None if value is None else _core.parse_bytes(str(value))


def _numbers(keyword: str, value: Any, count: Optional[int], accepted: str) -> List[float]:
    try:
        numbers = [float(v) for v in (value if np.ndim(value) else [value])]
    except (TypeError, ValueError):
        raise UsageError(f"{keyword} {value!r}; accepted: {accepted}") from None
    if (count is not None and len(numbers) != count) or not numbers or not np.all(np.isfinite(numbers)):
        raise UsageError(f"{keyword} {value!r}; accepted: {accepted}")
    return numbers


def _number(keyword: str, value: Any) -> Optional[float]:
    return None if value is None else _numbers(keyword, value, 1, "a finite number")[0]


def _text(keyword: str, value: Any) -> str:
    if value is None:
        return ""
    if not isinstance(value, (str, os.PathLike)):
        raise UsageError(f"{keyword} {value!r}; accepted: a text")
    return os.fspath(value)


def _settings(given: Optional[Mapping[str, Any]]) -> List[str]:
    if given is None:
        return []
    if not isinstance(given, Mapping):
        raise UsageError(f"set {given!r}; accepted: a dict, as {{\"render.step\": 0.5}}")
    return [f"{key}={_json(value)}" for key, value in given.items()]


_SCENE_KEYS = ("field", "colormap", "range", "log", "mode", "encoding", "filter", "size", "view", "camera", "fovy", "isovalue",
               "opacity_length")
_PICTURE_KEYS = ("set", "context", "memory_limit", "tolerance", "prune", "reference", "reference_step", "reference_tolerance")


def _accept(keywords: Mapping[str, Any], accepted: Sequence[str]) -> None:
    for key in keywords:
        if key not in accepted:
            raise UsageError(f"no keyword {key!r}; accepted: {', '.join(accepted)}")


def _request(scene: Optional[Scene], keywords: Mapping[str, Any]) -> Any:
    """What the command line's options are, from keywords of the same names."""
    _accept(keywords, _SCENE_KEYS + _PICTURE_KEYS)
    given = {key: value for key, value in keywords.items() if value is not None}
    request = _core.PictureRequest()
    if scene is not None:
        request.scene_name, request.scene = _scene_text(scene)
    arguments = request.arguments
    for key in ("field", "colormap", "mode", "encoding", "filter", "view"):
        setattr(arguments, key, _text(key, given.get(key)))
    if "range" in given:
        arguments.range = _numbers("range", given["range"], 2, "two numbers, the first and the last value of the colours")
    if "size" in given:
        size = _numbers("size", given["size"], 2, "width and height, pixels from 1 to 16384")
        if any(not 1 <= s <= 16384 or s != int(s) for s in size):
            raise UsageError(f"size {given['size']!r}; accepted: width and height, pixels from 1 to 16384")
        arguments.size = [int(s) for s in size]
    if "camera" in given:
        camera = np.ravel(given["camera"]) if np.ndim(given["camera"]) else given["camera"]
        arguments.camera = [repr(v) for v in _numbers("camera", camera, 9, "nine numbers: eye, a point it looks at, up")]
    if "isovalue" in given:
        arguments.isovalue = _numbers("isovalue", given["isovalue"], None, "a number, or several")
    arguments.opacity_length = _number("opacity_length", given.get("opacity_length"))
    if arguments.opacity_length is not None and arguments.opacity_length <= 0:
        raise UsageError(f"opacity_length {given['opacity_length']!r}; accepted: a length above 0, world units")
    arguments.fovy = _number("fovy", given.get("fovy"))
    arguments.log = bool(given.get("log", False))
    if arguments.fovy is not None and not arguments.camera:
        raise UsageError("fovy: it is the camera's; accepted: camera beside it")
    if "camera" in given and "view" in given:
        raise UsageError("view: with a camera, which is a view; accepted: one of both")
    request.set = _settings(given.get("set"))
    request.context = _text("context", given.get("context"))
    request.memory_limit = _bytes(given.get("memory_limit"))
    request.prune = bool(given.get("prune", False))
    request.reference = bool(given.get("reference", False))
    for key in ("tolerance", "reference_step", "reference_tolerance"):
        setattr(request, key, _number(key, given.get(key)))
    return request


def _scene_text(scene: Scene) -> Tuple[str, str]:
    """A name for messages, and the text."""
    if isinstance(scene, Mapping):
        return "scene", _json(scene)
    path = pathlib.Path(_text("scene", scene))
    try:
        return str(path), path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise Error(f"{path}: {getattr(error, 'strerror', None) or 'not UTF-8'}") from None


def _picture(drawn: Tuple[np.ndarray, List[str]]) -> np.ndarray:
    for warning in drawn[1]:
        warnings.warn(warning, stacklevel=3)
    return drawn[0]


def _positions(points: Any) -> Tuple[np.ndarray, Tuple[int, ...]]:
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim < 1 or array.shape[-1] != 3:
        raise UsageError("points: accepted: numbers of shape (..., 3), world units")
    return array.reshape(-1, 3), array.shape[:-1]


class Mesh:
    """An AMR mesh with its fields, in memory. `open` reads one, `hierarchy` makes one of arrays."""

    def __init__(self, core: Any) -> None:
        self._core = core

    def __repr__(self) -> str:
        return f"<amrtex.Mesh {self.name!r}: {len(self.levels)} levels, {self.leaf_cells} leaf cells, fields {self.fields}>"

    @property
    def name(self) -> str:
        """Of the data set."""
        return self._core.name

    @property
    def fields(self) -> List[str]:
        """Names of the fields. The first one is drawn where nobody says which."""
        return self._core.fields

    @property
    def levels(self) -> List[Dict[str, int]]:
        """A dict a level, the coarsest first: `level`, `patches`, `cells` (stored ones), `leaf_cells`, and `ratio_to_finer`, cells of the
        next finer level a cell along an axis (1 for the finest)."""
        return json.loads(self._core.levels)

    @property
    def leaf_cells(self) -> int:
        """Cells that no finer ones cover."""
        return self._core.leaf_cells

    @property
    def domain(self) -> np.ndarray:
        """Lower and upper corner, world units: float64 of shape (2, 3)."""
        return np.array([self._core.lower, self._core.upper])

    @property
    def hash(self) -> str:
        """Of the first field's leaf cells: equal for the same mesh in two formats."""
        return self._core.hash

    def statistics(self, field: Optional[str] = None) -> Dict[str, Any]:
        """Of the leaf cells that have a value: `min`, `max`, `volume_integral` (value times world volume), and `cells_without_value`, how
        many leaf cells hold a NaN or an infinity. The first field where none is named."""
        return self._core.statistics(_text("field", field))

    def save(self, path: Path, format: Optional[str] = None) -> None:
        """Writes the mesh to a name that must not exist yet, as `amrtex convert` does: by the name's ending, a folder in AMReX's format
        where it has none. An experiment reads it from there."""
        self._core.save(_path(path), _text("format", format))

    def encode(self, name: str, *, filter: Optional[str] = None, storage: Optional[str] = None, filtering: Optional[str] = None,
               field: Optional[str] = None, memory_limit: Optional[Bytes] = None, context: str = "egl", **parameters: Any) -> Structure:
        """Builds an encoding of one field and puts it on the GL context.

        name          one of amrtex.encodings()
        filter        "nearest" (the default of experiments), "linear_lod", "linear_page", "linear_vertex", "basis", …
        storage       "r32f" (default), "r16f", "r16", "r8", …
        filtering     "hardware" (default) or "manual"
        field         the first one otherwise
        memory_limit  of its textures and buffers: bytes, or a text such as "512MiB"
        context       "egl", "egl_device" or "osmesa"
        parameters    the encoding's own, as `amrtex encodings` lists them: page_size=8

        Raises UnsupportedError where the encoding cannot do it, BudgetError where it takes more memory than the limit.
        """
        request = _core.StructureRequest()
        request.encoding = _text("name", name)
        for key, value in (("filter", filter), ("storage", storage), ("filtering", filtering), ("field", field), ("context", context)):
            setattr(request, key, _text(key, value))
        request.memory_limit = _bytes(memory_limit)
        return Structure(self._core.encode(request, _json(parameters)))

    def sample(self, points: Any, field: Optional[str] = None, filter: str = "linear_vertex") -> np.ndarray:
        """The filter's own values in double precision, by search in the mesh: what encodings are judged against.

        points: shape (..., 3), world units. Returns float64 of shape (...), NaN where there is no value. "linear_page" is that of one page
        of the finest level.
        """
        flat, shape = _positions(points)
        return self._core.sample(flat, _text("field", field), _text("filter", filter)).reshape(shape)

    def render(self, scene: Optional[Scene] = None, **keywords: Any) -> np.ndarray:
        """A picture of the mesh, as `amrtex render` draws it; all that is not said follows from the data.

        scene     a scene file, or a dict of the same form (docs/experiments.md); of its `datasets` the field alone counts
        keywords  the options of `amrtex render`:
                  field, mode ("dvr", "projection", "mip", "iso", "dvr_iso"), encoding, filter, size (width, height in pixels),
                  view ("corner", "+x", "-x", …), camera (nine numbers: eye, a point it looks at, up; world units), fovy (degrees),
                  colormap (a name or a file), range (two values), log, isovalue (one or several), opacity_length (world units),
                  tolerance (error asked of every channel, of full scale), prune, set (a dict, as {"render.step": 0.5}),
                  memory_limit (bytes or text), context ("egl", "egl_device", "osmesa"),
                  reference (True: the filter's own picture in double precision), reference_tolerance, reference_step

        Returns shape (height, width, channels), first row on top: 4 channels, premultiplied linear RGBA; 1 channel, the raw values of
        modes projection (field times world length) and mip. float32; float64 for references, or where floats do not hold the values.
        """
        return _picture(self._core.render(_request(scene, keywords)))


class Structure:
    """An encoding of one field of a mesh, built and on a GL context. Made by Mesh.encode."""

    def __init__(self, core: Any) -> None:
        self._core = core

    def __repr__(self) -> str:
        return f"<amrtex.Structure {self.encoding} {self.parameters} {self.filter} {self.storage}: {self.memory['total_bytes']} bytes>"

    @property
    def encoding(self) -> str:
        """Its name."""
        return self._core.encoding

    @property
    def parameters(self) -> Dict[str, Any]:
        """Those of its build, defaults filled in."""
        return json.loads(self._core.parameters)

    @property
    def field(self) -> str:
        """The one that it holds."""
        return self._core.field

    @property
    def filter(self) -> str:
        """The mathematics that it reproduces (docs/filters.md)."""
        return self._core.filter

    @property
    def storage(self) -> str:
        """Format of its values."""
        return self._core.storage

    @property
    def filtering(self) -> str:
        """Who interpolates: "hardware" or "manual"."""
        return self._core.filtering

    @property
    def build_seconds(self) -> float:
        """That building took, without the upload."""
        return self._core.build_seconds

    @property
    def memory(self) -> Dict[str, Any]:
        """As in records: `total_bytes`; `by_role`, bytes of `payload`, `duplicated`, `topology` and `padding`; `texels_by_texture`;
        `texels_per_cell` (texels of value textures a leaf cell); `host_peak_bytes`. Of the structure as `encode` built it."""
        return json.loads(self._core.memory)

    def sample(self, points: Any, column: str = "encoding_gl") -> np.ndarray:
        """Values at points, by a column of `amrtex sample`.

        points: shape (..., 3), world units. column: "encoding_gl", what a shader on the GL context reads, at positions as a cell and a
        float fraction; "encoding_double", the same text in double precision over double payload; "reference", Mesh.sample of its filter.
        Returns float64 of shape (...), NaN where there is no value.
        """
        flat, shape = _positions(points)
        return self._core.sample(flat, _text("column", column)).reshape(shape)

    def render(self, scene: Optional[Scene] = None, **keywords: Any) -> np.ndarray:
        """A picture drawn from this structure: as Mesh.render, without the keywords encoding, filter, field, memory_limit and context, which
        are its own. What a scene says of encodings, filters and storage is passed over. A scene that needs other parts (lit surfaces,
        several fields, boxes drawn one by one) builds the structure once more, and keeps that."""
        return _picture(self._core.render(_request(scene, keywords)))


def open(path: Path, fields: Optional[Sequence[str]] = None) -> Mesh:
    """Reads a data set of any format that `amrtex info` reads; only `fields`, in that order, where they are given."""
    if isinstance(fields, str):
        fields = [fields]
    return Mesh(_core.open(_path(path), [_text("fields", f) for f in fields or []]))


def hierarchy(levels: Any, boxes: Any, values: Any, *, lower: Any = (0, 0, 0), upper: Any = (1, 1, 1), ratios: Any = 2,
              root_cells: Any = None, periodic: Any = (False, False, False), name: str = "hierarchy") -> Mesh:
    """A mesh made of NumPy arrays, one entry a patch, in any order: for data whose format amrtex does not read.

    levels      integers of shape (patches): 0 is the coarsest
    boxes       integers of shape (patches, 2, 3): lower and upper corner, half-open, in cells of the patch's level; the domain's
                lower corner is cell 0. Shape (patches, 2, 2) for two-dimensional data, a slab as deep as a finest cell's edge
    values      an array for each patch, or a dict {field: such a list} for several fields: values[p][i, j, k] is the cell i, j, k along
                x, y, z from the lower corner of box p, so its shape is that box's size. NaN and infinities are cells without a value
    lower       of the domain, world units; (3) or (2) numbers
    upper       of the domain, world units
    ratios      cells of the next finer level a cell along an axis: one number, or one a pair of levels
    root_cells  cells of the domain at level 0; as far as the boxes of level 0 reach where it is not given
    periodic    for each axis; such a domain is drawn clamped
    name        of the data set, for tables and messages

    What lies under finer patches is not used. Values are copied. Raises Error that names the patch where boxes overlap, leave the
    domain, cut a coarser cell, or do not have the size of their values.
    """
    level = _integers("levels", levels)
    corners = _integers("boxes", boxes)
    if level.ndim != 1 or level.size == 0:
        raise Error(f"levels: shape {level.shape}; accepted: (patches), one patch or more")
    if corners.ndim != 3 or corners.shape[:2] != (level.size, 2) or corners.shape[2] not in (2, 3):
        raise Error(f"boxes: shape {corners.shape}; accepted: ({level.size}, 2, 3), or ({level.size}, 2, 2) for two-dimensional data")
    by_field = dict(values) if isinstance(values, Mapping) else {"value": values}
    if not by_field:
        raise Error("values: no field; accepted: a list of arrays, or a dict {field: list of arrays}")
    arrays = [_patches(_text("values: name of a field", field), list_, corners) for field, list_ in by_field.items()]
    axes = corners.shape[2]
    steps = int(level.max()) if 0 <= level.max() < 64 else 0
    ratio = _integers("ratios", ratios)
    ratio_list = [int(ratio)] * steps if ratio.ndim == 0 else [int(r) for r in ratio.ravel()]
    if len(ratio_list) != steps:
        raise Error(f"ratios: {len(ratio_list)} of them; accepted: one number, or {steps}, one a pair of the {steps + 1} levels")
    root = [0, 0, 0] if root_cells is None else [int(r) for r in _integers("root_cells", root_cells).ravel()] + [1] * (3 - axes)
    if len(root) != 3 or (root_cells is not None and min(root) < 1) or any(not 0 <= r < 2**31 for r in root + ratio_list):
        raise Error(f"root_cells {root_cells!r}, ratios {ratios!r}; accepted: {axes} numbers of cells from 1, and ratios from 2")
    return Mesh(_core.hierarchy(_text("name", name), list(by_field), level, corners, arrays, ratio_list, _corner("lower", lower, axes),
                                _corner("upper", upper, axes), root, [bool(p) for p in periodic]))


def _integers(what: str, given: Any) -> np.ndarray:
    array = np.asarray(given)
    if array.dtype.kind not in "iu" or (array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max):
        raise Error(f"{what}: {'nothing' if array.size == 0 else f'type {array.dtype}'}; accepted: integers")
    return array.astype(np.int64, order="C")


def _corner(what: str, given: Any, axes: int) -> List[float]:
    numbers = _numbers(what, given, None, f"{axes} finite numbers, world units")
    if len(numbers) not in (axes, 3):
        raise Error(f"{what} {given!r}; accepted: {axes} finite numbers, world units")
    return (numbers + [0.0 if what == "lower" else 1.0])[:3]


def _patches(field: str, given: Any, boxes: np.ndarray) -> List[np.ndarray]:
    arrays = list(given) if isinstance(given, (list, tuple)) or np.ndim(given) else []
    if len(arrays) != len(boxes):
        raise Error(f"values of {field!r}: {len(arrays)} arrays; accepted: {len(boxes)}, one a patch")
    result = []
    for p, (values, box) in enumerate(zip(arrays, boxes)):
        array = np.asarray(values)
        if array.dtype.kind not in "fiub":
            raise Error(f"values of {field!r}, patch {p}: type {array.dtype}; accepted: real numbers")
        size = tuple(int(s) for s in box[1] - box[0])
        if array.shape != size:
            raise Error(f"values of {field!r}, patch {p}: shape {array.shape}; accepted: {size}, the size of its box")
        result.append(array)
    return result


def encodings() -> List[str]:
    """Names of the encodings."""
    return _core.encodings()


def render(source: Union[Scene, Mesh, Structure], **keywords: Any) -> np.ndarray:
    """A picture of a scene (a file, or a dict of the same form), of a data set (its path), of a Mesh or of a Structure. Keywords and
    result are those of Mesh.render."""
    if isinstance(source, (Mesh, Structure)):
        return source.render(**keywords)
    if not isinstance(source, Mapping) and _core.is_data_set(_path(source)):
        field = keywords.get("field")
        return open(source, None if field is None or keywords.get("set") else [field]).render(**keywords)
    return _picture(_core.render_scene(_request(source, keywords)))


def write_picture(picture: Any, path: Path, background: Any = (0, 0, 0), transparent: bool = False) -> None:
    """Writes what `render` returned: .png to look at (8-bit sRGB; one channel through a colour map over its range), .exr or .npy for the
    floats. background: linear RGB from 0 to 1 behind the picture; transparent: its own opacity in its place."""
    array = np.asarray(picture)
    if array.dtype.kind not in "fiu":
        raise UsageError("picture: accepted: an array of shape (height, width, 4) or (height, width, 1), as render returns it")
    behind = _numbers("background", background, 3, "red, green and blue from 0 to 1, linear")
    _core.write_picture(array, _path(path), behind, bool(transparent))


def program() -> str:
    """The program amrtex, which measures for Experiment.run: that of the variable AMRTEX_PROGRAM, else the one of this module's own build or
    installation, else the one on the PATH."""
    given = os.environ.get("AMRTEX_PROGRAM")
    if given:
        return given
    here = pathlib.Path(__file__).resolve().parent
    for folder in (here.parents[1], *(parent / "bin" for parent in here.parents)):  # build/<preset>; an installation's prefix
        if os.access(folder / "amrtex", os.X_OK) and (folder / "amrtex").is_file():
            return str(folder / "amrtex")
    found = shutil.which("amrtex")
    if found is None:
        raise Error("no program amrtex beside the module or on the PATH, and measuring processes are started from it; accepted: its path in the "
                    "variable AMRTEX_PROGRAM, or program=")
    return found


_RUN_KEYS = ("where", "only", "set", "context", "memory_limit", "process_limit", "time_limit", "time_out", "repeat", "force", "keep_old",
             "retry_failed", "no_pictures", "program", "recorded")


class Experiment:
    """What to build, to draw and to measure: a dict as experiment files have it (docs/experiments.md), or the path of such a file. Relative
    paths of a dict's data begin in the current folder. Raises UsageError that names the key, and what is accepted there."""

    def __init__(self, experiment: Union[Mapping[str, Any], Path], set: Optional[Mapping[str, Any]] = None) -> None:
        self._text, self._file = (_json(experiment), b"") if isinstance(experiment, Mapping) else ("", _path(experiment))
        self._set = _settings(set)
        _core.check_experiment(self._request("", {}))

    def _request(self, out: Path, keywords: Mapping[str, Any]) -> Any:
        _accept(keywords, _RUN_KEYS)
        given = {key: value for key, value in keywords.items() if value is not None}
        request = _core.RunRequest()
        request.text, request.input, request.out = self._text, self._file, _path(out)
        request.set = self._set + _settings(given.get("set"))
        request.where = _text("where", given.get("where"))
        only = given.get("only", [])
        request.only = [only] if isinstance(only, str) else [_text("only", o) for o in only]
        request.context = _text("context", given.get("context"))
        if "memory_limit" in given:
            request.memory_limit = str(_bytes(given["memory_limit"]))
        request.process_limit = _bytes(given.get("process_limit"))
        for key in ("time_limit", "time_out"):
            setattr(request, key, _number(key, given.get(key)))
            if key in given and getattr(request, key) <= 0:
                raise UsageError(f"{key} {given[key]!r}; accepted: seconds, above 0")
        repeat = given.get("repeat", 1)
        if not isinstance(repeat, (int, np.integer)) or not 1 <= repeat <= 1000:
            raise UsageError(f"repeat {repeat!r}; accepted: 1 to 1000")
        request.repeat = int(repeat)
        for key in ("force", "keep_old", "retry_failed", "no_pictures"):
            setattr(request, key, bool(given.get(key, False)))
        return request

    def points(self, out: Path = "", **keywords: Any) -> List[Dict[str, Any]]:
        """The points, in the experiment's order: `configuration` (the hash that names the record), `settings`, and `status`, that of its record
        in the folder `out`, "open" where there is none. Reads the data sets. Keywords: where, only, set, context, memory_limit."""
        return json.loads(_core.points(self._request(out, keywords)))

    def run(self, out: Path, **keywords: Any) -> Dict[str, Any]:
        """Measures every point that has no record in the folder `out` yet, as `amrtex run` does: in processes of the program amrtex, so that
        a crash costs its point alone. Ctrl-C ends the process that measures; what has a record keeps it, and the next run goes on there.

        keywords  the options of `amrtex run`: where, only, repeat, time_limit and time_out (seconds), process_limit and memory_limit (bytes
                  or text), force, keep_old, retry_failed, no_pictures, context, set; and
        program   the program amrtex; else program()
        recorded  a function that hears each record, a dict, when it is on disk

        A dict is written to out/experiment.json. Returns counts: `measured`, `kept`, `unsupported`, `over_budget`, `failed`, `left`; `seconds`,
        and by what they went, `shares`; `warnings`. Tables: `amrtex report out`.
        """
        request = self._request(out, keywords)
        if not request.out:
            raise UsageError("out is missing: the folder for records and pictures")
        request.program = _path(keywords.get("program") or program())
        hear: Optional[Callable[[Dict[str, Any]], Any]] = keywords.get("recorded")
        summary = json.loads(_core.run(request, None if hear is None else lambda text: hear(json.loads(text))))
        for warning in summary["warnings"]:
            warnings.warn(warning, stacklevel=2)
        return summary


def records(path: Path, flat: bool = False) -> List[Dict[str, Any]]:
    """The records of a folder that `amrtex run` or Experiment.run wrote, or of its file records.jsonl or records.jsonl.gz: a dict a point
    (docs/experiments.md). flat: one level deep, keys such as "memory.total_bytes", so that pandas.DataFrame makes a column of each."""
    folder = pathlib.Path(os.fspath(path))
    if folder.is_file():
        if folder.name not in ("records.jsonl", "records.jsonl.gz"):
            raise UsageError(f"{folder}: accepted: a folder of records, or its file records.jsonl or records.jsonl.gz")
        folder = folder.parent
    text, told = _core.records(_path(folder))
    for warning in told:
        warnings.warn(warning, stacklevel=2)
    found = json.loads(text)
    return [_flat(record) for record in found] if flat else found


def _flat(record: Mapping[str, Any], front: str = "") -> Dict[str, Any]:
    result: Dict[str, Any] = {}
    for key, value in record.items():
        if isinstance(value, dict):
            result.update(_flat(value, f"{front}{key}."))
        else:
            result[front + key] = value
    return result
