#!/usr/bin/env python3
"""What views of scans find: stones by size, under noise, and beside holes of the clouds.

    cargo build --release -p stonewise-cli
    python3 lab/views.py                          # pip install numpy pandas laspy[lazrs]
    python3 lab/views.py --binary STONEWISE --out FOLDER

Simulates walls of 3 x 2 m that stand still, without surroundings, runs stonewise on the scans alone
with views of the relief, and prints two Markdown tables: how many stones are measured by their size
in distances between points (square root of the area over the distance; the distance is the square
root of the stones' area per point), and what noise and holes cost. Stones at the edge of the wall,
and those of which less than half is visible, are left out. A row is beside a stone if its middle is
farther than 10 cm from that of every stone.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from panel import BARE, ROOT, XYZ, RunError, Survey, millimetres, np, pd, run, with_truth

RELIEF = '[views]\nshow = "relief"\n'
LEAST_VISIBLE = 0.5
BESIDE_M = 0.10
HOLE_RADIUS_M = 0.04
# Upper ends of the classes of size; the last is open.
SIZES = [8, 10, 12, 15, 20, 25, np.inf]
SPACINGS_M = [(0.006, [11]), (0.009, [11]), (0.012, [11]), (0.018, [11, 12, 13, 14, 15])]
# Range noise in metres, share of the points that holes take.
DISTURBED = [(0.0015, 0.0), (0.006, 0.0), (0.010, 0.0), (0.0015, 0.25), (0.0015, 0.4)]


def holes(share):
    """An edit that takes this share of the points out of each cloud, in discs at random places."""

    def edit(scene):
        for cloud in scene.clouds:
            count = len(cloud.places)
            while len(cloud.places) > (1 - share) * count:
                middle = cloud.places[scene.random.integers(len(cloud.places))]
                far = np.linalg.norm(cloud.places[:, 1:] - middle[1:], axis=1) > HOLE_RADIUS_M
                cloud.keep(far)

    return edit


def measured(survey, folder, binary):
    """The stones of a wall (size in distances, whether measured), the rows beside, the distance."""
    scene, motions, said = run(survey, folder, binary)
    if not (folder / "results/stones.csv").exists():
        raise RunError(said)
    whole = scene.stones[scene.stones["visible"] >= LEAST_VISIBLE]
    distance_m = np.sqrt((whole["area_m2"] * whole["visible"]).sum() / whole["points"].sum())
    rows = with_truth(scene, motions, folder / "results")
    rows = rows[rows["status"] == "ok"]
    middles = scene.stones[["cx", "cy", "cz"]].to_numpy()
    apart = np.linalg.norm(rows[XYZ].to_numpy()[:, None] - middles[None], axis=2)
    countable = whole[whole["edge"] == 0]
    return (
        pd.DataFrame(
            {
                "size": np.sqrt(countable["area_m2"]) / distance_m,
                "measured": countable.index.isin(rows["own"]),
            }
        ),
        int((apart.min(axis=1) > BESIDE_M).sum()),
        distance_m,
    )


def wall(name, seed, **changes):
    """A still wall without surroundings."""
    return Survey(name, seed, surroundings=BARE, project=RELIEF, **changes)


def row(*cells):
    """Prints a row of a table."""
    print(f"| {' | '.join(map(str, cells))} |", flush=True)


def main():
    """Prints the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/stonewise")
    parser.add_argument("--out", help="a new folder; a temporary one when absent")
    arguments = parser.parse_args()
    out = Path(arguments.out or tempfile.mkdtemp(prefix="stonewise-views-"))

    row("range noise mm", "points removed", "measured", "rows beside a stone")
    row("---", "---", "---", "---")
    for noise_m, share in DISTURBED:
        name = f"noise_{noise_m}_holes_{share}"
        edits = [holes(share)] if share else []
        survey = wall(name, 11, noise=noise_m, edits=edits)
        stones, beside, _ = measured(survey, out / name, arguments.binary)
        count = f"{stones['measured'].sum()} of {len(stones)}"
        row(millimetres(noise_m), f"{100 * share:.0f} %", count, beside)

    print()
    every = []
    for spacing_m, seeds in SPACINGS_M:
        for seed in seeds:
            name = f"spacing_{spacing_m}_{seed}"
            stones, beside, distance_m = measured(
                wall(name, seed, spacing=spacing_m, noise=0.0015), out / name, arguments.binary
            )
            print(
                f"{name}: points {1e3 * distance_m:.1f} mm apart, {stones['measured'].sum()} of "
                f"{len(stones)}, {beside} rows beside a stone",
                file=sys.stderr,
            )
            every.append(stones)
    stones = pd.concat(every)
    low = [0, *SIZES[:-1]]
    between = (f"{a} to {b}" for a, b in zip(SIZES, SIZES[1:-1]))
    row("point spacings across the stone", f"under {SIZES[0]}", *between, "above")
    row(*["---"] * (len(SIZES) + 1))
    classes = (stones[(stones["size"] >= a) & (stones["size"] < b)] for a, b in zip(low, SIZES))
    row("measured", *(f"{c['measured'].sum()} of {len(c)}" for c in classes))


if __name__ == "__main__":
    main()
