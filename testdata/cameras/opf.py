"""Makes opf/: a project of the Open Photogrammetry Format, written by Pix4D's package pyopf, and opf.json, the pixels of
world points in its photos, by OpenCV's projectPoints and the angles of the specification.

The system has its axes to the north and to the east (swap_xy) and places on the map, so that shift and order of axes are
tested; opf.json has the points as clouds have them, east first. One photo of a second calibration, one without a pose, and
one page of a file are not read.

Run: python3 opf.py   (needs pyopf, numpy and opencv-python-headless; pyopf 1.4.1, OpenCV 5.0.0 and numpy 2.4.6 made the files)
"""
import json
from datetime import datetime, timezone
from pathlib import Path
from uuid import UUID

import cv2
import numpy as np
from pyopf.cameras import (
    BandInformation, CalibratedCamera, CalibratedCameras, CalibratedSensor, Camera, CameraData, CameraList, Capture, InputCameras,
    ModelSource, PerspectiveInternals, PixelType, RigModelSource, Sensor, ShutterType, StaticPixelRange,
)
from pyopf.crs import BaseToTranslatedCanonicalCrsTransform, Crs, SceneReferenceFrame
from pyopf.io import load, save
from pyopf.project import Calibration, Metadata, ProjectObjects, ProjectSource
from pyopf.project.types import CoreProjectItemType as Kind
from pyopf.resolve import resolve
from pyopf.uid64 import Uid64

HERE = Path(__file__).parent
rng = np.random.default_rng(20261128)
BASE = np.array([5650000.0, 350000.0, 100.0])  # north, east, up
ids = iter(range(1, 20))
SENSORS = {
    0xF000000000000001: ((4000, 3000), [2011.7, 1490.3], 2900.5, [-0.12, 0.083, -0.017], [0.0011, -0.00074]),
    0xF000000000000002: ((3000, 4000), [1507.25, 1996.5], 3105.0, [0.0, 0.0, 0.0], [0.0, 0.0]),
}
PHOTOS = [  # reference, sensor, calibration that has a pose
    ("photos/DJI%200001.JPG", 0, 0), ("photos/m%C3%B6hne.tif#page=0", 1, 0), ("file:///d:/flight/DJI_0003.JPG", 0, 0),
    ("photos/bands.tif#page=1", 0, 0), ("photos/alone.jpg", 0, 1), ("photos/lost.jpg", 1, None),
]


def rotation(degrees):
    """Camera to world, axes right, up and back: Rx(omega) Ry(phi) Rz(kappa) of the specification."""
    (co, cp, ck), (so, sp, sk) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    x = np.array([[1, 0, 0], [0, co, -so], [0, so, co]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    z = np.array([[ck, -sk, 0], [sk, ck, 0], [0, 0, 1]])
    return x @ y @ z


def item(obj, kind, name, number, sources=()):
    """Fixed names and ids, so that a second run gives the same files."""
    obj.metadata = Metadata(id=UUID(int=number), name=name, type=kind, sources=[ProjectSource(UUID(int=n), k) for n, k in sources])
    return obj


def calibration(cameras, name, number):
    used = {camera.sensor_id.int for camera in cameras}
    sensors = [
        CalibratedSensor(Uid64(int=sensor), PerspectiveInternals(np.array(centre), focal, np.array(radial), np.array(tangential)))
        for sensor, (_, centre, focal, radial, tangential) in SENSORS.items() if sensor in used
    ]
    sources = [(3, Kind.INPUT_CAMERAS), (2, Kind.SCENE_REFERENCE_FRAME)]
    made = Calibration(calibrated_cameras_objs=[CalibratedCameras(cameras, sensors)])
    return item(made, Kind.CALIBRATION, name, number, sources)


to_canonical = BaseToTranslatedCanonicalCrsTransform(scale=np.ones(3), shift=-BASE[[1, 0, 2]], swap_xy=True)
definition = "EPSG:31468+7837"  # Gauss-Krueger: north first
elsewhere = BaseToTranslatedCanonicalCrsTransform(scale=np.ones(3), shift=np.array([7.0, 8.0, 9.0]), swap_xy=False)
frames = [
    item(SceneReferenceFrame(elsewhere, Crs("EPSG:25832")), Kind.SCENE_REFERENCE_FRAME, "another", 1),
    item(SceneReferenceFrame(to_canonical, Crs(definition)), Kind.SCENE_REFERENCE_FRAME, "scene", 2),
]

listed, captures, calibrated, expected = [], [], ([], []), {}
for number, (uri, sensor, which) in enumerate(PHOTOS):
    camera, sensor = Uid64(int=0xABCDEF0000000000 + number), list(SENSORS)[sensor]
    (width, height), centre_px, focal, radial, tangential = SENSORS[sensor]
    listed.append(CameraData(camera, uri))
    taken = Camera(camera, ModelSource.DATABASE, StaticPixelRange(0.0, 255.0), PixelType.UINT8, Uid64(int=sensor), 1)
    time = datetime(2026, 5, 1, tzinfo=timezone.utc)
    captures.append(Capture(Uid64(int=100 + number), [taken], None, camera, RigModelSource.NOT_APPLICABLE, time))
    if which is None:
        continue
    degrees, place = rng.uniform([-180, -80, -180], [180, 80, 180]), rng.uniform(-20, 20, 3)
    calibrated[which].append(CalibratedCamera(camera, Uid64(int=sensor), degrees, place))
    if which == 1 or "page=1" in uri:
        continue
    name = uri.replace("%20", " ").replace("%C3%B6", "\u00f6").split("#")[0]
    uv = rng.uniform(-0.55, 0.55, (20, 2)) * [width, height]
    depth = rng.uniform(2, 50, 20)
    seen = np.stack([uv[:, 0] / focal * depth, uv[:, 1] / focal * depth, depth], axis=1)  # right, down, ahead
    k = np.array([[focal, 0, centre_px[0]], [0, focal, centre_px[1]], [0, 0, 1]])
    lens = np.array([*radial[:2], *tangential, radial[2]])
    pixels, _ = cv2.projectPoints(seen.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), k, lens)
    canonical = np.hstack([(seen * [1, -1, -1]) @ rotation(degrees).T + place, np.ones((20, 1))])
    # pyopf's own matrix leads back to the base system, whose axes then change places.
    base = np.linalg.solve(to_canonical.transformation_matrix, canonical.T).T[:, :3]
    expected[name] = np.hstack([base[:, [1, 0, 2]], pixels.reshape(-1, 2)]).tolist()

project = ProjectObjects(scene_reference_frame_objs=frames)
project.metadata.id, project.metadata.name = UUID(int=9), "dam"
project.camera_list_objs = [item(CameraList(listed), Kind.CAMERA_LIST, "list", 4)]
sensors = [
    Sensor(Uid64(int=sensor), "camera", [BandInformation(1.0, "Grey")], np.array(size),
           PerspectiveInternals(np.array(size) / 2, focal, np.zeros(3), np.zeros(2)), 2.4, ShutterType.GLOBAL)
    for sensor, (size, _, focal, _, _) in SENSORS.items()
]
project.input_cameras_objs = [item(InputCameras(captures, sensors), Kind.INPUT_CAMERAS, "input", 3, [(4, Kind.CAMERA_LIST)])]
project.calibration_objs = [calibration(calibrated[1], "old try", 5), calibration(calibrated[0], "last", 6)]
save(project, HERE / "opf" / "dam.opf", use_item_name_for_resource_uri=True)
for path in (HERE / "opf").rglob("*.*"):
    if path.is_file():
        path.write_text(json.dumps(json.loads(path.read_text()), indent=1) + "\n")

read = resolve(load(str(HERE / "opf" / "dam.opf")))
assert len(read.calibration_objs) == 2 and read.input_cameras.sensors[0].id.int == 0xF000000000000001
(HERE / "opf.json").write_text(json.dumps({"opf": expected}, separators=(",", ":")) + "\n")
