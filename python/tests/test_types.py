"""The types that the module declares, against its code."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")
ROOT = Path(__file__).parents[2]


def test_declared_types_hold(tmp_path):
    words = ["mypy", "--config-file", str(ROOT / "pyproject.toml"), str(ROOT / "python/stonewise")]
    done = subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
