"""Arrow tables in the clothes that are at hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def dressed(table: pa.Table) -> Any:
    """The table as a pandas frame where pandas is installed (whole numbers that may be empty as ``Int64``), else as it is."""
    try:
        import pandas
    except ImportError:
        return table
    whole: dict[pa.DataType, Any] = {
        pa.uint8(): pandas.UInt8Dtype(),
        pa.uint16(): pandas.UInt16Dtype(),
        pa.uint32(): pandas.UInt32Dtype(),
        pa.int64(): pandas.Int64Dtype(),
    }
    return table.to_pandas(types_mapper=whole.get)


def reals(table: pa.Table, names: list[str]) -> NDArray[np.float64]:
    """Columns side by side, (rows, columns); NaN for empty cells."""
    columns = [np.asarray(table.column(name).to_numpy(zero_copy_only=False), dtype=np.float64) for name in names]
    return np.column_stack(columns) if columns else np.empty((table.num_rows, 0))


def displacement(table: pa.Table) -> NDArray[np.float64]:
    """(n, 3) of ``dx, dy, dz``."""
    return reals(table, ["dx", "dy", "dz"])


def covariance(table: pa.Table) -> NDArray[np.float64]:
    """(n, 3, 3) of ``cov_xx`` to ``cov_zz``."""
    xx, xy, xz, yy, yz, zz = reals(table, [f"cov_{c}" for c in ("xx", "xy", "xz", "yy", "yz", "zz")]).T
    return np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
