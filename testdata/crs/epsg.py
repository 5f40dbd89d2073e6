"""Writes crates/stonewise-io/src/crs/epsg.tsv.zz: all projected systems of the EPSG register that WKT 1 can express, and the
geographic ones, as PROJ has them. Needs pyproj. From the root of the repository: python3 testdata/crs/epsg.py

Lines of cells between tabs, deflated (zlib). A cell is a number of an earlier line of its kind, counted from 0, where it
names one:
    S  name, semi-major axis (m), inverse flattening
    G  code less that of the line before, name, datum, spheroid, prime meridian (name, degrees), unit (name, size in radians)
    U  name, size in metres, order of the axes (EN, NE, or nothing where an axis points elsewhere, as about a pole)
    M  projection, names of its parameters
    P  code less that of the line before, name behind that of the geographic system, G, M, U, parameters
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

projected, last, skipped = [], 0, 0
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

table = "\n".join(spheroids.lines() + lines + units.lines() + methods.lines() + projected) + "\n"
packed = zlib.compress(table.encode(), 9)
path = Path(__file__).parents[2] / "crates/stonewise-io/src/crs/epsg.tsv.zz"
path.write_bytes(packed)
print(f"PROJ {database.get_database_metadata('EPSG.VERSION')}: {len(geographic)} geographic systems, {len(projected)} projected, "
      f"{skipped} left out, {len(methods.place)} methods; {len(table)} bytes, packed {len(packed)}")
