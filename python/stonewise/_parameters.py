"""Parameters on their way into the program."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any


def to_json(parameters: Mapping[str, Any]) -> str:
    """JSON of nested parameters; paths become text, numpy's numbers and arrays become numbers and lists."""
    return json.dumps(parameters, default=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"a parameter cannot be a {type(value).__name__}")
