"""What is used of PyVista, for the type checker: its own modules import all of VTK.

tests/test_typings.py holds this to the real one.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

class PolyData:
    @classmethod
    def from_regular_faces(cls, points: np.ndarray, faces: np.ndarray) -> PolyData: ...

class Light:
    def __init__(self, *, position: Sequence[float], light_type: str) -> None: ...

class Plotter:
    camera_position: Sequence[tuple[float, ...]]
    camera: Any
    renderer: Any
    def __init__(self, *, off_screen: bool, window_size: Sequence[int], lighting: None) -> None: ...
    def add_mesh(self, mesh: PolyData, **options: Any) -> object: ...
    def add_light(self, light: Light) -> None: ...
    def enable_anti_aliasing(self, aa_type: str) -> None: ...
    def screenshot(self, *, return_img: bool) -> np.ndarray: ...
    def close(self) -> None: ...

def register_dataset_accessor(name: str, target_cls: type) -> Callable[[type[T]], type[T]]: ...
