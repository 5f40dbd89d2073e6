"""The studio, as a program beside this one."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from types import TracebackType
from typing import Optional, Union

from ._native import Error

__all__ = ["Studio", "studio"]


class Studio:
    """A studio that runs until :meth:`close`, until the end of a ``with`` block, or until a minute after its last page was closed."""

    def __init__(self, process: subprocess.Popen[str], address: str) -> None:
        self._process = process
        self.address = address
        """What a browser opens."""

    def __repr__(self) -> str:
        return f"Studio({self.address!r})"

    def _repr_html_(self) -> str:
        return f'<a href="{self.address}" target="_blank" rel="noopener">{self.address}</a>'

    @property
    def is_running(self) -> bool:
        """Whether it still answers."""
        return self._process.poll() is None

    def close(self) -> None:
        """Ends it; corrections are kept."""
        self._process.terminate()
        self._process.communicate()

    def __enter__(self) -> Studio:
        return self

    def __exit__(
        self, kind: Optional[type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        self.close()


def studio(
    place: Union[str, os.PathLike[str]], *, port: Optional[int] = None, view: bool = False, browser: bool = True
) -> Studio:
    """Opens a folder of scans, a project or results in the studio, as ``stonewise studio PLACE`` does.

    :param place: The folder, project file or results.
    :param port: Port of the page; absent: any that is free.
    :param view: Only show.
    :param browser: Open the page in the browser of this machine.
    :raises Error: With the text of the command line.

    >>> with stonewise.studio("survey", browser=False) as page:          # doctest: +SKIP
    ...     print(page.address)
    """
    args = [sys.executable, "-m", "stonewise", "studio", "--quiet", os.fspath(place)]
    args += [] if port is None else ["--port", str(port)]
    args += [flag for flag, is_set in (("--view", view), ("--no-browser", not browser)) if is_set]
    # Quiet, it says its address and what ends it, which one pipe holds.
    process = subprocess.Popen(args, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    address = process.stdout.readline().strip() if process.stdout else ""
    if not address.startswith("http"):
        said = f"{address}\n{process.communicate()[0]}".strip().splitlines()
        raise Error(re.sub(r"^error: | \[[a-z-]+\]$", "", said[-1]) if said else "the studio did not start")
    return Studio(process, address)
