"""Measures how a masonry dam moves, stone by stone, from point clouds and posed photos.

>>> import stonewise
>>> r = stonewise.run("survey/stonewise.toml", out="results")      # doctest: +SKIP
>>> r.displacement.shape                                           # doctest: +SKIP
(512, 3)

Lengths are metres, angles radians, everywhere. Points may be an (n, 3) array, what ``laspy.read`` returns, or a py4dgeo ``Epoch``.
"""

from . import _native as _compiled
from ._change import Change, m3c2
from ._detector import Detector
from ._errors import Doubt
from ._motion import Motion, adjust
from ._native import Error, View, __version__
from ._results import Pair, Results, Warning, open  # noqa: A004
from ._run import run
from ._simulate import simulate
from ._studio import Studio, studio
from ._transfer import read_cameras, transfer

# Before any work: steps are done again by another build of it.
_compiled.loaded_from(_compiled.__file__)

__all__ = [
    "Change",
    "Detector",
    "Doubt",
    "Error",
    "Motion",
    "Pair",
    "Results",
    "Studio",
    "View",
    "Warning",
    "__version__",
    "adjust",
    "m3c2",
    "open",
    "read_cameras",
    "run",
    "simulate",
    "studio",
    "transfer",
]
