"""The command ``stonewise``: the same program as the one that cargo builds."""

from __future__ import annotations

import signal
import sys


def main() -> None:
    """Runs the command of the arguments and ends with its exit code."""
    # Until the work listens for Ctrl-C itself, it ends the program as always; the handler of Python would only take a note.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from ._native import command

    sys.exit(command(["stonewise", *sys.argv[1:]]))
