"""stonewise as a tool of geodispbench3d, which compares programs on known displacements of points.

``integrations/geodispbench3d/README.md`` has the files of a suite. A prediction is the motion of the stone nearest to a
point; the interval that belongs to it goes along, so that :func:`interval_coverage` can be counted beside the benchmark's own metrics, which need none.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Union

import numpy as np
from geodispbench3d.tool.base import ToolAdapter, TrialOutputs, TrialRequest, TrialResult
from numpy.typing import NDArray

from ._native import Error
from ._results import Results
from ._results import open as open_results
from ._run import run

__all__ = ["Adapter", "interval_coverage", "m3c2_motions", "stone_motions", "write_truth"]

CHI2_95_3 = 7.814727903251179
"""95 % quantile of chi-square with three degrees of freedom."""
MAX_DISTANCE_M = 0.3
"""Farthest that the middle of a stone may be from a point that it speaks for."""


class Adapter(ToolAdapter):
    """Runs a project for each trial; parameters of a trial are keys of the project file, such as ``match.max_ratio``.

    :param project: The project file.
    :param runs: Folder of the results, one folder below it for each set of parameters; an earlier run of the same is taken over.
    """

    id = "stonewise"
    in_process_safe = True

    def __init__(self, project: str, runs: str) -> None:
        self._project = Path(project)
        self._runs = Path(runs)

    def run_trial(self, request: TrialRequest) -> TrialResult:
        """Runs the project."""
        parameters = dict(request.parameters)
        name = hashlib.sha256(json.dumps(parameters, sort_keys=True).encode()).hexdigest()[:12]
        out = self._runs / name
        start = time.perf_counter()
        error = None
        try:
            run(self._project, out, **nested(parameters))
        except Error as failed:
            error = str(failed)
        duration = time.perf_counter() - start
        return TrialResult(
            outputs=TrialOutputs(run_dir=out, predictions=(out / "data" / "stones.parquet",)),
            scalar_metrics={"runtime_seconds": duration},
            duration_seconds=duration,
            success=error is None,
            error=error,
            error_kind=None if error is None else "nonzero_exit",
        )


def nested(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Keys with dots as tables in tables.

    >>> nested({"match.max_ratio": 0.5, "match.min_area_ratio": 0.6})
    {'match': {'max_ratio': 0.5, 'min_area_ratio': 0.6}}
    """
    tables: dict[str, Any] = {}
    for key, value in parameters.items():
        *path, last = key.split(".")
        table = tables
        for part in path:
            table = table.setdefault(part, {})
        table[last] = value
    return tables


def stone_motions(*, outputs: TrialOutputs, ground_truth: Iterable[Any], options: Mapping[str, Any], **_: Any) -> dict[str, Any]:
    """The motion of the measured stone nearest to each point, with its covariance.

    Option ``max_distance_m``: farthest that the stone's middle may be; beyond, there is no prediction.
    """
    results = open_results(outputs.run_dir)
    places = _columns(results, ["x", "y", "z"])
    return _nearest(places, results.displacement, results.covariance, ground_truth, options)


def m3c2_motions(*, outputs: TrialOutputs, ground_truth: Iterable[Any], options: Mapping[str, Any], **_: Any) -> dict[str, Any]:
    """The motion by M3C2, which the run computes beside the stones: the distance of the core point nearest to each point, along its normal.

    It has no covariance.
    """
    with (Path(outputs.run_dir) / "data" / "m3c2.csv").open(newline="", encoding="utf-8") as file:
        names = ("x", "y", "z", "NormalX", "NormalY", "NormalZ", "m3c2_distance")
        rows = [[float(row[name] or "nan") for name in names] for row in csv.DictReader(file)]
    table = np.array(rows, dtype=np.float64).reshape(-1, len(names))
    places, normals, distances = table[:, :3], table[:, 3:6], table[:, 6:]
    motions = distances * normals
    return _nearest(places, motions, None, ground_truth, options)


def interval_coverage(*, prediction: Mapping[str, Any], ground_truth: Iterable[Any], **_: Any) -> float:
    """Share of the predictions whose 95 % ellipsoid holds the true displacement; NaN without covariances. 0.95 is right: less says that a
    tool's uncertainty is too small, more that it is too large."""
    truth = {point.label: point.movement_vector for point in ground_truth}
    held = []
    for point in prediction.get("per_point", []):
        covariance = np.asarray(point.get("covariance", np.nan), dtype=float)
        miss = np.asarray(point["vector"], dtype=float) - truth.get(point["label"], np.nan)
        if covariance.shape == (3, 3) and np.isfinite(covariance).all() and np.isfinite(miss).all():
            held.append(miss @ np.linalg.solve(covariance, miss) <= CHI2_95_3)
    return float(np.mean(held)) if held else float("nan")


def write_truth(survey: Union[str, os.PathLike[str]], path: Union[str, os.PathLike[str]]) -> int:
    """Writes the true motions of a simulated survey as ``point_displacements``, one point in the middle of each stone; returns how many."""
    with (Path(survey) / "truth" / "stones.csv").open(newline="", encoding="utf-8") as file:
        stones = list(csv.DictReader(file))
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["label", "x1", "y1", "z1", "x2", "y2", "z2"])
        for stone in stones:
            first = [float(stone[name]) for name in ("cx", "cy", "cz")]
            moved = [place + float(stone[name]) for place, name in zip(first, ("dx", "dy", "dz"))]
            rows.writerow([stone["stone_id"], *first, *moved])
    return len(stones)


def _columns(results: Results, names: list[str]) -> NDArray[np.float64]:
    return np.column_stack([results.stones_arrow[name].to_numpy() for name in names])


def _nearest(
    places: NDArray[np.float64],
    motions: NDArray[np.float64],
    covariances: Any,
    ground_truth: Iterable[Any],
    options: Mapping[str, Any],
) -> dict[str, Any]:
    farthest = float(options.get("max_distance_m", MAX_DISTANCE_M))
    measured = np.flatnonzero(np.isfinite(motions).all(axis=1))
    per_point = []
    for point in ground_truth:
        found: dict[str, Any] = {"label": point.label, "vector": [float("nan")] * 3}
        if measured.size:
            distances = np.linalg.norm(places[measured] - point.xyz_epoch1, axis=1)
            nearest = measured[distances.argmin()]
            if distances.min() <= farthest:
                found["vector"] = motions[nearest].tolist()
                if covariances is not None:
                    found["covariance"] = covariances[nearest].tolist()
        per_point.append(found)
    return {"per_point": per_point}
