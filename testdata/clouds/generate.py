"""Writes one small cloud in every format, with programs that share no code with stonewise.

Every file holds the same points, so that a test can compute them again:
    x = 350000 + i / 100, y = 5650000 - i / 50, z = 100 + (i * i % 97) / 1000, metres, for i = 0 .. 119
    red, green, blue = 500 i, 65535 - 500 i, 257 (i % 256); intensity = 7 i
Formats with 8-bit colours hold the high byte. Run here: python generate.py
Needs numpy, laspy[lazrs], lazrs, pye57, plyfile.
"""
import io
import struct

import laspy
import lazrs
import numpy as np
import plyfile
import pye57
from laspy.vlrs.vlr import VLR

N = 120
i = np.arange(N)
x, y, z = 350000 + i / 100, 5650000 - i / 50, 100 + (i * i % 97) / 1000
rgb = np.stack([500 * i, 65535 - 500 * i, 257 * (i % 256)], axis=1).astype(np.uint16)
intensity = (7 * i).astype(np.uint16)
WKT = 'PROJCS["ETRS89 / UTM zone 32N",GEOGCS["ETRS89"],UNIT["metre",1]]\0'


def las(name, version, point_format, wkt=False, extra=False, geokeys=False):
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = [0.001] * 3, [350000, 5650000, 0]
    if extra:
        header.add_extra_dim(laspy.ExtraBytesParams("reflectance", "f4", "dB"))
        header.add_extra_dim(laspy.ExtraBytesParams("normal", "3f4"))
        header.add_extra_dim(laspy.ExtraBytesParams("stone_id", "u1", "an earlier run"))
    if wkt:
        header.vlrs.append(VLR("LASF_Projection", 2112, "WKT", WKT.encode()))
        header.global_encoding.wkt = True
    if geokeys:
        keys = [1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 25832]
        header.vlrs.append(VLR("LASF_Projection", 34735, "", struct.pack("<12H", *keys)))
    header.vlrs.append(VLR("some program", 7, "kept as it is", b"payload"))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z, cloud.intensity = x, y, z, intensity
    cloud.classification, cloud.user_data, cloud.point_source_id = i % 7, i % 250, 900 + i
    cloud.return_number, cloud.number_of_returns = 1 + i % 3, np.full(N, 3)
    dims = list(cloud.point_format.dimension_names)
    if "red" in dims:
        cloud.red, cloud.green, cloud.blue = rgb.T
    if "gps_time" in dims:
        cloud.gps_time = 1e5 + i / 7
    if "nir" in dims:
        cloud.nir = 3 * i
    if extra:
        cloud.reflectance, cloud.stone_id = -i / 10, i % 7
        cloud.normal = np.stack([i, -i, i / 2], axis=1)
    cloud.write(name)


def las10(name):
    """LAS 1.0 out of 1.2: two bytes of signature stand before the points."""
    las("tmp.las", "1.2", 1)
    data = bytearray(open("tmp.las", "rb").read())
    start = struct.unpack_from("<I", data, 96)[0]
    data[25] = 0
    data[start:start] = b"\xdd\xcc"
    struct.pack_into("<I", data, 96, start + 2)
    struct.pack_into("<HH", data, 4, 0, 0)
    open(name, "wb").write(data)


def copc(name):
    """A COPC file of one root node and two children, each a chunk of its own size; the CRS is the second EVLR."""
    las("tmp.las", "1.4", 7)
    raw = bytearray(open("tmp.las", "rb").read())
    points = raw[struct.unpack_from("<I", raw, 96)[0] :]
    vlr = lazrs.LazVlr.new_for_compression(7, 0, True)
    laz_data = bytes(vlr.record_data())

    def record(user, number, data, extended=False):
        head = struct.pack("<H16sH", 0, user.encode(), number)
        return head + struct.pack("<Q" if extended else "<H", len(data)) + bytes(32) + data

    start = 375 + (54 + 160) + (54 + len(laz_data))
    out = io.BytesIO(bytes(start))
    out.seek(start)
    compressor = lazrs.LasZipCompressor(out, vlr)
    places = []
    compressor.reserve_offset_to_chunk_table()
    for a, b in [(0, 50), (50, 57), (57, N)]:
        before = out.tell()
        compressor.compress_many(bytes(points[36 * a : 36 * b]))
        compressor.finish_current_chunk()
        places.append((before, out.tell() - before, b - a))
    compressor.done()
    body = out.getvalue()
    evlr = len(body)
    keys = [(0, 0, 0, 0), (1, 0, 0, 0), (1, 1, 1, 0)]
    pages = b"".join(struct.pack("<iiiiQii", *k, at, size, n) for k, (at, size, n) in zip(keys, places))
    centre = [float(v.mean()) for v in (x, y, z)]
    info = struct.pack("<5d2Q2d", *centre, 5.0, 0.1, evlr + 60, len(pages), 1e5, 2e5) + bytes(88)
    header = bytearray(raw[:375])
    header[104] = 7 | 0x80
    struct.pack_into("<I", header, 96, start)
    struct.pack_into("<I", header, 100, 2)
    struct.pack_into("<QI", header, 235, evlr, 2)
    head = bytes(header) + record("copc", 1, info) + record("laszip encoded", 22204, laz_data)
    assert len(head) == start
    tail = record("copc", 1000, pages, True) + record("LASF_Projection", 2112, WKT.encode(), True)
    open(name, "wb").write(head + body[start:] + tail)
    with laspy.CopcReader.open(name) as check:
        assert len(check.query()) == N


def e57(name):
    """Two scans with poses, of 70 and 50 points; scan 2 also has three invalid points in front."""
    half = np.pi / 6
    poses = [
        (np.array([np.cos(half), 0, 0, np.sin(half)]), np.array([349990.0, 5650010.0, 101.5])),
        (np.array([0.5, 0.5, 0.5, 0.5]), np.array([350002.0, 5649990.0, 99.0])),
    ]
    file = pye57.E57(name, mode="w")
    for part, (rotation, translation) in zip([slice(0, 70), slice(70, N)], poses):
        world = np.stack([x, y, z], axis=1)[part]
        local = (world - translation) @ matrix(rotation)
        color = rgb[part] // 257
        data = {
            "cartesianX": local[:, 0], "cartesianY": local[:, 1], "cartesianZ": local[:, 2],
            "colorRed": color[:, 0], "colorGreen": color[:, 1], "colorBlue": color[:, 2],
            "intensity": intensity[part].astype(float),
        }
        if part.start:
            data = {k: np.concatenate([np.zeros(3, v.dtype), v]) for k, v in data.items()}
            data["cartesianInvalidState"] = np.array([2] * 3 + [0] * len(local), dtype="i1")
        file.write_scan_raw(data, name=f"station {1 + (part.start > 0)}", rotation=rotation, translation=translation)
    file.close()


def matrix(q):
    w, a, b, c = q
    return np.array([
        [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
        [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
        [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
    ])


def ply(name, text, order):
    """A list element before the vertices, faces behind, and a list among the properties of the vertices.

    plyfile 1.1.5 does not turn the bytes of rows with lists, so the big-endian file goes without that one.
    """
    kinds = [("x", "f8"), ("flag", "i2"), ("y", "f8"), ("z", "f8")]
    kinds += [("red", "u1"), ("green", "u1"), ("blue", "u1")]
    kinds += [] if order == ">" else [("near", "O")]
    vertices = np.empty(N, dtype=kinds + [("scalar_Intensity", "f4")])
    vertices["x"], vertices["y"], vertices["z"], vertices["flag"] = x, y, z, -i
    vertices["red"], vertices["green"], vertices["blue"] = (rgb // 257).T
    vertices["scalar_Intensity"] = intensity
    if order != ">":
        vertices["near"] = [np.arange(k % 4, dtype="i4") for k in i]
    strips = np.array([([1, 2, 3],), ([4],)], dtype=[("list", "O")])
    faces = np.array([([0, 1, 2],)], dtype=[("vertex_indices", "i4", (3,))])
    plyfile.PlyData(
        [
            plyfile.PlyElement.describe(strips, "strip", val_types={"list": "u2"}),
            plyfile.PlyElement.describe(vertices, "vertex", val_types={"near": "i4"}),
            plyfile.PlyElement.describe(faces, "face"),
        ],
        text=text, byte_order=order, comments=["made for a test"],
    ).write(name)
    back = plyfile.PlyData.read(name)["vertex"]
    assert np.array_equal(back["x"], x) and np.array_equal(back["z"], z)


def text(name, separator, header, columns, decimal="."):
    with open(name, "w", newline="\r\n" if name.endswith("csv") else "\n") as out:
        out.write(header)
        for row in zip(*columns):
            out.write(separator.join(str(v).replace(".", decimal) for v in row) + "\n")


def ptx(name):
    """Two scans; every tenth place of the grid has no echo. The second scanner is turned and tilted."""
    turns = [np.eye(3), rotation(0.3, 0.02, -0.7)]
    stations = np.array([[349990.0, 5650010.0, 101.5], [350020.0, 5649980.0, 99.25]])
    with open(name, "w", newline="\r\n") as out:
        for turn, station, part in zip(turns, stations, [i[:70], i[70:]]):
            local = (np.stack([x, y, z], axis=1)[part] - station) @ turn
            grid = len(part) + len(part) // 10
            out.write(f"{grid // 11}\n11\n" + " ".join(f"{v:.6f}" for v in station) + "\n")
            rows = np.hstack([turn.T, np.zeros((3, 1))])
            for row in turn.T:
                out.write(" ".join(f"{v:.15f}" for v in row) + "\n")
            for row in [*rows, [*station, 1.0]]:
                out.write(" ".join(f"{v:.15f}" for v in row) + "\n")
            for k, (p, q) in enumerate(zip(local, part)):
                out.write(" ".join(f"{v:.10f}" for v in p) + f" {7 * q / 1000:.6f} ")
                out.write(" ".join(str(c // 257) for c in rgb[q]) + "\n")
                if k % 10 == 9:
                    out.write("0 0 0 0.500000 0 0 0\n")


def rotation(z_turn, y_turn, x_turn):
    (a, b, c), (d, e, f) = np.cos([z_turn, y_turn, x_turn]), np.sin([z_turn, y_turn, x_turn])
    return (np.array([[a, -d, 0], [d, a, 0], [0, 0, 1]]) @ np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
            @ np.array([[1, 0, 0], [0, c, -f], [0, f, c]]))


xyz = [[f"{v:.3f}" for v in axis] for axis in (x, y, z)]
colors = list((rgb // 257).T)
las10("las10_format1.las")
las("las11_format0.las", "1.1" if "1.1" in laspy.supported_versions() else "1.2", 0)
las("las12_format3.las", "1.2", 3, geokeys=True)
las("las12_format2.laz", "1.2", 2)
las("las13_format1.laz", "1.3", 1)
las("las14_format6.laz", "1.4", 6, wkt=True)
las("las14_format7_extra.laz", "1.4", 7, wkt=True, extra=True)
las("las14_format8.las", "1.4", 8)
copc("chunks.copc.laz")
e57("two_scans.e57")
ply("text.ply", True, "=")
ply("little.ply", False, "<")
ply("big.ply", False, ">")
text("plain.xyz", " ", "# a comment\n\n", xyz + colors)
text("tabs.txt", "\t", "//X\tY\tZ\tIntensity\n", xyz + [intensity])
text("header.csv", ",", '"id","Y [m]","X [m]","Z [m]",R,G,B\n', [i, xyz[1], xyz[0], xyz[2]] + colors)
text("german.csv", ";", "x;y;z;intensity\n", xyz + [intensity], decimal=",")
text("count.pts", " ", f"{N}\n", xyz + [intensity] + colors)
ptx("two_scans.ptx")
