"""Writes units.json: codes of the EPSG register whose first two axes are in feet, and all other projected, geographic and compound
ones up to 32767, as PROJ has them. Needs pyproj."""

import json
import pathlib

from pyproj import CRS
from pyproj.database import query_crs_info
from pyproj.enums import PJType

KINDS = [PJType.PROJECTED_CRS, PJType.GEOGRAPHIC_2D_CRS, PJType.GEOGRAPHIC_3D_CRS, PJType.COMPOUND_CRS]
feet, other = [], []
for info in query_crs_info("EPSG", KINDS, allow_deprecated=True):
    code = int(info.code)
    axes = CRS.from_epsg(code).axis_info[:2]
    in_feet = all(abs(axis.unit_conversion_factor - 0.3048) < 1e-5 for axis in axes)
    if code <= 32767:
        (feet if in_feet else other).append(code)
path = pathlib.Path(__file__).parent / "units.json"
path.write_text(json.dumps({"feet": sorted(feet), "other": sorted(other)}) + "\n")
