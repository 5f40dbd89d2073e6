"""Writes the M3C2 fixture: two synthetic clouds, core points, normals, and what py4dgeo says about them.

Needs numpy and py4dgeo (1.2.0 was used). Run in this folder: python generate.py
The clouds are a rough battered wall, 1.2 x 1.0 m at 2 cm, with a hole in epoch 2 and sparse corners; nothing in
them comes from a survey. py4dgeo's cylinder search needs an odd ceil(max_distance / radius); here it is 5.
"""

import numpy as np
import py4dgeo

RADIUS, DEPTH, REGISTRATION, NORMAL_RADIUS = 0.06, 0.3, 0.002, 0.15
OUT = np.array([1.0, 0.0, 0.2])


def wall(rng, shift, noise, hole):
    y, z = rng.uniform(0.0, 1.2, 3000), rng.uniform(0.0, 1.0, 3000)
    relief = 0.02 * np.sin(9.0 * y + 1.0) * np.cos(11.0 * z) + 0.01 * np.sin(31.0 * z)
    x = relief - 0.2 * z + shift * np.exp(-((y - 0.6) ** 2 + (z - 0.5) ** 2) / 0.1) + rng.normal(0.0, noise, 3000)
    keep = (np.hypot(y - 0.25, z - 0.75) > hole) & (rng.uniform(size=3000) < 0.2 + 1.5 * y)
    # Tenths of a millimetre, as a scanner's file would keep them.
    return np.round(np.column_stack([x + 40.0, y - 300.0, z + 500.0])[keep], 4)


def run(first, second, core, normals, robust):
    epochs = py4dgeo.Epoch(first), py4dgeo.Epoch(second)
    for epoch in epochs:
        epoch.build_kdtree()
    m3c2 = py4dgeo.M3C2(
        epochs=epochs, corepoints=core, corepoint_normals=normals, cyl_radius=RADIUS, max_distance=DEPTH,
        registration_error=REGISTRATION, robust_aggr=robust,
    )
    distance, limits = m3c2.run()
    names = ("lodetection", "spread1", "num_samples1", "spread2", "num_samples2")
    return np.column_stack([distance] + [limits[n] for n in names])


def main():
    rng = np.random.default_rng(20260411)
    first, second = wall(rng, 0.0, 0.002, 0.0), wall(rng, 0.04, 0.004, 0.12)
    core = first[np.sort(rng.choice(len(first), 250, replace=False))]
    estimator = py4dgeo.M3C2(
        epochs=(py4dgeo.Epoch(first), py4dgeo.Epoch(second)), corepoints=core, normal_radii=[NORMAL_RADIUS],
        orientation_vector=OUT, cyl_radius=RADIUS, max_distance=DEPTH,
    )
    normals = np.array(estimator.directions())
    for name, cloud in (("first.csv", first), ("second.csv", second)):
        np.savetxt(name, cloud, fmt="%.4f", delimiter=",", header="x,y,z", comments="")
    mean, median = (run(first, second, core, normals, robust) for robust in (False, True))
    header = "x,y,z,nx,ny,nz," + ",".join(
        f"{kind}_{name}" for kind in ("mean", "median") for name in ("distance", "lod", "spread1", "n1", "spread2", "n2")
    )
    np.savetxt(
        "py4dgeo.csv", np.hstack([core, normals, mean, median]), fmt="%.12g", delimiter=",", header=header, comments=""
    )


if __name__ == "__main__":
    main()
