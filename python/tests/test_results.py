"""Results as tables and arrays."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import xml.etree.ElementTree
from collections import Counter

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest

import stonewise


@pytest.fixture
def rows(results):
    with (results.path / "stones.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_arrays_hold_what_the_text_table_holds(results, rows):
    number = lambda cell: float(cell) if cell else np.nan  # noqa: E731
    moved = np.array([[number(r[c]) for c in ("dx", "dy", "dz")] for r in rows])
    assert results.displacement.shape == (len(rows), 3)
    np.testing.assert_allclose(results.displacement, moved, rtol=0, atol=5.1e-8)
    covariance = results.covariance
    assert covariance.shape == (len(rows), 3, 3)
    for (i, j), name in {(0, 0): "xx", (1, 0): "xy", (0, 1): "xy", (2, 1): "yz", (2, 2): "zz"}.items():
        expected = [number(r[f"cov_{name}"]) for r in rows]
        np.testing.assert_allclose(covariance[:, i, j], expected, rtol=1e-5)
    measured = np.array([r["status"] == "ok" for r in rows])
    assert measured.sum() > 10
    assert np.isfinite(results.displacement[measured]).all()
    assert np.isnan(results.displacement[~measured]).all()
    assert (np.linalg.eigvalsh(covariance[measured]) > 0).all()


def test_stones_have_outlines(results, rows):
    geopandas = pytest.importorskip("geopandas")
    stones = results.stones
    assert isinstance(stones, geopandas.GeoDataFrame)
    assert stones["stone_id"].tolist() == [int(r["stone_id"]) for r in rows]
    assert stones.geometry.notna().all() and stones.geometry.is_valid.all()
    for row in stones.itertuples():
        assert abs(row.geometry.centroid.y - row.y) < 0.1
    assert isinstance(results.stones_arrow, pa.Table)
    assert results.stones_arrow.schema.metadata[b"dx.unit"] == b"m"


@pytest.mark.parametrize(("missing", "kind"), [(["geopandas"], "DataFrame"), (["geopandas", "pandas"], "Table")])
def test_tables_without_optional_packages(results, missing, kind):
    script = f"""
import sys
class Missing:
    def find_spec(self, name, *rest):
        if name.split(".")[0] in {missing!r}:
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Missing())
import stonewise
r = stonewise.open({str(results.path)!r})
for table in (r.stones, r.series, r.joints, r.matches):
    print(type(table).__name__, len(table))
print(r.displacement.shape, r.covariance.shape)
"""
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[0] == f"{kind} {results.stones_arrow.num_rows}"
    assert Counter(line.split()[0] for line in said.splitlines())[kind] == 4


def test_matches_tell_of_every_stone(results):
    matches = results.matches_arrow.to_pylist()
    stones = results.stones_arrow.to_pylist()
    assert [m["stone_id"] for m in matches] == [s["stone_id"] for s in stones]
    assert [m["matched_id"] for m in matches] == [s["matched_id"] for s in stones]
    words = {"matched", "unseen", "lost", "ambiguous", "area_mismatch"}
    assert {m["outcome"] for m in matches} <= words
    assert all((m["outcome"] == "matched") == (m["matched_id"] is not None) for m in matches)


def test_a_budget_adds_up_to_the_standard_deviation(results):
    measured = results.stones_arrow.filter(pc.is_valid(results.stones_arrow["dx"])).to_pylist()
    for stone in measured:
        squares = sum(sd**2 for sd in results.budget(stone["stone_id"]).values())
        assert np.sqrt(squares) == pytest.approx([stone["sd_along"], stone["sd_up"], stone["sd_out"]], rel=1e-9)
    with pytest.raises(stonewise.Error, match="no stone 0"):
        results.budget(0)


def test_joints_lie_between_stones(results):
    joints = results.joints_arrow
    stones = set(results.stones_arrow["stone_id"].to_pylist())
    assert joints.num_rows > len(stones) / 2
    assert set(joints["stone_1"].to_pylist()) | set(joints["stone_2"].to_pylist()) <= stones
    assert 0.0 < np.nanmedian(joints["width"].to_numpy()) < 0.1


def test_series_has_the_rows_of_all_epochs(results):
    series = results.series_arrow
    assert series.column_names[0] == "epoch"
    assert set(series["epoch"].to_pylist()) == {results.epochs[1]}
    assert series.drop_columns("epoch").equals(results.stones_arrow)
    assert len(results.pairs) == 1


def test_a_third_epoch(survey, tmp_path):
    """The files of the second epoch once more: the same motions."""
    shutil.copytree(survey, tmp_path / "survey")
    shutil.copytree(survey / "epoch2", tmp_path / "survey" / "epoch3")
    project = tmp_path / "survey" / "stonewise.toml"
    text = project.read_text()
    third = text[text.rindex("[[epochs]]") :].replace("epoch 2", "epoch 3").replace("epoch2/", "epoch3/")
    project.write_text(text + "\n" + third)
    r = stonewise.run(project, out=tmp_path / "out", force=True)
    assert r.epochs == ["epoch 1", "epoch 2", "epoch 3"]
    second, last = r.pairs
    assert second is r and last.number == 2
    np.testing.assert_array_equal(last.displacement, second.displacement)
    assert len(last.joints) == len(second.joints) and len(last.matches) == len(second.matches)
    assert last.registration["converged"]
    assert len(last.stones) == len(r.stones)
    assert r.series_arrow["epoch"].to_pylist() == ["epoch 2"] * len(r.stones) + ["epoch 3"] * len(r.stones)


def test_the_record_of_the_run(results):
    record = json.loads((results.path / "run.json").read_text())
    assert results.parameters == record["parameters"]
    assert len(results.warnings) == len(record["warnings"])
    assert {w.message for w in results.warnings} == {w["message"] for w in record["warnings"]}
    verdict = results.path / "verdict.json"
    assert results.verdict == (json.loads(verdict.read_text()) if verdict.is_file() else None)
    assert results.evaluation is None or "stones" in results.evaluation
    assert results.registration["datum"]
    assert results.report.is_file()


def test_a_folder_without_results(command, tmp_path):
    with pytest.raises(stonewise.Error) as raised:
        stonewise.open(tmp_path)
    said = command("report", tmp_path, expect=1).stderr.strip()
    assert said == f"error: {raised.value} [no-results]"


def test_a_result_shows_itself_as_a_map(results, rows):
    page = xml.etree.ElementTree.fromstring(results._repr_html_())
    assert page.find("p").text == results.verdict["sentence"]
    shapes = page.iter("{http://www.w3.org/2000/svg}polygon")
    fills = {shape[0].text.split(":")[0]: shape.get("fill") for shape in shapes}
    assert len(fills) == len(rows)
    for row in rows:
        fill = fills[f"stone {row['stone_id']}"]
        if not row["d_out"]:
            assert fill == "#ddd"
            continue
        red, blue = int(fill[1:3], 16), int(fill[5:7], 16)
        assert red >= blue if float(row["d_out"]) > 0 else red <= blue, row


def test_the_map_has_the_shape_of_the_wall(results):
    geopandas = pytest.importorskip("geopandas")
    page = xml.etree.ElementTree.fromstring(results._repr_html_())
    drawn = {}
    for shape in page.iter("{http://www.w3.org/2000/svg}polygon"):
        points = [tuple(map(float, point.split(","))) for point in shape.get("points").split()]
        drawn[int(shape[0].text.split(":")[0].split()[1])] = np.array(points)
    wall = geopandas.read_file(results.path / "stones.gpkg", layer="stones_facade")
    left, low, right, high = wall.total_bounds
    for stone, outline in zip(wall["stone_id"], wall.geometry):
        expected = (np.array(outline.exterior.coords) - [left, high]) * [720 / (right - left), -720 / (right - left)]
        np.testing.assert_allclose(drawn[stone], expected, rtol=0, atol=0.051)


def test_geoparquet_holds_the_rows_and_the_polygons_of_the_geopackage(results):
    geopandas = pytest.importorskip("geopandas")
    table = geopandas.read_parquet(results.path / "data/stones.geo.parquet")
    layer = geopandas.read_file(results.path / "stones.gpkg", layer="stones").set_crs(None, allow_override=True)
    assert table.crs is None
    assert table["stone_id"].tolist() == layer["stone_id"].tolist() == results.stones_arrow["stone_id"].to_pylist()
    assert table.geometry.has_z.all() and (table.geometry.geom_equals_exact(layer.geometry, 0.0)).all()
    np.testing.assert_array_equal(table["dx"].to_numpy(), results.displacement[:, 0])
