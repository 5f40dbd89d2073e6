"""stonewise as a tool of geodispbench3d; skipped where that (Python 3.12) is not installed."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("geodispbench3d")

PAGE = Path(__file__).parents[2] / "integrations" / "geodispbench3d" / "README.md"


@pytest.fixture
def suite(tmp_path, monkeypatch):
    """The files of the page, in a folder of their own."""
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text()
    for block in re.finditer(r"^```yaml\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        # The file that the text before the block named last.
        Path(re.findall(r"`(\w+\.yaml)`", text[: block.start()])[-1]).write_text(block[1])
    assert len(list(tmp_path.glob("*.yaml"))) == 4
    (example,) = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    exec(compile(example, str(PAGE), "exec"), {})
    return tmp_path


def scores(suite, parser):
    from geodispbench3d.dataset.ground_truth import load_ground_truth
    from geodispbench3d.dataset.schema import load_dataset
    from geodispbench3d.metrics.registry import MetricRegistry, load_metrics_config
    from geodispbench3d.tool.base import TrialRequest
    from geodispbench3d.tool.loader import load_tool_config

    tool = load_tool_config(suite / "tool.yaml")
    case = load_dataset(suite / "dataset.yaml").case("wall")
    truth = load_ground_truth(case.ground_truth)
    trial = tool.adapter.run_trial(TrialRequest(parameters={"match.max_ratio": 0.5}, case_name="wall"))
    assert trial.success, trial.error
    prediction = parser(outputs=trial.outputs, ground_truth=truth, options=tool.output_parser_options)
    registry = MetricRegistry()
    metrics = load_metrics_config(suite / "metrics.yaml").objective_metrics
    found = {m.id: registry.resolve(m)(prediction=prediction, ground_truth=truth) for m in metrics}
    return truth, prediction, found


def test_stones_and_m3c2_are_scored_by_the_benchmarks_metrics(suite):
    from stonewise.geodispbench3d import m3c2_motions, stone_motions

    truth, prediction, stones = scores(suite, stone_motions)
    print("stones", stones)
    # The benchmark's median error, computed from the survey's own table of truth.
    with open("wall/truth/stones.csv", newline="") as file:
        true = {row["stone_id"]: [float(row[name]) for name in ("dx", "dy", "dz")] for row in csv.DictReader(file)}
    errors = [np.linalg.norm(np.subtract(p["vector"], true[p["label"]])) for p in prediction["per_point"]]
    assert stones["median_error_m"] == pytest.approx(np.nanmedian(errors), abs=1e-9) and stones["median_error_m"] < 2e-3
    assert stones["points"] > 0.5 and 0.7 < stones["held"] <= 1.0
    _, _, m3c2 = scores(suite, m3c2_motions)
    print("m3c2", m3c2)
    assert m3c2["points"] > 0.5 and m3c2["median_error_m"] < 1e-2
    assert np.isnan(m3c2["held"])


def test_a_wrong_parameter_is_a_failed_trial_and_no_score(suite):
    from geodispbench3d.tool.base import TrialRequest
    from geodispbench3d.tool.loader import load_tool_config

    adapter = load_tool_config(suite / "tool.yaml").adapter
    failed = adapter.run_trial(TrialRequest(parameters={"match.max_ration": 0.5}))
    assert not failed.success and "unknown field `max_ration`" in failed.error
