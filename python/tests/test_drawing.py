"""The drawing for CAD, read by another program; skipped without ezdxf."""

from __future__ import annotations

import csv
import json

import pytest

ezdxf = pytest.importorskip("ezdxf")


def test_drawing_has_every_stone_on_the_layer_of_its_state(results):
    drawing = ezdxf.readfile(results.path / "data" / "stones.dxf")
    assert not drawing.audit().errors
    with (results.path / "stones.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    (epoch,) = json.loads((results.path / "verdict.json").read_text())["epochs"]
    states = ["LOST" if s["lost"] else s["state"].upper().replace(" ", "_") for s in epoch["stones"]]
    shapes = drawing.modelspace()

    outlines = [s for s in shapes if s.dxf.layer.startswith("E2_OUTLINE_")]
    assert all(s.dxftype() == "POLYLINE" and s.is_closed for s in outlines)
    assert sorted(s.dxf.layer for s in outlines) == sorted(f"E2_OUTLINE_{state}" for state in states)

    # Numbers stand in their stones, and motions out of the wall below them.
    texts = [s for s in shapes if s.dxftype() == "TEXT"]
    numbers = {s.dxf.text: s.dxf.align_point for s in texts if s.dxf.layer == "NUMBERS"}
    out = [(s.dxf.text, s.dxf.align_point) for s in texts if s.dxf.layer.startswith("E2_OUT_MM_")]
    assert len(numbers) == len(rows) and len(out) == sum(r["d_out"] != "" for r in rows)
    for row in rows:
        middle = (float(row["along_m"]), float(row["up_m"]))
        assert numbers[row["stone_id"]].isclose((middle[0], middle[1] + 0.2 * float(row["area_m2"]) ** 0.5), abs_tol=1e-3)
        if row["d_out"]:
            nearest = min(out, key=lambda o: abs(o[1].x - middle[0]) + abs(o[1].y - middle[1]))
            assert abs(float(nearest[0]) - 1e3 * float(row["d_out"])) < 0.051

    # Arrows are as many times longer as the legend says.
    (legend,) = [s.dxf.text for s in texts if s.dxf.layer == "EPOCHS"]
    factor = float(legend.split("arrows ")[1].split(" times")[0])
    arrows = [list(s.points()) for s in shapes if s.dxf.layer.startswith("E2_ARROW_")]
    moved = [(float(r["d_along"]) * factor, float(r["d_up"]) * factor) for r in rows if r["d_along"]]
    drawn = sorted((round(tip.x - tail.x, 3), round(tip.y - tail.y, 3)) for tail, tip, *_ in arrows)
    for found, expected in zip(drawn, sorted((round(x, 3), round(y, 3)) for x, y in moved), strict=True):
        assert found == pytest.approx(expected, abs=0.02)
