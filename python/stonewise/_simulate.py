"""Simulated surveys."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Union

from . import _native
from ._parameters import to_json
from ._progress import Progress, listener


def simulate(
    out: Union[str, os.PathLike[str]],
    *,
    progress: Union[bool, Progress] = False,
    force: bool = False,
    **parameters: Any,
) -> Path:
    """Simulates a survey of a wall with known motion, as ``stonewise test simulate --params FILE --out OUT`` does, to the same bytes.

    :param out: Folder of the survey; made if need be.
    :param progress: As for :func:`run`.
    :param force: Write into a folder that holds other things.
    :param parameters: Keys of the file of parameters, tables as nested dictionaries; those not named keep their defaults, which
        ``simulation.toml`` in the folder of any simulated survey shows.
    :returns: The project file. The true motion of every stone is in ``truth/stones.csv`` beside it.
    :raises Error: With the text of the command line.

    >>> project = stonewise.simulate("wall", scene={"wall": {"width_m": 2.0, "height_m": 1.5}})     # doctest: +SKIP
    """
    with listener(progress) as told:
        return _native.simulate(out, to_json(parameters), force, told)
