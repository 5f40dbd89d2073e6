"""Runs on a cluster of Ray on this machine: the same bytes as one machine, whatever dies."""

from __future__ import annotations

import os
import random
import signal
import threading
from pathlib import Path

import pytest

import stonewise

ray = pytest.importorskip("ray", reason="ray is not installed")

from ray.cluster_utils import Cluster  # noqa: E402

import stonewise.ray  # noqa: E402


def contents(out: Path) -> dict[str, bytes]:
    """Result files but for those that hold times."""
    but = {"work", "run.json", "digests.b3", "report.html"}
    files = (p for p in out.rglob("*") if p.is_file() and not {p.relative_to(out).parts[0], p.name} & but)
    return {str(p.relative_to(out)): p.read_bytes() for p in files}


@pytest.fixture(scope="module")
def tiled(survey) -> Path:
    """The survey in several tiles."""
    project = survey / "tiled.toml"
    project.write_text((survey / "stonewise.toml").read_text() + "\n[ingest]\nsize_m = 0.5\n")
    return project


@pytest.fixture(scope="module")
def expected(tiled, tmp_path_factory) -> dict[str, bytes]:
    return contents(stonewise.run(tiled, out=tmp_path_factory.mktemp("one") / "out").path)


@pytest.fixture(scope="module")
def cluster():
    """Two machines of one core each."""
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    ray.init(address=cluster.address, log_to_driver=False)
    yield cluster
    ray.shutdown()
    cluster.shutdown()


def our_workers() -> list[int]:
    """Processes below this one in which Ray does a unit."""
    parents: dict[int, int] = {}
    titles: dict[int, str] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                stat = (entry / "stat").read_text().rpartition(") ")[2].split()
                titles[int(entry.name)] = (entry / "cmdline").read_text()
                parents[int(entry.name)] = int(stat[1])
            except OSError:
                continue

    def is_below(process: int) -> bool:
        while process in parents:
            process = parents[process]
            if process == os.getpid():
                return True
        return False

    return [p for p, title in titles.items() if title.startswith("ray::stonewise ") and is_below(p)]


def test_a_cluster_makes_the_bytes_of_one_machine(cluster, tiled, expected, tmp_path):
    told = []
    r = stonewise.ray.run(tiled, out=tmp_path / "out", progress=lambda *args: told.append(args))
    assert contents(r.path) == expected
    assert told[0][:2] == ("units", 0) and told[-1][1] == told[-1][2] > 10
    again = stonewise.ray.run(tiled, out=tmp_path / "out")
    assert contents(again.path) == expected


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="workers are found in /proc")
def test_workers_that_are_killed_and_a_machine_that_is_lost_change_nothing(cluster, tiled, expected, tmp_path):
    dice, killed, ended = random.Random(3), [], threading.Event()

    def kill() -> None:
        while not ended.wait(dice.uniform(0.1, 0.5)):
            workers = our_workers()
            if workers and len(killed) < 8:
                worker = dice.choice(workers)
                try:
                    os.kill(worker, signal.SIGKILL)
                    killed.append(worker)
                except ProcessLookupError:
                    continue

    killer = threading.Thread(target=kill)
    machine = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    killer.start()
    remover = threading.Timer(3.0, lambda: cluster.remove_node(machine, allow_graceful=False))
    remover.start()
    try:
        r = stonewise.ray.run(tiled, out=tmp_path / "out", retries=20)
    finally:
        ended.set()
        killer.join()
        remover.join()
    assert len(killed) >= 3
    assert contents(r.path) == expected


def test_many_projects_and_one_that_fails(cluster, tiled, survey, expected, tmp_path):
    wrong = survey / "wrong_in_ray.toml"
    wrong.write_text(tiled.read_text().replace("size_m = 0.5", "size_n = 0.5"))
    jobs = [(wrong, tmp_path / "b"), (tiled, tmp_path / "a")]
    with pytest.raises(stonewise.Error, match="size_n") as raised:
        stonewise.ray.run_many(jobs)
    assert str(tmp_path / "b") in str(raised.value) and str(tmp_path / "a") not in str(raised.value)
    assert contents(tmp_path / "a") == expected


def test_a_folder_in_use_is_left_alone(cluster, tiled, tmp_path):
    holding = stonewise._native.plan(tiled, tmp_path / "out", "{}", False, None, None)
    with pytest.raises(stonewise.Error, match="another run works in this folder"):
        stonewise.ray.run(tiled, out=tmp_path / "out")
    assert holding.json
