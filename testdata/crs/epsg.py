"""Writes crates/stonewise-io/src/crs/epsg.tsv.zz: all projected systems of the EPSG register that WKT 1 can express, the
geographic and vertical ones, and what is compound of them, as PROJ has them. Needs pyproj. From the root of the repository:
python3 testdata/crs/epsg.py

Lines of cells between tabs, deflated (zlib). A cell is a number of an earlier line of its kind, counted from 0, where it
names one:
    S  name, semi-major axis (m), inverse flattening
    G  code less that of the line before, name, datum, spheroid, prime meridian (name, degrees), unit (name, size in radians)
    U  name, size in metres, order of the axes (EN, NE, or nothing where an axis points elsewhere, as about a pole)
    M  projection, names of its parameters
    P  code less that of the line before, name behind that of the geographic system, G, M, U, parameters
    V  code less that of the line before, name, datum, unit (name, size in metres), direction (UP, DOWN)
    C  code less that of the line before, name or nothing where it is made of those of the parts, codes of G or P and of V
"""

import re
import warnings
import zlib
from pathlib import Path

from pyproj import CRS, Transformer, database
from pyproj.enums import PJType
from pyproj.exceptions import CRSError, ProjError

warnings.filterwarnings("ignore")
QUOTED = r'"([^"]*)"'
NUMBER = r"([-+.0-9eE]+)"
AXES = {("east", "north"): "EN", ("north", "east"): "NE"}
HORIZONTAL = [{"east", "north"}, {"north"}, {"south"}]


def number(text):
    """The shortest text of the same number."""
    value = float(text)
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


def wkt1(code):
    try:
        return CRS.from_epsg(code).to_wkt("WKT1_GDAL")
    except CRSError:
        return ""


def codes(kind):
    found = database.query_crs_info("EPSG", [kind], allow_deprecated=True)
    return sorted({int(info.code) for info in found})


def is_expressed(text, crs):
    """Whether WKT 1 without axes means the same map."""
    if "EXTENSION[" in text:
        return False
    area = crs.area_of_use
    middle = ((area.west + area.east) / 2 if area.west < area.east else area.east, (area.south + area.north) / 2)
    plain = CRS.from_wkt(re.sub(r",AXIS\[[^\]]*\]", "", text))
    try:
        a, b = (Transformer.from_crs(c.geodetic_crs, c, always_xy=True).transform(*middle) for c in (crs, plain))
    except ProjError:
        return False
    return max(abs(u - v) for u, v in zip(a, b)) < 1e-3


class Kind:
    """Lines of one kind, each once."""

    def __init__(self, letter):
        self.letter, self.place = letter, {}

    def of(self, *cells):
        line = "\t".join([self.letter, *map(str, cells)])
        return self.place.setdefault(line, len(self.place))

    def lines(self):
        return list(self.place)


spheroids, units, methods = Kind("S"), Kind("U"), Kind("M")
geographic, names, last = {}, {}, 0
lines = []
for code in codes(PJType.GEOGRAPHIC_2D_CRS):
    text = wkt1(code)
    found = re.match(
        rf"GEOGCS\[{QUOTED},DATUM\[{QUOTED},SPHEROID\[{QUOTED},{NUMBER},{NUMBER}.*?PRIMEM\[{QUOTED},{NUMBER}.*?"
        rf"UNIT\[{QUOTED},{NUMBER}",
        text,
    )
    if not found:
        continue
    name, datum, spheroid, axis, inverse, meridian, degrees, unit, size = found.groups()
    ellipsoid = spheroids.of(spheroid, number(axis), number(inverse))
    geographic[code], names[code] = len(geographic), name
    cells = [code - last, name, datum, ellipsoid, meridian, number(degrees), unit, number(size)]
    lines.append("\t".join(["G", *map(str, cells)]))
    last = code

projected, map_names, last, skipped = [], {}, 0, 0
for code in codes(PJType.PROJECTED_CRS):
    text = wkt1(code)
    crs = CRS.from_epsg(code)
    base = re.search(r'AUTHORITY\["EPSG","(\d+)"\]\],PROJECTION', text)
    found = re.search(rf"^PROJCS\[{QUOTED},.*PROJECTION\[{QUOTED}\](.*)$", text)
    directions = tuple(axis.direction for axis in crs.axis_info[:2])
    if not found or not base or int(base[1]) not in geographic or set(directions) not in HORIZONTAL or not is_expressed(text, crs):
        skipped += 1
        continue
    name, method, rest = found.groups()
    unit, size = re.search(rf"UNIT\[{QUOTED},{NUMBER}", rest).groups()
    parameters = re.findall(rf"PARAMETER\[{QUOTED},{NUMBER}\]", rest)
    map_names[code] = name
    own = names[int(base[1])] + " / "
    name = "/" + name[len(own) :] if name.startswith(own) else name
    cells = [
        code - last,
        name,
        geographic[int(base[1])],
        methods.of(method, *[p for p, _ in parameters]),
        units.of(unit, number(size), AXES.get(directions, "")),
        *[number(v) for _, v in parameters],
    ]
    projected.append("\t".join(["P", *map(str, cells)]))
    last = code

vertical, verticals, last = [], {}, 0
for code in codes(PJType.VERTICAL_CRS):
    found = re.match(
        rf"VERT_CS\[{QUOTED},VERT_DATUM\[{QUOTED}.*?UNIT\[{QUOTED},{NUMBER}.*?AXIS\[{QUOTED},(UP|DOWN)\]", wkt1(code)
    )
    if not found:
        continue
    name, datum, unit, size, _, direction = found.groups()
    verticals[code] = name
    vertical.append("\t".join(["V", str(code - last), name, datum, unit, number(size), direction]))
    last = code

horizontal = names | map_names
compound, last = [], 0
for code in codes(PJType.COMPOUND_CRS):
    found = re.match(
        rf'COMPD_CS\[{QUOTED},.*AUTHORITY\["EPSG","(\d+)"\]\],VERT_CS\[.*AUTHORITY\["EPSG","(\d+)"\]\],AUTHORITY', wkt1(code)
    )
    if not found or int(found[2]) not in horizontal or int(found[3]) not in verticals:
        print("not compound of systems of the table:", code)
        continue
    name, flat, height = found[1], int(found[2]), int(found[3])
    name = "" if name == f"{horizontal[flat]} + {verticals[height]}" else name
    compound.append("\t".join(["C", str(code - last), name, str(flat), str(height)]))
    last = code

kinds = [spheroids.lines(), lines, units.lines(), methods.lines(), projected, vertical, compound]
table = "\n".join(line for kind in kinds for line in kind) + "\n"
packed = zlib.compress(table.encode(), 9)
path = Path(__file__).parents[2] / "crates/stonewise-io/src/crs/epsg.tsv.zz"
path.write_bytes(packed)
print(f"PROJ {database.get_database_metadata('EPSG.VERSION')}: {len(geographic)} geographic systems, {len(projected)} projected, "
      f"{skipped} left out, {len(vertical)} vertical, {len(compound)} compound, {len(methods.place)} methods; "
      f"{len(table)} bytes, packed {len(packed)}")
