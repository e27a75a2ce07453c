"""The extension module: amrtex is the interface."""
from typing import Callable, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

class Error(Exception): ...
class UsageError(Error): ...
class UnsupportedError(Error): ...
class BudgetError(Error): ...

_Drawn = Tuple[np.ndarray, List[str]]
_Path = Union[bytes, str]

class SceneArguments:
    field: str
    colormap: str
    mode: str
    encoding: str
    filter: str
    view: str
    range: List[float]
    isovalue: List[float]
    size: List[int]
    camera: List[str]
    opacity_length: Optional[float]
    fovy: Optional[float]
    log: bool

class PictureRequest:
    arguments: SceneArguments
    scene: str
    scene_name: str
    set: List[str]
    context: str
    memory_limit: Optional[int]
    tolerance: Optional[float]
    prune: bool
    reference: bool
    reference_step: Optional[float]
    reference_tolerance: Optional[float]
    def __init__(self) -> None: ...

class StructureRequest:
    field: str
    encoding: str
    filter: str
    storage: str
    filtering: str
    context: str
    memory_limit: Optional[int]
    def __init__(self) -> None: ...

class RunRequest:
    text: str
    input: _Path
    out: _Path
    program: _Path
    where: str
    only: List[str]
    set: List[str]
    context: str
    memory_limit: str
    process_limit: Optional[int]
    time_limit: Optional[float]
    time_out: Optional[float]
    repeat: int
    force: bool
    keep_old: bool
    retry_failed: bool
    no_pictures: bool
    def __init__(self) -> None: ...

class Mesh:
    name: str
    fields: List[str]
    levels: str
    leaf_cells: int
    lower: List[float]
    upper: List[float]
    hash: str
    def statistics(self, field: str) -> Dict[str, float]: ...
    def save(self, path: _Path, format: str) -> None: ...
    def encode(self, request: StructureRequest, parameters: str) -> Structure: ...
    def sample(self, points: np.ndarray, field: str, filter: str) -> np.ndarray: ...
    def render(self, request: PictureRequest) -> _Drawn: ...

class Structure:
    encoding: str
    parameters: str
    field: str
    filter: str
    storage: str
    filtering: str
    build_seconds: float
    memory: str
    def sample(self, points: np.ndarray, column: str) -> np.ndarray: ...
    def render(self, request: PictureRequest) -> _Drawn: ...

def open(path: _Path, fields: Sequence[str]) -> Mesh: ...
def hierarchy(
    name: str,
    fields: Sequence[str],
    levels: np.ndarray,
    boxes: np.ndarray,
    values: Sequence[Sequence[np.ndarray]],
    ratios: Sequence[int],
    lower: Sequence[float],
    upper: Sequence[float],
    root_cells: Sequence[int],
    periodic: Sequence[bool],
) -> Mesh: ...
def is_data_set(path: _Path) -> bool: ...
def render_scene(request: PictureRequest) -> _Drawn: ...
def write_picture(picture: np.ndarray, path: _Path, background: Sequence[float], transparent: bool) -> None: ...
def check_experiment(request: RunRequest) -> None: ...
def points(request: RunRequest) -> str: ...
def run(request: RunRequest, recorded: Optional[Callable[[str], object]]) -> str: ...
def records(folder: _Path) -> Tuple[str, List[str]]: ...
def parse_bytes(text: str) -> int: ...
def encodings() -> List[str]: ...
