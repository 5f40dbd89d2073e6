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

    :param model: ``"built-in"``, or a file that ``stonewise detector train`` wrote.
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
        with listener(progress) as told:
            found, _ = self._native.segment(_photo(image), told)
        return found

    def outline(self, image: Any, boxes: Any, *, progress: Union[bool, Progress] = False) -> NDArray[np.int32]:
        """Labels of the stones in given boxes, (height, width): 1 for the stone of the first box, and so on.

        The mask head of the detector outlines the stones; the boxes come from a person or another detector.
        Where masks overlap, the smaller one is on top.

        :param image: As in :meth:`segment`.
        :param boxes: (n, 4): left, top, right, bottom, pixels.
        :param progress: As in :func:`run`.

        >>> import numpy as np
        >>> bool(Detector().outline(np.zeros((64, 96, 3), np.uint8), np.empty((0, 4))).any())
        False
        """
        corners = np.asarray(boxes, np.float64)
        is_box = corners.ndim == 2 and corners.shape[1] == 4 and np.isfinite(corners).all()
        if not is_box or (corners[:, 2:] <= corners[:, :2]).any():
            raise Error("boxes must be (n, 4): left < right and top < bottom, as left, top, right, bottom")
        with listener(progress) as told:
            found, _ = self._native.outline(_photo(image), corners.tolist(), told)
        return found


def _photo(image: Any) -> NDArray[np.uint8]:
    """Red, green, blue of an image that a caller gave."""
    array = np.asarray(image)
    if array.ndim == 2:
        array = np.repeat(array[:, :, None], 3, axis=2)
    if array.ndim != 3 or array.shape[2] not in (3, 4) or array.dtype != np.uint8:
        raise Error(f"image must be (height, width, 3) of uint8, not {array.shape} of {array.dtype}")
    return np.ascontiguousarray(array[:, :, :3])
