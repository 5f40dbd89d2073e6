"""From labels of photos to labels of points."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._parameters import to_json
from ._points import labels, xyz
from ._progress import Progress, listener


def read_cameras(path: Union[str, os.PathLike[str]]) -> list[_native.View]:
    """The posed photos of a camera file: Metashape XML, COLMAP folder, RealityCapture CSV and others.

    >>> views = stonewise.read_cameras("epoch1/cameras_metashape.xml")          # doctest: +SKIP
    """
    return _native.read_cameras(path)


def transfer(
    points: Any,
    views: Sequence[_native.View],
    label_images: Union[Sequence[Optional[ArrayLike]], Mapping[str, ArrayLike]],
    *,
    progress: Union[bool, Progress] = False,
    **parameters: Any,
) -> NDArray[np.int32]:
    """Stone of every point, from the label images of the photos that see it: the step ``label`` of a run.

    :param points: (n, 3) metres.
    :param views: The posed photos, as from :func:`read_cameras`.
    :param label_images: For each view an array (height, width) of whole numbers, 0 where there is no stone; ``None``, or no entry
        under the view's name in a mapping, for a photo that does not vote. Numbers of different photos have nothing to do with each other.
    :param progress: As in :func:`run`.
    :param parameters: Tables of the project file, here ``label={...}``.
    :returns: (n,) stone of each point, 0 for none, counted from 1.

    >>> labels = stonewise.transfer(points, views, label_images, label={"min_points": 50})     # doctest: +SKIP
    """
    if isinstance(label_images, Mapping):
        named: Mapping[str, Any] = label_images
        images: Sequence[Any] = [named.get(view.name) for view in views]
    else:
        images = list(label_images)
    arrays = [None if image is None else labels(image, "a label image", 2) for image in images]
    with listener(progress) as told:
        found, _ = _native.transfer(xyz(points), list(views), arrays, to_json(parameters), told)
    return found
