"""PROJJSON of projected systems as PROJ writes it, for GeoParquet. Needs pyproj. From this folder:

    python3 projjson.py              writes projjson.json: systems of every method that stonewise can write, with both orders of axes
    python3 projjson.py LINES        counts the systems of a file (one PROJJSON a line, of `lab projjson`) that PROJ takes for the
                                     register's own of that code
"""

import json
import pathlib
import sys

from pyproj import CRS

CODES = [
    25832, 31467, 27700, 2193, 26911, 2264,  # transverse Mercator; axes to the north first; feet
    2154, 31370, 3034, 27572, 3812,  # Lambert conic of one and of two parallels; Paris and grads
    28992, 2171,  # oblique stereographic
    2056, 21781, 23700,  # oblique Mercator as the Swiss and Hungarians use it
    3078, 29873,  # oblique Mercator to the equator
    5514, 5221,  # Krovak
    3035,  # Lambert azimuthal
    3005, 5070,  # Albers
    2066, 28191,  # Cassini-Soldner
    3395, 3001,  # Mercator
]


def written():
    definitions = []
    for code in CODES:
        definition = CRS.from_epsg(code).to_json_dict()
        for key in ("usages", "scope", "area", "bbox", "remarks"):
            definition.pop(key, None)
        datum = definition["base_crs"].get("datum_ensemble", {})
        datum.pop("members", None)
        definitions.append(definition)
    return definitions


def compared(path):
    equal, other = 0, []
    for line in path.read_text().splitlines():
        definition = json.loads(line)
        code = definition["id"]["code"]
        found = CRS.from_json_dict(definition)
        if found == CRS.from_epsg(code) and found.to_epsg() == code:
            equal += 1
        else:
            other.append(code)
    print(f"{equal} systems are PROJ's own of their code; not: {other}")


if len(sys.argv) > 1:
    compared(pathlib.Path(sys.argv[1]))
else:
    lines = ",\n".join(json.dumps(definition) for definition in written())
    pathlib.Path(__file__).with_name("projjson.json").write_text(f"[\n{lines}\n]\n")
