"""Stones in photos."""

from __future__ import annotations

import os
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._native import Error
from ._parameters import to_json
from ._progress import Progress, listener


class Detector:
    """Finds the stones of photos with Mask R-CNN.

    :param model: ``"built-in"``, or a file that ``stonewise train`` wrote.
    :param tiling: Keys of ``[segment.tiling]`` of the project file, such as ``min_score=0.6``.

    >>> import numpy as np
    >>> labels = Detector(scales=[1.0]).segment(np.zeros((64, 96, 3), np.uint8))
    >>> labels.shape, labels.dtype
    ((64, 96), dtype('int32'))
    """

    def __init__(self, model: Union[str, os.PathLike[str]] = "built-in", **tiling: Any) -> None:
        self._native = _native.Detector(model, to_json(tiling))

    def segment(self, image: Any, *, progress: Union[bool, Progress] = False) -> NDArray[np.int32]:
        """Stone of every pixel, (height, width), counted from 1; 0 where there is none.

        :param image: (height, width, 3) of ``uint8``, red, green, blue, or a picture of Pillow.
        :param progress: As in :func:`run`.
        """
        array = np.asarray(image)
        if array.ndim == 2:
            array = np.repeat(array[:, :, None], 3, axis=2)
        if array.ndim != 3 or array.shape[2] not in (3, 4) or array.dtype != np.uint8:
            raise Error(f"image must be (height, width, 3) of uint8, not {array.shape} of {array.dtype}")
        photo = np.ascontiguousarray(array[:, :, :3])
        with listener(progress) as told:
            found, _ = self._native.segment(photo, told)
        return found
