"""Runs on a cluster of machines, with Ray: ``pip install "stonewise[ray]"``.

A run is cut into units of work, as ``stonewise run --plan`` prints them: steps, and single photos. Each unit is a task of Ray. Tasks get paths;
points and photos go through the results folder, which all machines must see under the same path, as they must the survey. What is done is
noted in that folder: whatever dies, the same call goes on from there, with or without Ray. Results have the same bytes as those of
:func:`stonewise.run`.

>>> import stonewise.ray                                                       # doctest: +SKIP
>>> r = stonewise.ray.run("survey/stonewise.toml", out="/shared/results", address="auto")      # doctest: +SKIP
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Optional, Union

import ray

from . import _native, _results
from ._parameters import to_json
from ._progress import Progress, listener, log
from ._run import warn_of_doubts

__all__ = ["run", "run_many"]

_Path = Union[str, os.PathLike[str]]


def run(
    project: _Path,
    out: _Path,
    *,
    address: Optional[str] = None,
    retries: int = 3,
    progress: Union[bool, Progress] = False,
    force: bool = False,
    **parameters: Any,
) -> _results.Results:
    """Runs a project on a cluster.

    :param project: The project file, or the folder that holds ``stonewise.toml``; all machines must see it under this path.
    :param out: Folder of the results, on a file system that all machines share.
    :param address: Of the cluster, as ``ray.init`` takes it: ``"auto"`` for the one that this machine belongs to; absent: one on this
        machine, for this call, unless Ray is connected already.
    :param retries: How often a unit is done again whose worker or machine died.
    :param progress: As in :func:`stonewise.run`; the work is counted in units.
    :param force: As in :func:`stonewise.run`.
    :param parameters: As in :func:`stonewise.run`.
    :raises Error: With the text of the command line.

    Every machine must have the same build of stonewise.
    """
    jobs = [(project, out)]
    return run_many(
        jobs,
        address=address,
        retries=retries,
        progress=progress,
        force=force,
        **parameters,
    )[0]


def run_many(
    jobs: Iterable[tuple[_Path, _Path]],
    *,
    address: Optional[str] = None,
    retries: int = 3,
    progress: Union[bool, Progress] = False,
    force: bool = False,
    **parameters: Any,
) -> list[_results.Results]:
    """Runs many projects at once on a cluster; arguments as for :func:`run`, results in the order of ``jobs``.

    A project that fails does not stop the others.

    :param jobs: Pairs of a project and the folder of its results.
    :raises Error: Once all others are done, if a project failed; the text names every one that did.

    >>> dams = ["ennepe", "brucher"]
    >>> stonewise.ray.run_many((f"{d}/stonewise.toml", f"/shared/{d}") for d in dams)      # doctest: +SKIP
    """
    if "batch_points" in parameters:
        raise _native.Error("batch_points: a unit is a whole step or one photo now: leave it out")
    pairs = [(os.path.abspath(project), os.path.abspath(out)) for project, out in jobs]
    is_ours = not ray.is_initialized()
    if is_ours and address is None:
        # Ray left to itself joins whatever cluster it finds on this machine.
        ray.init(address="local", include_dashboard=False, log_to_driver=False)
    elif is_ours:
        ray.init(address=address, log_to_driver=False)
    try:
        with listener(progress) as told:
            errors = _Cluster(retries).do(pairs, to_json(parameters), force, told)
    finally:
        if is_ours:
            ray.shutdown()
    if errors:
        raise _native.Error("\n".join(errors[out] if len(pairs) == 1 else f"{out}: {errors[out]}" for out in sorted(errors)))
    results = [_results.open(out) for _, out in pairs]
    for result in results:
        warn_of_doubts(result, stacklevel=3)
    return results


def _do(out: str, unit: str, threads: int, *before: Optional[str]) -> Optional[str]:
    """Does a unit after those before it; the text of what went wrong, there or here."""
    for error in before:
        if error is not None:
            return error
    try:
        _native.unit(out, unit, threads)
    except _native.Error as error:
        return str(error)
    return None


@dataclass
class _Cluster:
    """What the machines have, and the tasks that they got."""

    retries: int
    cores: float = 1.0
    memory: float = 0.0
    task: Any = None
    waiting: dict[Any, tuple[str, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        machines = [node["Resources"] for node in ray.nodes() if node["Alive"]]

        def most(what: str) -> float:
            return max((float(m.get(what, 0.0)) for m in machines), default=0.0)

        self.cores, self.memory = max(most("CPU"), 1.0), most("memory")
        self.task = ray.remote(_do)

    def do(
        self,
        pairs: list[tuple[str, str]],
        parameters: str,
        force: bool,
        told: Optional[Progress],
    ) -> dict[str, str]:
        """Does all units of all projects; what went wrong, by folder of results."""
        errors: dict[str, str] = {}
        # They hold the folders until all is done.
        plans = []
        try:
            for project, out in pairs:
                try:
                    plans.append(_native.plan(project, out, parameters, force, None, log.info))
                    self._submit(out, json.loads(plans[-1].json)["units"])
                except _native.Error as error:
                    errors[out] = str(error)
            self._wait(errors, told)
        finally:
            for reference in self.waiting:
                ray.cancel(reference, force=True)
        return errors

    def _submit(self, out: str, units: list[dict[str, Any]]) -> None:
        references: dict[str, Any] = {}
        for unit in units:
            if unit["done"]:
                continue
            cores = min(float(unit["cores"]), self.cores)
            options: dict[str, Any] = {
                "name": f"stonewise {unit['id']}",
                "num_cpus": cores,
                # A machine without as much memory may still do it: the numbers are estimates.
                "memory": min(float(unit["memory_bytes"]), self.memory),
                "max_retries": self.retries,
            }
            before = [references[need] for need in unit["needs"] if need in references]
            reference = self.task.options(**options).remote(out, unit["id"], int(cores), *before)
            references[unit["id"]] = reference
            self.waiting[reference] = (out, unit["id"])

    def _wait(self, errors: dict[str, str], told: Optional[Progress]) -> None:
        total = len(self.waiting)
        if told:
            told("units", 0, total)
        while self.waiting:
            ready, _ = ray.wait(list(self.waiting), num_returns=1)
            for reference in ready:
                out, unit = self.waiting.pop(reference)
                error = _outcome(reference)
                if error is not None:
                    errors.setdefault(out, error)
                log.info("%s: %s", out, unit)
            if told:
                told("units", total - len(self.waiting), total)


def _outcome(reference: Any) -> Optional[str]:
    """What went wrong with a unit; more often than it is repeated, its worker may have died."""
    try:
        error: Optional[str] = ray.get(reference)
        return error
    except ray.exceptions.RayError as died:
        return str(died)
