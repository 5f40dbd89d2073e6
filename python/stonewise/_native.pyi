"""The compiled part of the module: arrays must be contiguous and of the types that stand here."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

__version__: str

_Progress = Optional[Callable[[str, int, int], Any]]
_Path = Union[str, os.PathLike[str]]

class Error(Exception):
    """Why something could not be done, in the words of the command line."""

class View:
    """A posed photo: what its camera shows, and from where.

    Camera frame: x right, y down, z along the view. Pixels: x right, y down, the first pixel's centre at (0.5, 0.5).
    """

    def __new__(
        cls,
        width: int,
        height: int,
        focal_px: float,
        rotation: Any,
        centre: Any,
        *,
        principal_point_px: Optional[Sequence[float]] = None,
        radial: Sequence[float] = ...,
        tangential: Sequence[float] = ...,
        name: str = "",
    ) -> View:
        """``rotation``: (3, 3), from world axes to those of the camera; ``centre``: of projection, metres; ``radial``: k1 to k4;
        ``tangential``: p1, p2 in OpenCV's order."""

    @property
    def name(self) -> str:
        """Name of the photo in the camera file."""

    @property
    def width(self) -> int:
        """Width of the photo, pixels."""

    @property
    def height(self) -> int:
        """Height of the photo, pixels."""

    @property
    def centre(self) -> list[float]:
        """Centre of projection (x, y, z), world, metres."""

    def project(self, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels (n, 2) of points (n, 3); NaN behind the camera and where the lens shows nothing. A pixel may lie outside the photo."""

class Detector:
    def __new__(cls, model: _Path, tiling: str) -> Detector: ...
    def segment(
        self, image: NDArray[np.uint8], progress: _Progress
    ) -> tuple[NDArray[np.int32], list[tuple[int, float]]]: ...
    def outline(
        self, image: NDArray[np.uint8], boxes: list[list[float]], progress: _Progress
    ) -> tuple[NDArray[np.int32], list[tuple[int, float]]]: ...

def command(args: list[str]) -> int: ...
def run(
    project: _Path,
    out: _Path,
    parameters: str,
    force: bool,
    progress: _Progress,
    note: Optional[Callable[[str], Any]],
) -> None: ...
def simulate(out: _Path, parameters: str, force: bool, progress: _Progress) -> Path: ...
def fixed(results: _Path, stones: str, out: _Path) -> None:
    """Writes the table of ``stonewise datum`` as Parquet."""

def m3c2(
    points_1: NDArray[np.float64],
    points_2: NDArray[np.float64],
    core_points: NDArray[np.float64],
    normals: Optional[NDArray[np.float64]],
    viewpoints: Optional[NDArray[np.float64]],
    direction: list[float],
    normal_radius: float,
    cyl_radius: float,
    max_distance: float,
    registration_error: float,
    robust_aggr: bool,
    min_points: int,
    ddof: int,
    progress: _Progress,
) -> tuple[
    NDArray[np.float64],
    NDArray[np.float64],
    list[NDArray[np.float64]],
    list[NDArray[np.uint32]],
    NDArray[np.float64],
]: ...
def thin(points_1: NDArray[np.float64], spacing: float) -> NDArray[np.int64]: ...
def read_cameras(path: _Path) -> list[View]: ...
def transfer(
    cloud: NDArray[np.float64],
    views: list[View],
    labels: list[Optional[NDArray[np.uint32]]],
    parameters: str,
    progress: _Progress,
) -> tuple[NDArray[np.int32], NDArray[np.float32]]: ...
def adjust(
    points_1: NDArray[np.float64],
    labels_1: NDArray[np.uint32],
    points_2: NDArray[np.float64],
    labels_2: NDArray[np.uint32],
    viewpoints: Optional[NDArray[np.float64]],
    parameters: str,
    progress: _Progress,
) -> tuple[dict[str, tuple[Any, NDArray[np.bool_]]], dict[str, Any]]: ...

class Plan:
    """A plan whose folder nobody else may use while this object lives."""

    @property
    def json(self) -> str:
        """The plan as JSON."""

def plan(
    project: _Path,
    out: _Path,
    parameters: str,
    force: bool,
    progress: _Progress,
    note: Optional[Callable[[str], Any]],
) -> Plan: ...
def unit(out: _Path, unit: str, threads: int) -> None: ...
def loaded_from(file: _Path) -> None: ...
