"""The types that the module declares, against its code (mypy) and against what was compiled (stubtest)."""

import subprocess
import sys
from pathlib import Path

import pytest
import stonewise

pytest.importorskip("mypy")
PYPROJECT = Path(__file__).parents[2] / "pyproject.toml"


@pytest.mark.parametrize(
    "words",
    [
        ["mypy", "--config-file", str(PYPROJECT), str(Path(stonewise.__file__).parent)],
        ["mypy.stubtest", "--mypy-config-file", str(PYPROJECT), "stonewise._native"],
    ],
    ids=["code", "compiled"],
)
def test_declared_types_hold(words, tmp_path):
    done = subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
