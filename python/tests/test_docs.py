"""The examples of the documentation."""

from __future__ import annotations

import doctest
import importlib
import json
import os
import pkgutil
import re
from pathlib import Path

import pytest

import stonewise

PAGE = Path(__file__).parents[2] / "docs" / "src" / "python.md"


@pytest.mark.parametrize("name", [m.name for m in pkgutil.iter_modules(stonewise.__path__) if m.name not in ("_native", "__main__")])
def test_docstrings(name):
    if name == "ray":
        pytest.importorskip("ray")
    failed, _ = doctest.testmod(importlib.import_module(f"stonewise.{name}"), optionflags=doctest.ELLIPSIS)
    assert failed == 0


def test_everything_public_is_described():
    for name in stonewise.__all__:
        assert name.startswith("__") or getattr(stonewise, name).__doc__, name
        assert name.startswith("__") or f"{name}" in PAGE.read_text() or name in ("Change", "Motion", "Pair", "Results", "Warning"), name


def test_the_page(survey, tmp_path, monkeypatch):
    """All examples of the page, in its order, on the small survey."""
    pytest.importorskip("laspy")
    pytest.importorskip("PIL.Image")
    (tmp_path / "survey").symlink_to(survey)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    examples = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    assert len(examples) >= 5
    for example in examples:
        exec(compile(example, str(PAGE), "exec"), names)
    assert os.path.isfile("results/stones.parquet")
    assert (names["stones"][0] > 0).any()


RECIPES = PAGE.with_name("recipes.md").read_text()


@pytest.mark.parametrize("recipe", re.findall(r"^```python\n(.*?)^```", RECIPES, re.DOTALL | re.MULTILINE))
def test_recipes(recipe, results, tmp_path, monkeypatch):
    for module in re.findall(r"^import (\w+)", recipe, re.MULTILINE):
        pytest.importorskip(module)
    if "geopandas" in recipe:
        pytest.importorskip("matplotlib").use("agg")
    (tmp_path / "results").symlink_to(Path(results.report).parents[1])
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(recipe, "recipes.md", "exec"), names)
    assert "axes" not in names or os.path.getsize("stones.png") > 5_000
    # The stones that moved farthest, as the table's own columns say.
    if "farthest" in names:
        lengths = dict(zip(*(results.stones_arrow[c].to_pylist() for c in ("stone_id", "length_m"))))
        lengths = {stone: length for stone, length in lengths.items() if length is not None}
        assert [row[0] for row in names["farthest"].fetchall()] == sorted(lengths, key=lengths.get, reverse=True)[:5]
    if "epoch" in names:
        measured = [stone for stone in results.displacement.tolist() if stone[0] == stone[0]]
        assert names["epoch"].additional_dimensions["dx"].tolist() == [stone[0] for stone in measured]


def test_the_notebook(tmp_path, monkeypatch):
    """All cells of the notebook, in its order."""
    pytest.importorskip("geopandas")
    pytest.importorskip("matplotlib").use("agg")
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((PAGE.parent / "two-clouds-to-a-map.ipynb").read_text())
    names: dict[str, object] = {}
    for number, cell in enumerate(notebook["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
    assert os.path.getsize("map.png") > 10_000
