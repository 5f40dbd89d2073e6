"""Points and labels of other libraries as arrays."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

from ._native import Error


def xyz(points: Any, what: str = "points") -> NDArray[np.float64]:
    """Positions (n, 3), metres: of an array, of laspy's ``LasData`` (``.xyz``) or of a py4dgeo ``Epoch`` (``.cloud``)."""
    for attribute in ("xyz", "cloud"):
        inner = getattr(points, attribute, None)
        if inner is not None:
            points = inner
            break
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise Error(f"{what} must have the shape (n, 3), not {array.shape}")
    return np.ascontiguousarray(array)


def optional_xyz(points: Any, what: str) -> Optional[NDArray[np.float64]]:
    """Positions as :func:`xyz` gives them; ``None`` for none."""
    return None if points is None else xyz(points, what)


def labels(values: Any, what: str, ndim: int) -> NDArray[np.uint32]:
    """Labels: whole numbers from 0 (none)."""
    array = np.asarray(values)
    if array.ndim != ndim:
        raise Error(f"{what} must have {ndim} dimension{'s' if ndim > 1 else ''}, not {array.ndim}")
    if array.dtype == np.bool_ or not np.issubdtype(array.dtype, np.integer):
        raise Error(f"{what} must be whole numbers, not {array.dtype}")
    if array.size and (array.min() < 0 or array.max() > np.iinfo(np.int32).max):
        raise Error(f"{what} must lie between 0 (none) and {np.iinfo(np.int32).max}")
    return np.ascontiguousarray(array, dtype=np.uint32)
