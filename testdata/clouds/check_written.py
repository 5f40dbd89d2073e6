"""Reads with laspy and pyarrow what the tests of stonewise-io write, and compares names and values.

From the root of the repository, with laspy[lazrs], numpy and pyarrow:
    STONEWISE_KEEP=/tmp/kept cargo test -p stonewise-io && python testdata/clouds/check_written.py /tmp/kept
"""
import pathlib
import sys

import laspy
import numpy as np
import pyarrow.parquet

kept = pathlib.Path(sys.argv[1])

points = laspy.read(kept / "m3c2.laz")
i = np.arange(120_000)
assert points.header.version == laspy.header.Version(1, 4) and points.point_format.id == 6
assert list(points.point_format.extra_dimension_names) == [
    "m3c2_distance", "m3c2_std_dev1", "m3c2_count1", "m3c2_significant"]
assert np.array_equal(points.m3c2_distance, i / 7)
assert np.array_equal(points.m3c2_std_dev1, (i.astype("f4") / np.float32(3)))
assert np.array_equal(points.m3c2_count1, i[::-1]) and points.m3c2_count1.dtype == np.uint32
assert np.array_equal(points.m3c2_significant, i % 2) and points.m3c2_significant.dtype == np.uint16
assert np.abs(points.x - (4e5 + i * 0.001234)).max() < 0.51e-6
assert np.abs(points.z - 90.123456).max() < 0.51e-6
print("m3c2.laz: names, types and values as written")

before = laspy.read(pathlib.Path(__file__).parent / "las14_format7_extra.laz")
after = laspy.read(kept / "labelled.laz")
n = np.arange(len(before))
for name in before.point_format.dimension_names:
    if name != "stone_id":
        assert np.array_equal(before[name], after[name]), name
assert list(after.point_format.extra_dimension_names) == [
    "reflectance", "normal", "stone_id", "dx", "dy", "dz", "significant"]
assert np.array_equal(after.stone_id, np.where(n % 3 == 0, 0, n)) and after.stone_id.dtype == np.uint32
moved = n % 3 == 2
assert np.array_equal(np.isnan(after.dx), ~moved) and np.array_equal(after.dx[moved], n[moved])
assert np.all(after.dz[moved] == np.float32(-0.05))
assert np.array_equal(after.significant, moved & (n % 2 == 0)) and after.significant.dtype == np.uint16
assert np.array_equal(before.header.scales, after.header.scales)
assert np.array_equal(before.header.offsets, after.header.offsets)
assert [v.string for v in before.vlrs if v.record_id == 2112] == [v.string for v in after.vlrs if v.record_id == 2112]
print("labelled.laz: the attributes of the input, and the labels")

table = pyarrow.parquet.read_table(kept / "table.parquet")
types = {field.name: str(field.type) for field in table.schema}
assert types == {"x": "float", "y": "double", "i": "int64", "u": "uint64", "id": "uint32", "file": "uint16",
                 "small": "uint8", "flag": "bool", "name": "string"}, types
rows = table.to_pydict()
assert rows["y"] == [1.0, None, 0.0] and rows["id"] == [2**32 - 1, None, 0] and rows["u"] == [2**64 - 1, 0, 7]
assert rows["i"] == [-(2**63), 0, 7] and rows["flag"] == [True, False, None] and rows["name"] == ["Größe", None, ""]
assert rows["x"][0] == 0.5 and rows["x"][1] != rows["x"][1] and rows["file"] == [65535, 0, 1]
assert table.schema.metadata == {b"origin": b"[1.25, -3.0, 1e300]", b"empty": b""}, table.schema.metadata
print("table.parquet: types, values, empty cells and metadata")
