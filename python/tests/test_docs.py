"""The examples of the documentation."""

from __future__ import annotations

import csv
import doctest
import importlib
import json
import os
import pkgutil
import re
from pathlib import Path

import numpy as np
import pytest

import stonewise

PAGE = Path(__file__).parents[2] / "docs" / "src" / "python.md"
EXAMPLES, RECIPES = PAGE.read_text().split("## In other programs\n")


@pytest.mark.parametrize("name", [m.name for m in pkgutil.iter_modules(stonewise.__path__) if m.name not in ("_native", "__main__")])
def test_docstrings(name):
    if name in ("ray", "geodispbench3d"):
        pytest.importorskip(name)
    failed, _ = doctest.testmod(importlib.import_module(f"stonewise.{name}"), optionflags=doctest.ELLIPSIS)
    assert failed == 0


def test_everything_public_is_described():
    for name in stonewise.__all__:
        assert name.startswith("__") or getattr(stonewise, name).__doc__, name
        assert name.startswith("__") or f"{name}" in PAGE.read_text() or name in ("Change", "Motion", "Pair", "Results", "Studio", "Warning"), name


def test_the_page(survey, tmp_path, monkeypatch):
    """All examples of the page, in its order, on the small survey."""
    pytest.importorskip("laspy")
    pytest.importorskip("PIL.Image")
    (tmp_path / "survey").symlink_to(survey)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    examples = re.findall(r"^```python\n(.*?)^```", EXAMPLES, re.DOTALL | re.MULTILINE)
    assert len(examples) >= 5
    for example in examples:
        exec(compile(example, str(PAGE), "exec"), names)
    assert os.path.isfile("results/data/stones.parquet")
    assert (names["stones"][0] > 0).any()


@pytest.mark.parametrize("recipe", re.findall(r"^```python\n(.*?)^```", RECIPES, re.DOTALL | re.MULTILINE))
def test_recipes(recipe, results, tmp_path, monkeypatch):
    for module in re.findall(r"^import (\w+)", recipe, re.MULTILINE):
        pytest.importorskip(module)
    if "geopandas" in recipe:
        pytest.importorskip("matplotlib").use("agg")
    (tmp_path / "results").symlink_to(Path(results.report).parents[1])
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(recipe, str(PAGE), "exec"), names)
    assert "axes" not in names or os.path.getsize("stones.png") > 5_000
    # The stones that moved farthest, as the table's own columns say.
    if "farthest" in names:
        lengths = dict(zip(*(results.stones_arrow[c].to_pylist() for c in ("stone_id", "length_m"))))
        lengths = {stone: length for stone, length in lengths.items() if length is not None}
        assert [row[0] for row in names["farthest"].fetchall()] == sorted(lengths, key=lengths.get, reverse=True)[:5]
    # A cube has the cells of the table.
    if "cube" in names:
        assert dict(names["cube"].sizes) == {"stone_id": results.displacement.shape[0], "epoch": 1}
        assert np.array_equal(names["cube"]["dx"].to_numpy()[:, 0], results.displacement[:, 0], equal_nan=True)
    if "epoch" in names:
        measured = [stone for stone in results.displacement.tolist() if stone[0] == stone[0]]
        assert names["epoch"].additional_dimensions["dx"].tolist() == [stone[0] for stone in measured]


def cells_of(notebook, tmp_path, monkeypatch, **replaced):
    """Names after all cells of a notebook, in its order; ``replaced``: values of names that a cell sets on a line of its own."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for number, cell in enumerate(json.loads((PAGE.parent / notebook).read_text())["cells"]):
        if cell["cell_type"] == "code":
            source = "".join(cell["source"])
            for name, value in replaced.items():
                source = re.sub(rf"^{name} = .*$", f"{name} = {value}", source, flags=re.MULTILINE)
            exec(compile(source, f"{notebook}, cell {number}", "exec"), names)
    assert all(names[name] == value for name, value in replaced.items())
    return names


def true_motions(survey):
    """The motion of every stone of a simulated survey, out of the wall along x, metres, by its place (y, z)."""
    with open(survey / "truth" / "stones.csv", newline="") as file:
        return {(float(row["cy"]), float(row["cz"])): float(row["dx"]) for row in csv.DictReader(file)}


def nearest(places, y, z):
    return min(places, key=lambda place: (place[0] - y) ** 2 + (place[1] - z) ** 2)


def test_the_notebook_of_two_clouds(tmp_path, monkeypatch):
    pytest.importorskip("geopandas")
    pytest.importorskip("matplotlib").use("agg")
    names = cells_of("two-clouds-to-a-map.ipynb", tmp_path, monkeypatch)
    assert os.path.getsize("map.png") > 10_000
    truth = true_motions(tmp_path / "wall")
    stones = names["r"].stones_arrow.to_pylist()
    errors = [s["dx"] - truth[nearest(truth, s["y"], s["z"])] for s in stones if s["dx"] is not None]
    assert len(errors) > 10 and sorted(map(abs, errors))[len(errors) // 2] < 1e-3
    assert max(truth.values()) > 3e-3


def test_the_notebook_of_a_series(tmp_path, monkeypatch):
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib").use("agg")
    names = cells_of("series.ipynb", tmp_path, monkeypatch)
    assert names["r"].verdict["series"]["trend"]["answer"] == "yes"
    # The velocity of the fastest stone is that of the simulated bulge at its place.
    fastest, stones = names["fastest"], names["r"].stones_arrow.to_pylist()
    place = next((s["y"], s["z"]) for s in stones if s["stone_id"] == fastest.stone_id)
    truth = true_motions(tmp_path / "survey-2025")
    assert abs(fastest.v_out - truth[nearest(truth, *place)] / 4.0) < 3e-4
    assert os.path.getsize("path.png") > 10_000


def test_the_notebook_of_a_detector(tmp_path, monkeypatch):
    pytest.importorskip("PIL.Image")
    names = cells_of("own-detector.ipynb", tmp_path, monkeypatch, minutes=0.2)
    assert (tmp_path / "mine" / "model.safetensors").is_file()
    assert names["scores"]["built-in"]["f1"] > 0.8 and names["scores"]["mine"]["f1"] > 0.8
    assert names["r"].parameters["segment"]["model"].endswith("mine/model.safetensors")
