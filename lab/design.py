"""What `design` predicts from first surveys of small still walls, against what runs of both surveys achieve.

python3 lab/design.py PROGRAM OUT [WALLS]

Simulates WALLS (default 10) walls of 2.4 x 1.6 m with a terrestrial scanner and as many with a lidar on a drone, predicts
from each first survey, runs both surveys, and prints a row of a Markdown table for each kind and axis: medians over the
walls of the predicted standard deviation, of its ratio to the one that the run states, with the smallest and largest ratio,
and, from all stones of all walls together, the ratio of the predicted variance to the squared errors (walls stand still, so
that every motion is an error). Finished walls are not made again. Needs numpy and pandas with pyarrow.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd

AXES = ["along", "up", "out"]
SURVEY = """
name = "Still wall"
[scene]
seed = {seed}
[scene.wall]
width_m = 2.4
height_m = 1.6
seed = {seed}
{scanner}
[photos]
columns = 2
rows = 1
width = 900
height = 700
focal_px = 1100.0
distance_m = 5.0
"""
SCANNERS = {
    "terrestrial": "[scene.tls]\nspacing_m = 0.007\ndatum_m = 0.0003",
    "drone": "[scene.uav]",
}
# Axes of the face of the simulated wall, which leans back by 1:0.2: rows along, up, out.
LEAN = np.hypot(1, 0.2)
FACE = np.array([[0, 1, 0], [-0.2 / LEAN, 0, 1 / LEAN], [1 / LEAN, 0, 0.2 / LEAN]])


def make(program, folder, kind, seed):
    """Survey, prediction and run of one wall."""
    survey, results, design = folder / "survey", folder / "results", folder / "design"
    folder.mkdir(parents=True, exist_ok=True)
    params = SURVEY.format(seed=seed, scanner=SCANNERS[kind])
    (folder / "params.toml").write_text(params)
    for done, words in [
        (survey / "stonewise.toml", ["test", "simulate", "--params", folder / "params.toml", "--out", survey]),
        (design / "design.json", ["design", survey / "stonewise.toml", "--out", design]),
        (results / "run.json", ["run", survey / "stonewise.toml", "--out", results]),
    ]:
        if not done.exists():
            ran = subprocess.run([program, "--quiet", *words], capture_output=True, text=True)
            if ran.returncode not in (0, 3):
                sys.exit(f"{words[0]} of {folder}: {ran.stderr}")
    predicted = json.loads((design / "design.json").read_text())
    stones = pd.read_parquet(results / "data" / "stones.parquet")
    return predicted, stones[stones["status"] == "ok"]


def main(program, out, walls=10):
    print("| | axis | predicted, mm | predicted / stated: median (range) | predicted / error, rms |")
    print("| --- | --- | --- | --- | --- |")
    for kind in SCANNERS:
        made = [make(program, Path(out) / f"{kind}_{seed}", kind, seed) for seed in range(1, int(walls) + 1)]
        for name, key, sd, error in [
            ("motion", "sd_mm", "sd", "d"),
            ("deformation", "sd_deformation_mm", "sd_def", "def_d"),
        ]:
            for axis, word in enumerate(AXES):
                expected = np.array([design[key][axis] for design, _ in made])
                stated = np.array([1e3 * stones[f"{sd}_{word}"].median() for _, stones in made])
                errors = [stones[[f"{error}{c}" for c in "xyz"]].to_numpy() @ FACE[axis] for _, stones in made]
                squares = np.concatenate([(1e3 * e[np.isfinite(e)]) ** 2 for e in errors])
                weights = np.concatenate([np.full(np.isfinite(e).sum(), p**2) for e, p in zip(errors, expected)])
                ratio = expected / stated
                print(
                    f"| {kind}, {name} | {word} | {np.median(expected):.2f} | {np.median(ratio):.2f} "
                    f"({ratio.min():.2f} to {ratio.max():.2f}) | {np.sqrt(weights.sum() / squares.sum()):.2f} |"
                )


if __name__ == "__main__":
    main(*sys.argv[1:])
