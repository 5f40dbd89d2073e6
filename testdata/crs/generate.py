"""Writes expected.json: map coordinates and pixels as PROJ computes them. Needs pyproj and numpy.

systems:  definitions (EPSG code alone, WKT 1, WKT 2) with positions (latitude, longitude in degrees, height in m) and their
          easting and northing.
cameras:  poses in earth-centred coordinates (camera to world, 4 x 4 by rows), the map coordinates of their centres, and
          points in map coordinates with the pixel in which the earth-centred camera sees them (pinhole, f = 3000 px,
          centre 2000, 1500).
"""

import json
import pathlib
import sys
import warnings

import numpy as np
from pyproj import CRS, Transformer

warnings.filterwarnings("ignore")  # WKT 1 cannot say everything, and need not here
FOLDER = pathlib.Path(__file__).parent
POINTS = int(sys.argv[1]) if len(sys.argv) > 1 else 12

# Code and the corners of an area of use: south, west, north, east.
SYSTEMS = {
    32632: (44, 5.5, 60, 12.5),
    32733: (-60, 11, -2, 19),
    25832: (44, 5.5, 60, 12.5),
    25833: (46, 12, 60, 18),
    31466: (49, 5.8, 53, 7.6),
    31467: (47, 7.4, 55, 10.6),
    31468: (47, 10.4, 55, 13.6),
    31254: (46.7, 9.5, 47.7, 11.9),
    27700: (50, -6, 58, 1.5),
    2154: (42, -4, 51, 8),
    3006: (55, 11, 69, 24),
    28992: (50.8, 3.4, 53.5, 7.2),  # oblique stereographic
    31700: (43.7, 20.3, 48.2, 29.6),
    2056: (45.8, 6.0, 47.8, 10.5),  # oblique cylinder
    21781: (45.8, 6.0, 47.8, 10.5),
    23700: (45.8, 16.1, 48.5, 22.8),
    5514: (48.6, 12.2, 51, 22.5),  # Krovak
    3035: (35, -10, 70, 30),  # Lambert azimuthal equal area
    3571: (50, -180, 89, 180),
    3031: (-89, -180, -65, 180),  # polar stereographic, by a parallel and by the scale at the pole
    3413: (62, -180, 89, 180),
    5041: (62, -180, 89, 180),
    3395: (-75, -170, 75, 170),  # Mercator, by the scale and by a parallel
    3388: (36.5, 46, 47, 54),
    3005: (48, -138, 60, -114),  # Albers
    31370: (49.5, 2.5, 51.5, 6.4),
    5345: (-52, -67.5, -24, -64.5),  # from the pole
    3067: (59, 19, 70, 31),
    2180: (49, 14, 55, 24),
}


def geodetic_of(crs):
    """The geographic system under a projected one: no shift of datum takes part."""
    return crs.geodetic_crs


def systems(random):
    rows = []
    for code, (south, west, north, east) in SYSTEMS.items():
        crs = CRS.from_epsg(code)
        to_map = Transformer.from_crs(geodetic_of(crs), crs, always_xy=True)
        points = []
        for _ in range(POINTS):
            latitude, longitude = random.uniform(south, north), random.uniform(west, east)
            x, y = to_map.transform(longitude, latitude)
            points.append([latitude, longitude, x, y])
        rows.append(
            {
                "epsg": code,
                "wkt1": crs.to_wkt("WKT1_GDAL"),
                "wkt2": crs.to_wkt("WKT2_2019"),
                "points": points,
            }
        )
    return rows


def geocentric_of(crs):
    """Earth-centred coordinates on the datum of a system."""
    geodetic = geodetic_of(crs)
    return CRS.from_json_dict(
        {
            "$schema": "https://proj.org/schemas/v0.7/projjson.schema.json",
            "type": "GeodeticCRS",
            "name": f"{geodetic.name} (earth-centred)",
            "datum" if "datum" in geodetic.to_json_dict() else "datum_ensemble": geodetic.to_json_dict().get("datum")
            or geodetic.to_json_dict()["datum_ensemble"],
            "coordinate_system": {
                "subtype": "Cartesian",
                "axis": [
                    {"name": f"Geocentric {a}", "abbreviation": a, "direction": f"geocentric{a}", "unit": "metre"}
                    for a in "XYZ"
                ],
            },
        }
    )


def rotation(random):
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def cameras(random):
    rows = []
    for code, longitude, latitude in [(25832, 7.736, 51.088), (31467, 9.9, 47.6), (32733, 12.5, -22.9), (2154, 6.4, 45.2)]:
        crs = CRS.from_epsg(code)
        geographic = geodetic_of(crs).to_3d()
        earth = geocentric_of(crs)
        to_earth = Transformer.from_crs(geographic, earth, always_xy=True)
        to_map = Transformer.from_crs(geographic, crs.to_3d(), always_xy=True)
        from_map = Transformer.from_crs(crs.to_3d(), geographic, always_xy=True)
        for number in range(4):
            lon, lat, height = longitude + random.normal() * 1e-3, latitude + random.normal() * 1e-3, 300 + 30 * number
            centre = np.array(to_earth.transform(lon, lat, height))
            on_map = np.array(to_map.transform(lon, lat, height))
            turn = rotation(random)
            points = []
            while len(points) < 20:
                point = on_map + random.uniform(-60, 60, 3)
                lon_p, lat_p, h_p = from_map.transform(*point)
                seen = turn.T @ (np.array(to_earth.transform(lon_p, lat_p, h_p)) - centre)
                pixel = 3000 * seen[:2] / seen[2] + [2000, 1500]
                if seen[2] > 5 and (0 < pixel[0] < 4000) and (0 < pixel[1] < 3000):
                    points.append([*point, *pixel])
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = turn, centre
            rows.append(
                {
                    "epsg": code,
                    "geographic": geodetic_of(crs).to_epsg(),
                    "pose": pose.flatten().tolist(),
                    "centre": on_map.tolist(),
                    "points": points,
                }
            )
    return rows


def main():
    random = np.random.default_rng(7)
    content = {"systems": systems(random), "cameras": cameras(random)}
    (FOLDER / "expected.json").write_text(json.dumps(content, indent=1) + "\n")


main()
