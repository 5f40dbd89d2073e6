"""The motion of stones between two labelled clouds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from . import _native, _tables
from ._parameters import to_json
from ._points import labels, optional_xyz, xyz
from ._progress import Progress, listener


@dataclass(frozen=True)
class Motion:
    """What became of the n stones of the first cloud."""

    stones_arrow: pa.Table
    """One row for each stone of the first cloud, with the columns of ``stones.parquet`` but those that need photos or the unrolled wall."""
    summary: dict[str, Any]
    """What the adjustment says about itself: ``converged``, ``iterations``, ``noise_m`` of the points of either epoch, ``common_motion_m``
    of the stones that are not loose, and ``common_motion_covariance_m2``."""

    @property
    def stones(self) -> Any:
        """The table as a pandas frame where pandas is installed, else an Arrow table."""
        return _tables.dressed(self.stones_arrow)

    @property
    def displacement(self) -> NDArray[np.float64]:
        """(n, 3) metres, world; NaN where a stone was not measured."""
        return _tables.displacement(self.stones_arrow)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(n, 3, 3) m^2, of the motion against the common rigid motion of the measured stones; NaN where a stone was not measured."""
        return _tables.covariance(self.stones_arrow)


def adjust(
    points_1: Any,
    labels_1: ArrayLike,
    points_2: Any,
    labels_2: ArrayLike,
    *,
    viewpoints: Any = None,
    progress: Union[bool, Progress] = False,
    **parameters: Any,
) -> Motion:
    """Finds the stones of the first cloud in the second, and measures the motion of all of them together: the steps ``match`` and
    ``register`` of a run in which nothing is known about the registration of the epochs.

    :param points_1: First epoch, (n, 3) metres.
    :param labels_1: Stone of each of its points, (n,) whole numbers, 0 for none, as from :func:`transfer`.
    :param points_2: Second epoch, (m, 3) metres.
    :param labels_2: Stone of each of its points, (m,). The numbers of the epochs have nothing to do with each other.
    :param viewpoints: Places that see the wall from outside, (v, 3) metres, as the centres of cameras; the normals of the stones point
        there. When absent, to one side of the plane of all points: enough for a wall that does not turn back.
    :param progress: As in :func:`run`.
    :param parameters: Tables of the project file: ``stones``, ``match``, ``registration={"border_noises": ..., "adjustment": {...}}``.

    >>> motion = stonewise.adjust(points_1, labels_1, points_2, labels_2)              # doctest: +SKIP
    """
    with listener(progress) as told:
        columns, summary = _native.adjust(
            xyz(points_1, "points_1"),
            labels(labels_1, "labels_1", 1),
            xyz(points_2, "points_2"),
            labels(labels_2, "labels_2", 1),
            optional_xyz(viewpoints, "viewpoints"),
            to_json(parameters),
            told,
        )
    arrays = {name: pa.array(values, mask=~filled) for name, (values, filled) in columns.items()}
    return Motion(pa.table(arrays), summary)
