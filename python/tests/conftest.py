"""A small simulated survey, made by the command, and its results."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import stonewise

# A wall of a few dozen stones, as in the tests of the command.
SURVEY = """
name = "Test wall"
[scene]
seed = 3
[scene.wall]
width_m = 1.6
height_m = 1.0
seed = 3
[scene.tls]
spacing_m = 0.008
[photos]
columns = 2
rows = 1
width = 800
height = 600
focal_px = 1100.0
distance_m = 5.0
"""

Command = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def command() -> Command:
    """Runs the command that was installed with the module."""
    program = Path(sys.executable).with_name("stonewise")

    def run(*args: object, expect: int | None = 0) -> subprocess.CompletedProcess[str]:
        done = subprocess.run([str(program), *map(str, args)], capture_output=True, text=True, timeout=600)
        assert expect is None or done.returncode == expect, done.stderr
        return done

    return run


@pytest.fixture(scope="session")
def survey(command: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("survey")
    (folder / "params.toml").write_text(SURVEY)
    command("test", "simulate", "--quiet", "--params", folder / "params.toml", "--out", folder / "survey")
    return folder / "survey"


@pytest.fixture(scope="session")
def results(survey: Path, tmp_path_factory: pytest.TempPathFactory) -> stonewise.Results:
    return stonewise.run(survey / "stonewise.toml", out=tmp_path_factory.mktemp("results") / "out")
