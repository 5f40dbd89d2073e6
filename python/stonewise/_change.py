"""Comparison along normals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._points import optional_xyz, xyz
from ._progress import Progress, listener

_UNCERTAINTIES = np.dtype(
    [
        ("lodetection", "f8"),
        ("spread1", "f8"),
        ("num_samples1", "i8"),
        ("spread2", "f8"),
        ("num_samples2", "i8"),
    ]
)


@dataclass(frozen=True)
class Change:
    """What M3C2 finds at k core points. Unpacks into distances and uncertainties, as py4dgeo's result does."""

    distances: NDArray[np.float64]
    """(k,) metres along the normal, second epoch minus first; NaN where a cylinder is empty."""
    uncertainties: NDArray[np.void]
    """(k,) with py4dgeo's fields: ``lodetection`` (metres, 95 %), ``spread1``, ``spread2`` (metres: standard deviation, or interquartile
    range), ``num_samples1``, ``num_samples2``."""
    directions: NDArray[np.float64]
    """(k, 3) unit normals along which the distances are measured; NaN where the points show no plane."""
    corepoints: NDArray[np.float64]
    """(k, 3) metres."""

    @property
    def significant(self) -> NDArray[np.bool_]:
        """(k,) where a distance exceeds its detection limit."""
        return np.abs(self.distances) > self.uncertainties["lodetection"]

    def __iter__(self) -> Iterator[Any]:
        return iter((self.distances, self.uncertainties))


def m3c2(
    points_1: Any,
    points_2: Any,
    core_points: Any = None,
    *,
    cyl_radius: float = 0.05,
    normal_radius: float = 0.25,
    max_distance: float = 0.3,
    registration_error: float = 0.0,
    robust_aggr: bool = False,
    corepoint_normals: Optional[ArrayLike] = None,
    orientation_vector: ArrayLike = (0.0, 0.0, 1.0),
    viewpoints: Any = None,
    min_points: int = 5,
    ddof: int = 1,
    core_spacing: float = 0.05,
    progress: Union[bool, Progress] = False,
) -> Change:
    """Distances between two clouds along normals (M3C2, Lague et al. 2013).

    Names are those of py4dgeo's ``M3C2`` where the thing is the same. ``normal_radius`` is a single one, where py4dgeo chooses among
    ``normal_radii``.

    :param points_1: First epoch, (n, 3) metres.
    :param points_2: Second epoch, (m, 3) metres.
    :param core_points: Where to compare, (k, 3) metres; the first epoch thinned to ``core_spacing`` when absent.
    :param cyl_radius: Radius of the cylinder along the normal, metres.
    :param normal_radius: Radius of the neighbourhood whose plane gives the normal, metres.
    :param max_distance: How far the cylinder reaches to either side of the core point, metres.
    :param registration_error: Of the epochs, added in the detection limit, metres.
    :param robust_aggr: Median and interquartile range instead of mean and standard deviation.
    :param corepoint_normals: (k, 3) instead of normals that are fitted to the first epoch.
    :param orientation_vector: Direction to which fitted normals point.
    :param viewpoints: Instead of it: places that see the surface from outside, (v, 3) metres; the nearest counts.
    :param min_points: Fewer points in a cylinder give a distance but no detection limit.
    :param ddof: 1 divides the variance by n - 1, 0 by n.
    :param core_spacing: Edge of the voxels to which core points are thinned, metres.
    :param progress: As in :func:`run`.

    >>> import numpy as np
    >>> y, x = np.mgrid[0:1:0.02, 0:1:0.02]
    >>> before = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    >>> change = m3c2(before, before + [0.0, 0.0, 0.01], [[0.5, 0.5, 0.0]])
    >>> round(float(change.distances[0]), 6)
    0.01
    """
    first, second = xyz(points_1, "points_1"), xyz(points_2, "points_2")
    if core_points is None:
        core = first[_native.thin(first, core_spacing)]
    else:
        core = xyz(core_points, "core_points")
    direction = np.asarray(orientation_vector, dtype=np.float64).reshape(-1)
    with listener(progress) as told:
        distances, limits, spreads, counts, normals = _native.m3c2(
            first,
            second,
            core,
            optional_xyz(corepoint_normals, "corepoint_normals"),
            optional_xyz(viewpoints, "viewpoints"),
            direction.tolist(),
            normal_radius,
            cyl_radius,
            max_distance,
            registration_error,
            robust_aggr,
            min_points,
            ddof,
            told,
        )
    uncertainties = np.empty(len(core), dtype=_UNCERTAINTIES)
    uncertainties["lodetection"] = limits
    for epoch in (1, 2):
        uncertainties[f"spread{epoch}"] = spreads[epoch - 1]
        uncertainties[f"num_samples{epoch}"] = counts[epoch - 1]
    return Change(distances, uncertainties, normals, core)
