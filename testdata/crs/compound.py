"""Writes compound.json: compound systems of the EPSG register as PROJ has them. Needs pyproj.

systems:   code, name, codes of the parts from PROJ's database, and name, unit (metres) and direction of the vertical part; without
           EPSG:6871, whose map WKT 1 cannot express.
wkt:       definitions of some of them as WKT 1 and 2.
projjson:  the same of those of a projected system.
"""

import json
import pathlib
import sqlite3
import warnings

from pyproj import CRS, datadir

warnings.filterwarnings("ignore")
CODES = [7415, 5555, 7405, 5698, 9518, 5318, 6649, 8350, 8769, 9450, 9457]
database = sqlite3.connect(pathlib.Path(datadir.get_data_dir()) / "proj.db")
parts = database.execute(
    "SELECT code, horiz_crs_code, vertical_crs_code FROM compound_crs WHERE auth_name = 'EPSG' AND code != '6871' "
    "ORDER BY CAST(code AS INTEGER)"
)
systems = []
for code, horizontal, vertical in parts:
    height = CRS.from_epsg(vertical)
    axis = height.axis_info[0]
    systems.append(
        {
            "code": int(code),
            "name": CRS.from_epsg(code).name,
            "horizontal": int(horizontal),
            "vertical_code": int(vertical),
            "vertical": height.name,
            "metres": axis.unit_conversion_factor,
            "direction": axis.direction,
        }
    )


def projjson(code):
    definition = CRS.from_epsg(code).to_json_dict()
    for key in ("usages", "scope", "area", "bbox", "remarks"):
        definition.pop(key, None)
    definition["components"][0] = {"name": definition["components"][0]["name"]}
    return definition


wkt = [{"code": c, "wkt1": CRS.from_epsg(c).to_wkt("WKT1_GDAL"), "wkt2": CRS.from_epsg(c).to_wkt("WKT2_2019")} for c in CODES]
projected = [c for c in CODES if CRS.from_epsg(c).sub_crs_list[0].is_projected]
parts = {"systems": systems, "wkt": wkt, "projjson": [projjson(c) for c in projected]}
texts = [f'"{name}": [\n' + ",\n".join(json.dumps(row) for row in rows) + "\n]" for name, rows in parts.items()]
pathlib.Path(__file__).with_name("compound.json").write_text("{" + ",\n".join(texts) + "}\n")
