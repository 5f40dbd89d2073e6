"""Progress as a function ``(what, done, total)``."""

from __future__ import annotations

import contextlib
import logging
import sys
from collections.abc import Callable, Iterator
from typing import Any, Optional, Union

Progress = Callable[[str, int, int], Any]
"""Called with the name of a piece of work, the units of it that are done, and all of them."""

log = logging.getLogger("stonewise")


class _Bar:
    """A bar of tqdm for each piece of work."""

    def __init__(self, tqdm: Any) -> None:
        self._tqdm = tqdm
        self._bar: Any = None
        self._what: Optional[str] = None

    def __call__(self, what: str, done: int, total: int) -> None:
        if self._bar is None or what != self._what or done < self._bar.n:
            self.close()
            self._what = what
            self._bar = self._tqdm(total=total, desc=what, leave=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


class _Lines:
    """A line on stderr for each piece of work."""

    def __init__(self) -> None:
        self._what: Optional[str] = None

    def __call__(self, what: str, done: int, total: int) -> None:
        if what != self._what:
            self._what = what
            print(what, file=sys.stderr)

    def close(self) -> None:
        pass


@contextlib.contextmanager
def listener(progress: Union[bool, Progress, None]) -> Iterator[Optional[Progress]]:
    """The function to call: the caller's own, a bar for ``True``, none for ``False``."""
    if callable(progress):
        yield progress
        return
    if not progress:
        yield None
        return
    shown: Any
    try:
        from tqdm.auto import tqdm

        shown = _Bar(tqdm)
    except ImportError:
        shown = _Lines()
    try:
        yield shown
    finally:
        shown.close()
