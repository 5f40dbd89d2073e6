"""The Snakefile of the documentation, on the small survey; skipped without Snakemake."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "src" / "units.md"
SNAKEMAKE = shutil.which("snakemake") or shutil.which("snakemake", path=Path(sys.executable).parent)


@pytest.mark.skipif(SNAKEMAKE is None, reason="snakemake is not installed")
def test_the_snakefile_of_the_page(command, survey, results, tmp_path):
    (snakefile,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    (tmp_path / "Snakefile").write_text(snakefile)
    command("run", "--plan", "--quiet", survey / "stonewise.toml", "--out", tmp_path / "results")
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    arguments = [str(SNAKEMAKE), "--cores", "2", "--config", "out=results"]
    done = subprocess.run(
        arguments, cwd=tmp_path, env={**os.environ, "PATH": programs}, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    for name in ["data/stones.parquet", "stones.csv", "data/m3c2.csv", "data/outlines.json", "data/epoch1/cloud_tls.laz"]:
        assert (tmp_path / "results" / name).read_bytes() == (results.path / name).read_bytes(), name
