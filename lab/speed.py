#!/usr/bin/env python3
"""Processor time of stonewise and of the programs that do the same, in turn and on the same data.

    cargo build --release -p stonewise-lab
    pip install scipy open3d py4dgeo small_gicp laspy[lazrs,laszip]
    python3 lab/speed.py                       # a made-up wall
    python3 lab/speed.py --clouds A.laz B.laz

Prints a table in Markdown: medians of processor seconds (all threads) over the rounds, and their ratio. Peers that are not
installed are left out with a word. CloudCompare is used where `CloudCompare` is on the path; what opening the same
clouds takes is subtracted from its time. Linux only.
"""

import argparse
import importlib
import os
import resource
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
# Size of the wall, metres, and its motion between the epochs.
WALL_M = (10.0, 5.0)
MOTION_M = (0.004, 0.006, -0.003)
NOISE_M = 0.001
# Parameters of the comparisons: those of the project file.
C2C_MAX_M, NORMAL_M, CYLINDER_M, DEPTH_M = 0.5, 0.25, 0.05, 0.3
VOXEL_M, TILE_M = 0.01, 8.0


def main():
    arguments = parse()
    folder = Path(arguments.out or tempfile.mkdtemp(prefix="stonewise-speed-"))
    folder.mkdir(parents=True, exist_ok=True)
    clouds = read(arguments.clouds) if arguments.clouds else [wall(1, arguments.points), wall(2, arguments.points, MOTION_M)]
    write(folder, clouds, made_up=not arguments.clouds)
    peers = Peers(folder, clouds)
    ours = Ours(arguments.program, folder)
    rows = []
    for what, case, their_case in cases(made_up=not arguments.clouds):
        if case in ("laz", "tiles") and not (folder / "first.laz").exists():
            print(f"{case}: laspy, which writes LAZ, is not installed", flush=True)
            continue
        theirs = peers.of(their_case)
        times = {name: [] for name in ["stonewise", *theirs]}
        for _ in range(arguments.rounds):
            seconds, units = ours.run(case)
            times["stonewise"].append(seconds)
            for name, run in theirs.items():
                times[name].append(run())
        rows.append((what, units, {name: statistics.median(t) for name, t in times.items()}))
    print(table(rows))


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", help="folder for the data; a temporary one when absent")
    parser.add_argument("--points", type=float, default=2.7e6, help="points of the made-up wall in each epoch")
    parser.add_argument("--clouds", nargs=2, help="two clouds in place of the made-up wall; no stones then")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--program", default=ROOT / "target/release/lab", type=Path)
    return parser.parse_args()


def cases(made_up):
    """What, our case, the peers' case."""
    yield "C2C, index included", "c2c", "c2c"
    yield "M3C2 with normals, index included", "m3c2", "m3c2"
    if made_up:
        yield "paper's estimator, 60 cm, all points", "gicp", "gicp"
        yield "the same, voxels of 1 cm", "gicp-voxel", "gicp"
    yield "LAZ decoding", "laz", "laz"
    yield "LAZ to tiles", "tiles", "tiles"


# Data


def height(x, z):
    """Relief of masonry in stretcher bond, metres."""
    y = 0.05 * np.sin(1.3 * x) * np.cos(0.9 * z)
    offset = np.where(np.floor(z / 0.25) % 2 == 0, 0.0, 0.2)
    u, v = (x + offset) % 0.4, z % 0.25
    y += 0.02 * np.exp(-((np.minimum(np.minimum(u, 0.4 - u), np.minimum(v, 0.25 - v)) / 0.012) ** 2))
    for k, a in ((31.0, 0.004), (67.0, 0.002), (139.0, 0.001)):
        y += a * np.sin(k * x + 0.7 * k * z) * np.cos(0.8 * k * z - 0.3 * k * x)
    return y


def wall(seed, points, motion=(0.0, 0.0, 0.0)):
    """Points of the wall in the order of a scanner's columns."""
    rng = np.random.default_rng(seed)
    x, z = rng.uniform(0, WALL_M[0], int(points)), rng.uniform(0, WALL_M[1], int(points))
    y = height(x - motion[0], z - motion[2]) + motion[1] + rng.normal(0, NOISE_M, len(x))
    return np.column_stack([x, y, z])[np.lexsort((z, np.floor(x / 0.004)))]


def read(paths):
    import laspy

    return [np.column_stack([c.x, c.y, c.z]).astype(float) for c in map(laspy.read, paths)]


def write(folder, clouds, made_up):
    for name, cloud in zip(("first", "second"), clouds):
        cloud.tofile(folder / f"{name}.f64")
        write_ply(folder / f"{name}.ply", cloud - np.floor(clouds[0][0]))
    step = max(1, len(clouds[0]) // 20_000)
    clouds[0][::step].tofile(folder / "core.f64")
    middle = [(x, z) for x in (4.4, 4.8, 5.2, 5.6) for z in (2.375, 2.625)] if made_up else []
    np.array([(x, height(np.array(x), np.array(z)), z) for x, z in middle], float).tofile(folder / "stones.f64")
    try:
        import laspy
    except ImportError:
        return
    for name, cloud in zip(("first", "second"), clouds):
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.scales, header.offsets = [1e-4] * 3, np.floor(cloud.min(0))
        las = laspy.LasData(header)
        las.x, las.y, las.z = cloud.T
        las.gps_time = np.arange(len(cloud)) * 1e-5
        las.write(folder / f"{name}.laz")


def write_ply(path, cloud):
    """For CloudCompare, which Debian builds without LAZ."""
    columns = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n{columns}end_header\n"
    path.write_bytes(head.encode() + cloud.astype("<f4").tobytes())


# Ours


class Ours:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder
        pipes = dict(stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.process = subprocess.Popen([program, "comparisons", folder], **pipes)

    def run(self, case):
        """Processor seconds and units of work."""
        if case == "tiles":
            return self.tile()
        self.process.stdin.write(case + "\n")
        self.process.stdin.flush()
        _, seconds, units = self.process.stdout.readline().split()
        return float(seconds), int(units)

    def tile(self):
        out = self.folder / "tiles-ours"
        shutil.rmtree(out, ignore_errors=True)
        seconds, _ = child([self.program, "tiles", self.folder / "first.laz", self.folder / "second.laz", out])
        return seconds, 2


def child(command):
    """Processor seconds and wall seconds of a command."""
    spent = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    before, start = spent(), time.time()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return spent() - before, time.time() - start


# Peers


class Peers:
    def __init__(self, folder, clouds):
        self.folder, self.clouds = folder, clouds
        self.core = np.fromfile(folder / "core.f64").reshape(-1, 3)
        self.stones = np.fromfile(folder / "stones.f64").reshape(-1, 3)

    def of(self, case):
        """A function for each peer that is installed; it returns processor seconds."""
        peers = {
            "c2c": {"scipy": self.scipy, "open3d": self.open3d, "CloudCompare": self.cloudcompare},
            "m3c2": {"py4dgeo": self.py4dgeo},
            "gicp": {"small_gicp": self.small_gicp},
            "laz": {"laszip": lambda: self.decode("Laszip"), "lazrs": lambda: self.decode("Lazrs")},
            "tiles": {"laspy": self.laspy},
        }.get(case, {})
        return {name: run for name, run in peers.items() if is_there(name)}

    def scipy(self):
        from scipy.spatial import cKDTree

        return timed(lambda: cKDTree(self.clouds[0]).query(self.clouds[1], workers=-1, distance_upper_bound=C2C_MAX_M))

    def open3d(self):
        import open3d

        def work():
            first, second = (open3d.geometry.PointCloud(open3d.utility.Vector3dVector(c)) for c in self.clouds)
            return np.asarray(second.compute_point_cloud_distance(first))

        return timed(work)

    def cloudcompare(self):
        paths = [self.folder / f"{name}.ply" for name in ("second", "first")]
        opened = ["CloudCompare", "-SILENT", "-AUTO_SAVE", "OFF", "-O", paths[0], "-O", paths[1]]
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        return child([*opened, "-C2C_DIST", "-MAX_DIST", str(C2C_MAX_M)])[0] - child(opened)[0]

    def py4dgeo(self):
        import py4dgeo

        def work():
            epochs = [py4dgeo.Epoch(cloud) for cloud in self.clouds]
            for epoch in epochs:
                epoch.build_kdtree()
            m3c2 = py4dgeo.M3C2(
                epochs=epochs,
                corepoints=self.core,
                normal_radii=(NORMAL_M,),
                cyl_radius=CYLINDER_M,
                max_distance=DEPTH_M,
                registration_error=0.0,
            )
            return m3c2.run()

        return timed(work)

    def small_gicp(self):
        import small_gicp

        def work(near):
            return small_gicp.align(
                near[1], near[0], registration_type="GICP", downsampling_resolution=VOXEL_M, max_correspondence_distance=0.1
            )

        # Everything within 60 cm of a stone of 30 x 20 cm; the second epoch is larger by the reach of correspondences.
        windows = [
            [cloud[(abs(cloud - s) < [0.75 + more, 9.0, 0.7 + more]).all(1)] - s for cloud, more in zip(self.clouds, (0.0, 0.1))]
            for s in self.stones
        ]
        return sum(timed(lambda: work(near)) for near in windows)

    def decode(self, backend):
        import laspy

        # Coordinates of a million points at a time, as our reader gives them.
        def work():
            with laspy.open(self.folder / "first.laz", laz_backend=laspy.LazBackend[backend]) as reader:
                return sum(len(np.column_stack([c.x, c.y, c.z])) for c in reader.chunk_iterator(1_000_000))

        return timed(work)

    def laspy(self):
        import laspy

        def work():
            for name in ("first", "second"):
                out = self.folder / "tiles-laspy" / name
                shutil.rmtree(out, ignore_errors=True)
                out.mkdir(parents=True)
                las = laspy.read(self.folder / f"{name}.laz")
                points = np.column_stack([las.x, las.y, las.z])
                tiles = np.floor(points / TILE_M).astype(int)
                keys, of_point = np.unique(tiles, axis=0, return_inverse=True)
                for k, key in enumerate(keys):
                    inside = np.flatnonzero(of_point.ravel() == k)
                    offsets = (points[inside] - (key + 0.5) * TILE_M).astype(np.float32)
                    np.savez(out / f"{k}.npz", offsets=offsets, index=inside, source=las.point_source_id[inside], time=las.gps_time[inside])

        return timed(work)


def is_there(name):
    if name == "CloudCompare":
        found = shutil.which(name) is not None
    else:
        try:
            found = importlib.import_module(name) is not None
        except (ImportError, OSError):
            found = False
    if not found:
        print(f"{name}: not installed", flush=True)
    return found


def timed(work):
    start = time.process_time()
    work()
    return time.process_time() - start


def table(rows):
    lines = ["| what | units | stonewise [s] | peer [s] | ratio |", "| --- | --- | --- | --- | --- |"]
    for what, units, times in rows:
        ours = times.pop("stonewise")
        theirs = ", ".join(f"{name} {seconds:.2f}" for name, seconds in times.items()) or "-"
        ratios = ", ".join(f"{ours / seconds:.2f}" for seconds in times.values() if seconds > 0) or "-"
        lines.append(f"| {what} | {units:,} | {ours:.2f} | {theirs} | {ratios} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
