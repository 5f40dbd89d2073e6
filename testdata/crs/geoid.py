"""Makes geoid.gtx, a small grid of an invented geoid, and geoid.json: what PROJ's cs2cs makes of it (Debian's proj-bin, 9.1.1).
Run: python3 geoid.py
"""
import json
import struct
import subprocess
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
rng = np.random.default_rng(49)
SOUTH, WEST, STEP_LAT, STEP_LON, ROWS, COLUMNS = 46.0, 4.5, 0.75, 1.25, 9, 6


def cs2cs(source, target, rows):
    text = "\n".join(" ".join(f"{v:.12f}" for v in row) for row in rows)
    done = subprocess.run(["cs2cs", "-f", "%.11f", *source.split(), "+to", *target.split()], input=text, capture_output=True, text=True,
                          check=True)
    return [[float(v) for v in line.split()] for line in done.stdout.splitlines()]


def above_ellipsoid(places):
    """Latitude, longitude and height of the geoid above the ellipsoid there."""
    out = cs2cs("EPSG:4979", f"+proj=longlat +datum=WGS84 +geoidgrids={HERE / 'geoid.gtx'}", places)
    return [[lat, lon, h - row[2]] for (lat, lon, h), row in zip(places, out)]


heights = (46 + rng.normal(0, 2, (ROWS, COLUMNS))).astype(">f4")
heights[ROWS - 1, COLUMNS - 1] = -88.8888
head = struct.pack(">4d2i", SOUTH, WEST, STEP_LAT, STEP_LON, ROWS, COLUMNS)
(HERE / "geoid.gtx").write_bytes(head + heights.tobytes())

latitudes, longitudes = rng.uniform(SOUTH, SOUTH + 7 * STEP_LAT, 40), rng.uniform(WEST, WEST + 4 * STEP_LON, 40)
points = above_ellipsoid(np.stack([latitudes, longitudes, rng.uniform(0, 900, 40)], axis=1).tolist())
cameras = [row for row in json.loads((HERE / "expected.json").read_text())["cameras"] if row["epsg"] == 25832]
centres = cs2cs("+proj=utm +zone=32 +datum=WGS84", "EPSG:4326", [row["centre"] for row in cameras])
(HERE / "geoid.json").write_text(json.dumps({"points": points, "cameras": above_ellipsoid(centres)}) + "\n")
