#!/usr/bin/env python3
"""What clouds and photos measure of each stone, apart and together, against the truth.

    python3 lab/photos.py RESULTS TRUTH_STONES.csv       # pip install pandas pyarrow scipy

Reads `data/evidence/tracks_2.parquet` and `stones.csv` of a results folder. Prints a table in Markdown, millimetres in the face,
along / up: the errors of the stones that photos measured, less the rigid motion in the face that fits them best, by the
stone's own points alone, by its photos alone, and by the adjustment. Coverage is the share of the errors within 1.96
standard deviations. A second table does the same for the rotation about the normal, milliradians, of stones that are truly loose
and of the others, less the median error of the others. A stone counts where its true counterpart lies within 10 cm, is not cut by the edge of the section
and has 35 % of its face measured in both epochs.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

FACE = ["along", "up"]
NEAR_M = 0.1
COUNTABLE_SHARE = 0.35
NMAD = 1.4826
ROUNDS = 20


def main():
    results, truth = Path(sys.argv[1]), Path(sys.argv[2])
    stones = counted(pd.read_csv(results / "stones.csv"), pd.read_csv(truth))
    both = stones.merge(pd.read_parquet(results / "data" / "evidence" / "tracks_2.parquet"), on="stone_id")
    both = both.dropna(subset=[f"{source}_along" for source in ["clouds", "photos", "both"]])
    print("| measured by | stones | NMAD | RMSE | largest | median sd | coverage |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for source, name in [("clouds", "points of the stone"), ("photos", "photos of the stone"), ("both", "the adjustment")]:
        print(f"| {name} | {len(both)} | {figures(both, source)} |")
    print("\n| rotation about the normal | stones | RMSE | median error | mean sd | coverage |")
    print("| --- | --- | --- | --- | --- | --- |")
    error = stones["error_turn"] - stones["error_turn"][~stones["truly_loose"]].median()
    for name, chosen in [("loose stones", stones["truly_loose"]), ("the others", ~stones["truly_loose"])]:
        print(f"| {name} | {chosen.sum()} | {turns(error[chosen], stones['sd_turn'][chosen])} |")


def counted(stones, truth):
    """Measured stones that count, with the error of their motion along the axes of the wall's face."""
    stones = stones.dropna(subset=["d_along"]).reset_index(drop=True)
    distance, nearest = cKDTree(truth[["cx", "cy", "cz"]]).query(stones[["x", "y", "z"]])
    own = truth.iloc[nearest].reset_index(drop=True)
    # The face's axes in the world: those that turn dx, dy, dz into d_along, d_up.
    axes = np.linalg.lstsq(stones[["dx", "dy", "dz"]], stones[["d_along", "d_up"]], rcond=None)[0]
    true = own[["dx", "dy", "dz"]].to_numpy() @ axes
    for k, axis in enumerate(FACE):
        stones[f"error_{axis}"] = stones[f"d_{axis}"] - true[:, k]
    normal = own[["nx", "ny", "nz"]].to_numpy()
    turn = [(table[["rx", "ry", "rz"]].to_numpy() * normal).sum(axis=1) for table in (stones, own)]
    stones["error_turn"] = turn[0] - turn[1]
    covariance = np.array([[stones["cov_rot_" + min(a, b) + max(a, b)] for a in "xyz"] for b in "xyz"])
    stones["sd_turn"] = np.sqrt(np.einsum("ki,ijk,kj->k", normal, covariance, normal))
    stones["truly_loose"] = own["loose"] == 1
    seen = own.filter(like="vis_").max(axis=1)
    return stones[(distance < NEAR_M) & (own["edge"] == 0) & (seen >= COUNTABLE_SHARE)]


def figures(stones, source):
    """The row of a source. Its error is that of the adjustment and what it differs from the adjustment."""
    errors = np.column_stack([stones[f"error_{a}"] + stones[f"{source}_{a}"] - stones[f"both_{a}"] for a in FACE])
    left = without_rigid_motion(errors, stones[["along_m", "up_m"]].to_numpy())
    sd = np.sqrt(stones[[f"{source}_cov_{a}_{a}" for a in FACE]].to_numpy())
    nmad = NMAD * np.median(abs(left - np.median(left, axis=0)), axis=0)
    rmse = np.sqrt((left**2).mean(axis=0))
    covered = (abs(left) < 1.96 * sd).mean(axis=0)

    def pair(values, factor=1e3):
        return " / ".join(f"{factor * v:.2f}" for v in values)

    largest = 1e3 * np.linalg.norm(left, axis=1).max()
    return " | ".join([pair(nmad), pair(rmse), f"{largest:.1f}", pair(np.median(sd, axis=0)), pair(covered, 1)])


def turns(errors, sd):
    """The row of some stones' rotations."""
    size = abs(errors)
    values = [1e3 * np.sqrt((size**2).mean()), 1e3 * size.median(), 1e3 * sd.mean(), (size < 1.96 * sd).mean()]
    return " | ".join(f"{v:.2f}" for v in values)


def without_rigid_motion(errors, places):
    """Errors less the shift and turn in the face that fit them best; large errors count less (Huber 1964)."""
    rows = np.zeros((len(errors), 2, 3))
    rows[:, 0, 0] = rows[:, 1, 1] = 1
    rows[:, 0, 2], rows[:, 1, 2] = -places[:, 1], places[:, 0]
    weight = np.ones(len(errors))
    for _ in range(ROUNDS):
        scaled = rows * weight[:, None, None]
        fit = np.linalg.lstsq(scaled.reshape(-1, 3), (errors * weight[:, None]).ravel(), rcond=None)[0]
        left = errors - rows @ fit
        size = np.linalg.norm(left, axis=1)
        weight = np.sqrt(np.minimum(1, 2 * np.median(size) / np.maximum(size, 1e-12)))
    return left


if __name__ == "__main__":
    main()
