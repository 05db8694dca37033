from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

__version__: str

def stiffness(
    nodes: np.ndarray, tets: np.ndarray, material: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
def mass(
    nodes: np.ndarray, tets: np.ndarray, material: np.ndarray, lumped: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...

class GreenCore:
    surface_nodes: np.ndarray
    surface_positions: np.ndarray
    surface_triangles: np.ndarray
    touch_ranks: np.ndarray
    fixed_dofs: np.ndarray
    precision: str
    key: str
    description: str
    youngs_modulus: float | None
    path: Path | None
    @staticmethod
    def content_key(arguments: tuple[np.ndarray, ...], precision_name: str) -> str: ...
    @staticmethod
    def precompute(
        arguments: tuple[np.ndarray, ...],
        precision_name: str,
        description: str,
        progress: Callable[[int, int], Any] | None,
    ) -> GreenCore: ...
    @staticmethod
    def precompute_to(
        arguments: tuple[np.ndarray, ...],
        precision_name: str,
        description: str,
        progress: Callable[[int, int], Any] | None,
        path: Path,
        memory: int | None = None,
    ) -> tuple[int, bool]: ...
    @staticmethod
    def plan(arguments: tuple[np.ndarray, ...], precision_name: str, memory: int | None = None) -> dict[str, Any]: ...
    @staticmethod
    def load(path: Path, expected_key: str | None = None) -> GreenCore: ...
    def save(self, path: Path) -> None: ...
    def solve(
        self, known: list[tuple[int, float]], switched: list[tuple[int, float]]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
    def touch(
        self, point: tuple[float | None, ...], displacement: tuple[float | None, ...], radius: float
    ) -> tuple[list[float], np.ndarray]: ...
    def entry(self, row: int, column: int) -> float: ...

class Interior:
    def __init__(self, arguments: tuple[np.ndarray, ...]) -> None: ...
    def extend(self, surface: np.ndarray) -> np.ndarray: ...

class SimulationCore:
    def __init__(
        self,
        green: GreenCore,
        tools: int,
        tool_radius: float,
        contact_radius: float,
        max_stiffness: float,
        limits: tuple[float, float, float],
    ) -> None: ...
    def start(self) -> None: ...
    def stop(self) -> None: ...
    def set_target(self, tool: int, position: tuple[float, ...], active: bool, grab: bool) -> None: ...
    def configure(self, contact_radius: float, stiffness_scale: float, reset: bool) -> None: ...
    def accepts_contact_radius(self, radius: float) -> bool: ...
    def frame(self) -> dict[str, Any] | None: ...
    def drain_log(self) -> np.ndarray: ...
    def run(self, positions: np.ndarray) -> tuple[np.ndarray, str | None]: ...
