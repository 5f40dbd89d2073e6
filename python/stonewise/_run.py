"""The whole method."""

from __future__ import annotations

import os
import warnings
from typing import Any, Union

from . import _native, _results
from ._errors import Doubt
from ._parameters import to_json
from ._progress import Progress, listener, log


def run(
    project: Union[str, os.PathLike[str]],
    out: Union[str, os.PathLike[str]],
    *,
    progress: Union[bool, Progress] = False,
    force: bool = False,
    **parameters: Any,
) -> _results.Results:
    """Runs a project: from clouds and photos to results and a report, as ``stonewise run PROJECT --out OUT`` does, to the same bytes.

    What an earlier, interrupted run finished in ``out`` is taken over. Ctrl-C stops the run; the same call goes on from there.

    :param project: The project file, or the folder that holds ``stonewise.toml``.
    :param out: Folder of the results; made if need be.
    :param progress: ``True`` shows a bar (with tqdm installed, else lines on stderr); a function is called with the name of a piece of
        work, the units of it that are done, and all of them.
    :param force: Write into a folder that holds other things, and run a survey that cannot be right, as ``--force`` does.
    :param parameters: Tables of the project file with the keys that are to differ, as nested dictionaries; paths are relative to the
        project file.
    :raises Error: With the text of the command line.
    :raises KeyboardInterrupt: The run was stopped.

    Inputs that were left out, and doubts about the results as a whole (exit code 3 of the command line), are warnings of the category
    :class:`Doubt`, beside :attr:`Results.warnings`. The log goes to the logger ``stonewise``.

    >>> r = stonewise.run("survey/stonewise.toml", out="results", progress=True,
    ...                   registration={"estimator": "gicp"})           # doctest: +SKIP
    """
    with listener(progress) as told:
        _native.run(project, out, to_json(parameters), force, told, log.info)
    results = _results.open(out)
    warn_of_doubts(results, stacklevel=2)
    return results


def warn_of_doubts(results: _results.Results, stacklevel: int) -> None:
    """Says what the command line says with exit code 3; ``stacklevel``: of the caller's caller."""
    for warning in results.warnings:
        if warning.doubt or warning.skipped_input:
            warnings.warn(f"{warning.subject}: {warning.message}", Doubt, stacklevel=stacklevel + 1)
