"""Makes the fixtures in this folder: what other implementations say about camera models and camera files.

lens.json      pixels of points in the camera frame, by OpenCV's projectPoints and fisheye.projectPoints, and by the
               formulae of Metashape's user manual (appendix "Camera models") written out in numpy below.
metashape.xml, colmap_bin/, colmap_txt/, opensfm.json, pix4d/, realitycapture/
               camera files with every model that is read, and expected.json with the pixels of world points in each.
rejected/      COLMAP folders that must be refused.

Run: python3 generate.py   (needs numpy and opencv-python-headless; OpenCV 5.0.0 and numpy 2.4.6 made the files)
"""
import json
import struct
from pathlib import Path

import cv2
import numpy as np

HERE = Path(__file__).parent
rng = np.random.default_rng(20260411)


def rounded(rows):
    return [[float(repr(float(v))) for v in row] for row in rows]


# ---------------------------------------------------------------- models

def opencv(points, fx, fy, cx, cy, dist):
    """points: n x 3 in the camera frame; dist in OpenCV's order k1 k2 p1 p2 [k3 [k4 k5 k6]]."""
    k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    pixels, _ = cv2.projectPoints(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), k, np.array(dist, float))
    return pixels.reshape(-1, 2)


def opencv_fisheye(points, fx, fy, cx, cy, dist):
    k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    pixels, _ = cv2.fisheye.projectPoints(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), k, np.array(dist, float))
    return pixels.reshape(-1, 2)


def metashape(points, width, height, c, fisheye=False):
    """Metashape's frame and fisheye cameras; c: dict of f cx cy b1 b2 k1..k4 p1 p2."""
    g = lambda name: c.get(name, 0.0)
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    if fisheye:
        r0 = np.sqrt(x**2 + y**2)
        x, y = x * np.arctan(r0) / r0, y * np.arctan(r0) / r0
    r = np.sqrt(x**2 + y**2)
    radial = 1 + g("k1") * r**2 + g("k2") * r**4 + g("k3") * r**6 + g("k4") * r**8
    xd = x * radial + g("p1") * (r**2 + 2 * x**2) + 2 * g("p2") * x * y
    yd = y * radial + g("p2") * (r**2 + 2 * y**2) + 2 * g("p1") * x * y
    u = width * 0.5 + g("cx") + xd * g("f") + xd * g("b1") + yd * g("b2")
    v = height * 0.5 + g("cy") + yd * g("f")
    return np.stack([u, v], axis=1)


def rays(width, height, f, n=40, spread=0.55):
    """Points whose undistorted pixels spread over the image, at depths from 2 to 50 m."""
    uv = rng.uniform(-spread, spread, (n, 2)) * [width, height]
    z = rng.uniform(2, 50, n)
    return np.stack([uv[:, 0] / f * z, uv[:, 1] / f * z, z], axis=1)


def wide_rays(n=40, max_angle=1.2):
    theta, phi = rng.uniform(0.01, max_angle, n), rng.uniform(0, 2 * np.pi, n)
    d = rng.uniform(2, 50, n)
    return np.stack([np.sin(theta) * np.cos(phi) * d, np.sin(theta) * np.sin(phi) * d, np.cos(theta) * d], axis=1)


# ---------------------------------------------------------------- lens.json

W, H = 4000, 3000
FX, FY, CX, CY = 2900.5, 2897.25, 2011.7, 1490.3
K = [-0.12, 0.083, -0.017]
P = [0.0011, -0.00074]
RATIONAL = [0.034, -0.012, 0.0061]


def lens_case(name, model, points, pixels, radial=(), rational=(), tangential=(), focal=(FX, FY), center=(CX, CY), skew=0.0):
    pad = lambda v, n: list(v) + [0.0] * (n - len(v))
    return {
        "name": name, "model": model, "width": W, "height": H, "focal_px": list(focal), "center_px": list(center),
        "skew_px": skew, "radial": pad(radial, 4), "rational": pad(rational, 3), "tangential": pad(tangential, 2),
        "points": rounded(np.hstack([points, pixels])),
    }


def lens_cases():
    fish = [0.031, -0.0142, 0.0051, -0.0009]
    p = rays(W, H, FX)
    yield lens_case("pinhole", "brown", p, opencv(p, FX, FY, CX, CY, [0, 0, 0, 0]))
    p = rays(W, H, FX)
    yield lens_case("simple radial", "brown", p, opencv(p, FX, FX, CX, CY, [K[0], 0, 0, 0]), K[:1], focal=(FX, FX))
    p = rays(W, H, FX)
    yield lens_case("radial", "brown", p, opencv(p, FX, FX, CX, CY, [K[0], K[1], 0, 0]), K[:2], focal=(FX, FX))
    p = rays(W, H, FX)
    yield lens_case("opencv", "brown", p, opencv(p, FX, FY, CX, CY, K[:2] + P), K[:2], (), P)
    p = rays(W, H, FX)
    yield lens_case("opencv k3", "brown", p, opencv(p, FX, FY, CX, CY, K[:2] + P + K[2:]), K, (), P)
    p = rays(W, H, FX)
    yield lens_case("full opencv", "brown", p, opencv(p, FX, FY, CX, CY, K[:2] + P + K[2:] + RATIONAL), K, RATIONAL, P)
    p = wide_rays()
    f = 1400.0
    yield lens_case("fisheye", "fisheye", p, opencv_fisheye(p, f, f + 3, CX, CY, fish), fish, focal=(f, f + 3))
    c = {"f": 2897.25, "cx": 11.7, "cy": -9.7, "b1": 3.25, "b2": -1.75, "k1": -0.11, "k2": 0.041, "k3": -0.013, "k4": 0.0047,
         "p1": 0.0013, "p2": -0.0008}
    p = rays(W, H, FX)
    common = dict(radial=[c["k1"], c["k2"], c["k3"], c["k4"]], tangential=[c["p2"], c["p1"]], skew=c["b2"],
                  center=(W / 2 + c["cx"], H / 2 + c["cy"]))
    yield lens_case("metashape frame", "brown", p, metashape(p, W, H, c), focal=(c["f"] + c["b1"], c["f"]), **common)
    c["f"] = 1400.0
    p = wide_rays()
    yield lens_case("metashape fisheye", "fisheye", p, metashape(p, W, H, c, True), focal=(c["f"] + c["b1"], c["f"]), **common)


# ---------------------------------------------------------------- poses and files

def quaternion_to_matrix(q):
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def random_quaternion():
    q = rng.normal(size=4)
    return q / np.linalg.norm(q) * np.sign(q[0])


OFFSET = np.array([451.5, 678.25, 312.0])


def random_pose():
    """World to camera: quaternion, translation; the camera within 20 m of OFFSET."""
    q = random_quaternion()
    centre = OFFSET + rng.uniform(-20, 20, 3)
    return q, -quaternion_to_matrix(q) @ centre


def world_rows(points, pixels, q, t):
    world = (points - t) @ quaternion_to_matrix(q)
    return rounded(np.hstack([world, pixels]))


def num(values):
    return " ".join(f"{v:.17g}" for v in values)


COLMAP = [
    # id, model number, name, params, function
    (0, "SIMPLE_PINHOLE", [FX, CX, CY], lambda p, a: opencv(p, a[0], a[0], a[1], a[2], [0, 0, 0, 0])),
    (1, "PINHOLE", [FX, FY, CX, CY], lambda p, a: opencv(p, *a, [0, 0, 0, 0])),
    (2, "SIMPLE_RADIAL", [FX, CX, CY, K[0]], lambda p, a: opencv(p, a[0], a[0], a[1], a[2], [a[3], 0, 0, 0])),
    (3, "RADIAL", [FX, CX, CY] + K[:2], lambda p, a: opencv(p, a[0], a[0], a[1], a[2], [a[3], a[4], 0, 0])),
    (4, "OPENCV", [FX, FY, CX, CY] + K[:2] + P, lambda p, a: opencv(p, *a[:4], a[4:])),
    (5, "OPENCV_FISHEYE", [1400.0, 1403.0, CX, CY, 0.031, -0.0142, 0.0051, -0.0009],
     lambda p, a: opencv_fisheye(p, *a[:4], a[4:])),
    (6, "FULL_OPENCV", [FX, FY, CX, CY] + K[:2] + P + K[2:] + RATIONAL,
     lambda p, a: opencv(p, *a[:4], a[4:8] + a[8:])),
    (8, "SIMPLE_RADIAL_FISHEYE", [1400.0, CX, CY, 0.031],
     lambda p, a: opencv_fisheye(p, a[0], a[0], a[1], a[2], [a[3], 0, 0, 0])),
    (9, "RADIAL_FISHEYE", [1400.0, CX, CY, 0.031, -0.0142],
     lambda p, a: opencv_fisheye(p, a[0], a[0], a[1], a[2], [a[3], a[4], 0, 0])),
]


def colmap():
    text, binary = HERE / "colmap_txt", HERE / "colmap_bin"
    text.mkdir(exist_ok=True)
    binary.mkdir(exist_ok=True)
    cameras_txt, images_txt = "# cameras\n", "# images\n"
    cameras_bin = struct.pack("<Q", len(COLMAP))
    images_bin = struct.pack("<Q", len(COLMAP))
    expected = {}
    # Ids neither dense nor in order, as after registration and deletion.
    for i, (number, model, params, project) in enumerate(COLMAP):
        camera_id, image_id = 70 - 3 * i, 11 + 7 * ((5 * i) % len(COLMAP))
        q, t = random_pose()
        name = f"flight {i % 2}/{model.lower()}.JPG"
        points = wide_rays(20) if "FISHEYE" in model else rays(W, H, FX, 20)
        expected[name] = world_rows(points, project(points, params), q, t)
        cameras_txt += f"{camera_id} {model} {W} {H} {num(params)}\n"
        cameras_bin += struct.pack(f"<IiQQ{len(params)}d", camera_id, number, W, H, *params)
        images_txt += f"{image_id} {num(q)} {num(t)} {camera_id} {name}\n"
        images_txt += "10.5 20.25 -1 3000 17.75 42\n" if i % 2 else "\n"
        images_bin += struct.pack("<I7dI", image_id, *q, *t, camera_id) + name.encode() + b"\0"
        images_bin += struct.pack("<Q", 2) + struct.pack("<ddqddq", 10.5, 20.25, -1, 3000, 17.75, 42) if i % 2 else struct.pack("<Q", 0)
    (text / "cameras.txt").write_text(cameras_txt)
    (text / "images.txt").write_text(images_txt)
    (binary / "cameras.bin").write_bytes(cameras_bin)
    (binary / "images.bin").write_bytes(images_bin)

    rejected = HERE / "rejected"
    for name, model, params, points_line in [
        ("fov", "FOV", [FX, FY, CX, CY, 0.9], "\n"),
        ("missing_parameter", "OPENCV", [FX, FY, CX, CY, 0.1, 0.2, 0.3], "\n"),
        ("no_points_lines", "PINHOLE", [FX, FY, CX, CY], ""),
    ]:
        folder = rejected / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "cameras.txt").write_text(f"1 {model} {W} {H} {num(params)}\n")
        lines = "".join(f"{i} 1 0 0 0 0 0 {i} 1 photo_{i}.jpg\n" + points_line for i in (1, 2))
        (folder / "images.txt").write_text(lines)
    return expected


def matrix_text(q, t):
    """Camera-to-frame 4 x 4 of a frame-to-camera pose."""
    r = quaternion_to_matrix(q).T
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = r, -r @ t
    return num(m.ravel())


def similarity_xml(s, r, t):
    return (f"<transform><rotation locked=\"true\">{num(r.ravel())}</rotation><translation locked=\"true\">{num(t)}</translation>"
            f"<scale locked=\"true\">{s:.17g}</scale></transform>")


def metashape_file():
    frame = {"f": 2897.25, "cx": 11.7, "cy": -9.7, "b1": 3.25, "b2": -1.75, "k1": -0.11, "k2": 0.041, "k3": -0.013,
             "k4": 0.0047, "p1": 0.0013, "p2": -0.0008}
    fish = {"f": 1400.0, "cx": -3.5, "cy": 4.25, "k1": 0.031, "k2": -0.0142, "p1": 0.0004, "p2": -0.0002}
    nominal = {"f": 8.8 / 0.0024}
    sensors = {
        "0": ("frame & fine", "frame", frame, False),
        "1": ("fish", "fisheye", fish, True),
        "7": ("nominal", "frame", nominal, False),
    }
    calibration = lambda kind, c, cls: (
        f'<calibration type="{kind}" class="{cls}"><resolution width="{W}" height="{H}"/>'
        + "".join(f"<{k}>{v:.17g}</{k}>" for k, v in c.items()) + "</calibration>")
    xml = '<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0">\n'
    xml += '  <chunk label="old try" enabled="false"><cameras/></chunk>\n'
    xml += '  <chunk label="nothing aligned" enabled="true"><sensors/><cameras><camera id="0" sensor_id="0" label="lost"/></cameras></chunk>\n'
    xml += '  <chunk label="dam" enabled="true">\n    <sensors>\n'
    for sensor_id, (label, kind, c, _) in sensors.items():
        xml += f'      <sensor id="{sensor_id}" label="{label.replace("&", "&amp;")}" type="{kind}"><resolution width="{W}" height="{H}"/>'
        xml += '<property name="pixel_width" value="0.0024"/><property name="pixel_height" value="0.0024"/>'
        xml += '<property name="focal_length" value="8.8"/>'
        if c is not nominal:
            xml += calibration(kind, {"f": 9999.0}, "initial") + calibration(kind, c, "adjusted")
        xml += "</sensor>\n"
    # Two components with transforms of their own, and the chunk's, which serves the rest.
    frames = {}
    for key in ("chunk", "a", "b"):
        frames[key] = (rng.uniform(0.2, 5), quaternion_to_matrix(random_quaternion()), OFFSET + rng.uniform(-9, 9, 3))
    xml += "    </sensors>\n    <components next_id=\"2\" active_id=\"0\">\n"
    for component_id, key in (("0", "a"), ("1", "b")):
        xml += f'      <component id="{component_id}" label="Component">{similarity_xml(*frames[key])}</component>\n'
    xml += "    </components>\n    <cameras>\n"
    expected = {}
    cameras = [  # label, sensor, component, frame
        ("DJI_0001", "0", "0", "a"), ("DJI_0002.v2", "1", "1", "b"), ("DJI_0003", "7", "0", "a"), ("DJI & 4", "0", None, "chunk"),
    ]
    for i, (label, sensor, component, key) in enumerate(cameras):
        q, t = random_quaternion(), rng.uniform(-4, 4, 3)
        _, _, c, is_fish = sensors[sensor]
        points = wide_rays(20) if is_fish else rays(W, H, FX, 20)
        pixels = metashape(points, W, H, c, is_fish)
        s, r, offset = frames[key]
        in_chunk = (points / s - t) @ quaternion_to_matrix(q)   # camera frame of the chunk has the chunk's unit
        world = (s * in_chunk) @ r.T + offset
        expected[label] = rounded(np.hstack([world, pixels]))
        belongs = f' component_id="{component}"' if component else ""
        line = (f'      <camera id="{i}" sensor_id="{sensor}"{belongs} label="{label.replace("&", "&amp;")}">'
                f"<transform>{matrix_text(q, t)}</transform></camera>\n")
        xml += f'      <group id="0" label="Group 1" type="folder">\n{line}      </group>\n' if i == 1 else line
    xml += '      <camera id="8" sensor_id="0" label="unaligned"/>\n'
    xml += f'      <camera id="9" sensor_id="0" component_id="0" label="off" enabled="0"><transform>{num(np.eye(4).ravel())}</transform></camera>\n'
    xml += "    </cameras>\n    <reference>LOCAL_CS[\"Local Coordinates (m)\",UNIT[\"metre\",1]]</reference>\n"
    xml += f"    {similarity_xml(*frames['chunk'])}\n  </chunk>\n</document>\n"
    (HERE / "metashape.xml").write_text(xml)
    return expected


def opensfm():
    size = max(W, H)
    cameras, shots, expected = {}, {}, {}
    fish = [0.031, -0.0142, 0.0051, -0.0009]
    models = {
        "perspective": ({"focal": 0.72, "k1": K[0], "k2": K[1]},
                        lambda p: opencv(p, 0.72 * size, 0.72 * size, W / 2, H / 2, [K[0], K[1], 0, 0])),
        "brown": ({"focal_x": 0.72, "focal_y": 0.721, "c_x": 0.003, "c_y": -0.002, "k1": K[0], "k2": K[1], "k3": K[2],
                   "p1": P[0], "p2": P[1]},
                  lambda p: opencv(p, 0.72 * size, 0.721 * size, W / 2 + 0.003 * size, H / 2 - 0.002 * size, K[:2] + P + K[2:])),
        "fisheye": ({"focal": 0.35, "k1": fish[0], "k2": fish[1]},
                    lambda p: opencv_fisheye(p, 0.35 * size, 0.35 * size, W / 2, H / 2, fish[:2] + [0, 0])),
        "fisheye_opencv": ({"focal_x": 0.35, "focal_y": 0.351, "c_x": 0.003, "c_y": -0.002,
                            **{f"k{i + 1}": v for i, v in enumerate(fish)}},
                           lambda p: opencv_fisheye(p, 0.35 * size, 0.351 * size, W / 2 + 0.003 * size, H / 2 - 0.002 * size, fish)),
    }
    for model, (params, project) in models.items():
        cameras["v2 " + model] = {"projection_type": model, "width": W, "height": H, **params}
        axis_angle = rng.uniform(-1.5, 1.5, 3)
        r, _ = cv2.Rodrigues(axis_angle)
        t = rng.uniform(-9, 9, 3)
        points = wide_rays(20) if "fisheye" in model else rays(W, H, FX, 20)
        world = (points - t) @ r
        shots[model + ".jpg"] = {"rotation": list(axis_angle), "translation": list(t), "camera": "v2 " + model, "orientation": 1}
        expected[model + ".jpg"] = rounded(np.hstack([world, project(points)]))
    small = {"cameras": cameras, "shots": {"alone.jpg": shots["brown.jpg"]}, "points": {}}
    (HERE / "opensfm.json").write_text(json.dumps([small, {"cameras": cameras, "shots": shots, "points": {}}], indent=1))
    return expected


def pix4d():
    """Local places, and the offset that brings them to the map."""
    offset = np.array([350000.0, 5650000.0, 100.0])
    lines = ["fileName imageWidth imageHeight", "camera matrix K [3x3]", "radial distortion [3x1]", "tangential distortion [2x1]",
             "camera position t [3x1]", "camera rotation R [3x3]", "camera model m = K [R|-Rt] X", ""]
    expected = {}
    for name, dist in [("DJI 0001.JPG", K[:2] + P + K[2:]), ("DJI_0002.JPG", [0, 0, 0, 0, 0])]:
        q, centre = random_quaternion(), rng.uniform(-20, 20, 3)
        r = quaternion_to_matrix(q)
        points = rays(W, H, FX, 20)
        expected[name] = rounded(np.hstack([points @ r + centre + offset, opencv(points, FX, FY, CX, CY, dist)]))
        k = [[FX, 0, CX], [0, FY, CY], [0, 0, 1]]
        k1, k2, p1, p2, k3 = dist
        rows = [*k, [k1, k2, k3], [p1, p2], centre, *r]
        lines += [f"{name} {W} {H}", *[num(row) for row in rows]]
    folder = HERE / "pix4d"
    folder.mkdir(exist_ok=True)
    (folder / "dam_calibrated_camera_parameters.txt").write_text("\n".join(lines) + "\n")
    (folder / "dam_offset.xyz").write_text("350000.000 5650000.000 100.000\n")
    return expected


def angles(r):
    """Heading, pitch and roll of a world-to-camera rotation, as RealityCapture counts them: of an aircraft in axes north,
    east and down, about z, y and x in this order, whose camera looks down with its upper side to the nose."""
    ned_from_world = body_from_camera = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    camera_up = np.diag([1, -1, -1.0])  # axes of photogrammetry: y up, z against the view
    m = ned_from_world @ (camera_up @ r).T @ body_from_camera.T
    yaw, pitch, roll = np.arctan2(m[1, 0], m[0, 0]), -np.arcsin(m[2, 0]), np.arctan2(m[2, 1], m[2, 2])
    return np.degrees([yaw, pitch, roll])


def realitycapture():
    """A photo of either format, in the three ways of writing a camera; t1 and t2 are OpenCV's p2 and p1."""
    folder = HERE / "realitycapture"
    (folder / "xmp" / "wing").mkdir(parents=True, exist_ok=True)
    angled = "#cameras 4\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n"
    plain = ("#name,tx,ty,tz,R00,R01,R02,R10,R11,R12,R20,R21,R22,f_pix,px_pix,py_pix,k1,k2,t2,t1,k3,k4 (R = [Rij], row by row, "
             "and t = (tx,ty,tz) are the pose)\n")
    expected = {}
    for i, (name, model, width, height, k4, tangential) in enumerate([
            ("none.jpg", "perspective", 400, 300, 0, [0, 0]), ("wing/brown3, b.jpg", "brown3", 300, 400, 0, [0, 0]),
            ("brown3t2.jpg", "brown3t2", 400, 300, 0, P), ("wing/brown4t2.jpg", "brown4t2", 300, 400, 0.0047, P)]):
        unit, f, px, py = max(width, height), 0.72 + 0.01 * i, 0.003 * i, -0.004 * i
        q, centre = random_quaternion(), rng.uniform(-20, 20, 3)
        r = quaternion_to_matrix(q)
        points = rays(width, height, f * unit, 20)
        k, (p1, p2) = ([0, 0, 0] if model == "perspective" else K), tangential
        cx, cy = width / 2 + px * unit, height / 2 + py * unit
        if k4:
            c = {"f": f * unit, "cx": px * unit, "cy": py * unit, "k1": k[0], "k2": k[1], "k3": k[2], "k4": k4, "p1": p2, "p2": p1}
            pixels = metashape(points, width, height, c)
        else:
            pixels = opencv(points, f * unit, f * unit, cx, cy, [*k[:2], p1, p2, k[2]])
        expected[name] = rounded(np.hstack([points @ r + centre, pixels]))
        terms = [*k, k4, p2, p1]
        comma = lambda values: ",".join(f"{v:.17g}" for v in values)
        angled += f"{name},{comma([*centre, *angles(r), 36 * f, px, py, *terms])}\n"
        plain += f"{name},{comma([*(-r @ centre), *r.ravel(), f * unit, cx, cy, *k[:2], p1, p2, k[2], k4])}\n"
        rotation, position = num(r.ravel()), num(centre)
        as_attribute = f' xcr:Position="{position}"' if i % 2 else ""
        as_element = "" if i % 2 else f"<xcr:Position>{position}</xcr:Position>"
        sidecar = (
            '<x:xmpmeta xmlns:x="adobe:ns:meta/">\n<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">\n'
            f'<rdf:Description xcr:Version="3" xcr:PosePrior="locked" xcr:DistortionModel="{model}"'
            f' xcr:FocalLength35mm="{36 * f:.17g}" xcr:Skew="0" xcr:AspectRatio="1" xcr:PrincipalPointU="{px:.17g}"'
            f' xcr:PrincipalPointV="{py:.17g}"{as_attribute} xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#">\n'
            f"<xcr:Rotation>{rotation}</xcr:Rotation>{as_element}"
            f"<xcr:DistortionCoeficients>{num(terms)}</xcr:DistortionCoeficients>\n</rdf:Description></rdf:RDF></x:xmpmeta>\n")
        (folder / "xmp" / name).with_suffix(".xmp").write_text(sidecar)
    (folder / "cameras.csv").write_text(angled)
    (folder / "opencv.csv").write_text(plain)
    (folder / "xmp" / "lightroom.xmp").write_text('<x:xmpmeta xmlns:x="adobe:ns:meta/"/>\n')
    return expected


if __name__ == "__main__":
    compact = lambda value: json.dumps(value, separators=(",", ":")).replace('{"name"', '\n{"name"')
    (HERE / "lens.json").write_text(compact(list(lens_cases())) + "\n")
    files = {"colmap": colmap(), "metashape": metashape_file(), "opensfm": opensfm(), "pix4d": pix4d(),
             "realitycapture": realitycapture()}
    (HERE / "expected.json").write_text(json.dumps(files, separators=(",", ":")) + "\n")
