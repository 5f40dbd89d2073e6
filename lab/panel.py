#!/usr/bin/env python3
"""What a panel of small simulated surveys, whole or disturbed, gets wrong against the truth.

    cargo build --release -p stonewise-cli
    python3 lab/panel.py                          # pip install numpy pandas laspy[lazrs]
    python3 lab/panel.py 'm_*' s_ivy --out FOLDER
    python3 lab/panel.py --list

Simulates walls of 3 x 2 m with `stonewise test simulate`, edits the clouds (ivy, snow, a buttress,
coarser coordinates ...), runs stonewise and prints a row of a Markdown table for each survey.
Surveys named s_* are scans alone, those named m_* have two photos an epoch with the masks of the
wall before the edits.

Lengths are metres in the frame of the simulator: x out of the wall, y along it, z up, the foot of
the face at x = 0. What is printed is in millimetres. RMSE is of the length of the error (all three
axes), sd the mean standard deviation of an axis, coverage the share of the axes whose error is
within 1.96 sd. def_* is held against the true motion less its rigid part, which is that of the
stones outside zones that are not loose and whose def_* is below 5 sd (small parts of the wall that
moved make no zone). A stone is wrong where its motion is off by more than 5 sd and 5 mm. What is
less than half wall (a car, ground, a flank) counts only as wrong and as loose.
"""

import argparse
import dataclasses
import fnmatch
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

try:
    import laspy
    import numpy as np
    import pandas as pd
except ImportError as error:
    sys.exit(f"panel.py: {error.name} is missing: pip install numpy pandas laspy[lazrs]")

ROOT = Path(__file__).resolve().parent.parent
XYZ = ["x", "y", "z"]
# Columns of the truth: the middle of a stone, its motion, its rotation vector.
TRUE_MOTION = ["cx", "cy", "cz"], ["dx", "dy", "dz"], ["rx", "ry", "rz"]
# Labels of points that belong to no stone: joints and surroundings; things put before the wall;
# flanks of a buttress or a recess.
NO_STONE, THING, FLANK = 0, -1, -2
# Where the scanner stands that decides what a thing hides.
STATION = np.array([9.0, 0.0, 1.7])
# Spacing and noise of points put into clouds.
SPACING_M, NOISE_M = 0.006, 0.0015
# Errors of the registration of a terrestrial station: shift and rotation about a place on the wall,
# sd of an axis. They are the simulator's own, applied here so that added points have them, too.
REGISTRATION_M, REGISTRATION_RAD = 0.0003, 2e-5
TARGETS = np.array([0.0, 0.0, 1.0])
ERROR_FREE = {"registration_m": 0.0, "registration_rad": 0.0}
# Points this close to the face belong to the wall, from this height above the ground.
FACE_M, FOOT_M = 0.12, 0.02
COVERED_SD = 1.96
WRONG_SD, WRONG_M = 5.0, 0.005
# An outline that reaches over the edge of a moved part holds points of two motions: not judged where
# more than this share of them moved otherwise than the median.
MIXED = 0.2
# Fewer stones with a deformation are not judged.
MIN_STONES = 7
COLUMNS = ["survey", "expected", "verdict", "measured", "RMSE", "sd", "coverage", "def_* RMSE"]
COLUMNS += ["def_* coverage", "def_* largest error, sd", "wrong"]
COLUMNS += ["loose or lost: found / true / false", "zones"]


@dataclass
class Cloud:
    """The points of an epoch; `stone` is the true stone of each."""

    places: np.ndarray
    intensity: np.ndarray
    source: np.ndarray
    time: np.ndarray
    stone: np.ndarray
    # Rotation vector and shift of each source.
    registration: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    @classmethod
    def read(cls, path, truth):
        """An epoch of the simulator, with the labels of its truth."""
        las = laspy.read(path)
        stone = np.array(laspy.read(truth).stone_id).astype(int)
        intensity, source = np.array(las.intensity).astype(float), np.array(las.point_source_id)
        return cls(las.xyz, intensity, source, np.array(las.gps_time), stone)

    def register(self, random):
        """Gives each station errors of its own."""
        for source in np.unique(self.source):
            turn = random.normal(0, REGISTRATION_RAD, 3)
            self.registration[source] = turn, random.normal(0, REGISTRATION_M, 3)
        self.places = self.registered(self.places, self.source)

    def close(self, bend, random):
        """Bends the wall as it is told, for four stations; the wall as it was, with the ground.

        The ends of the wall of a tower do not meet; points beyond the girth, which would overlap the other end, are cut
        off. The new ground is three metres wide.
        """
        around = abs(self.places[:, 1]) < np.pi * bend.radius
        self.keep((abs(self.places[:, 0]) < FACE_M) & (self.places[:, 2] > FOOT_M) & around)
        ground = random.random((60000, 3)) * [3.0, 2 * np.pi * bend.radius, 0.0]
        ground[:, 1] -= np.pi * bend.radius
        self.add(ground, 20000, NO_STONE, random)
        flat = self.places
        self.places = bend.bent(flat)
        # Neighbouring stations overlap.
        towards = flat[:, 1] / bend.radius + random.normal(0, 0.25, len(flat))
        self.source = (np.floor(towards / (np.pi / 2)) % 4 + 1).astype(np.uint16)
        return flat

    def registered(self, places, source):
        """Places as the stations have them."""
        places = places.copy()
        for number, (turn, shift) in self.registration.items():
            own = source == number
            places[own] = rotate(places[own] - TARGETS, turn) + TARGETS + shift
        return places

    def write(self, path, scale):
        """A LAZ file with coordinates rounded to the scale."""
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.scales, header.offsets = [scale] * 3, self.places.mean(axis=0).round()
        las = laspy.LasData(header)
        las.x, las.y, las.z = self.places.T
        las.intensity = self.intensity.clip(0, 65535).astype(np.uint16)
        las.point_source_id, las.gps_time = self.source, self.time
        las.return_number = las.number_of_returns = np.ones(len(self.places), np.uint8)
        las.write(path)

    def keep(self, chosen):
        """Drops the points that are not chosen."""
        for name in ("places", "intensity", "source", "time", "stone"):
            setattr(self, name, getattr(self, name)[chosen])

    def add(self, places, intensity, stone, random):
        """Adds points, with noise; their sources and times are those of points drawn at random."""
        model = random.integers(0, len(self.source), len(places))
        places = self.registered(places, self.source[model])
        self.places = np.vstack([self.places, places + random.normal(0, NOISE_M, places.shape)])
        self.intensity = np.append(self.intensity, np.full(len(places), intensity))
        self.source = np.append(self.source, self.source[model])
        self.time = np.append(self.time, self.time[model])
        self.stone = np.append(self.stone, np.full(len(places), stone))


@dataclass(frozen=True)
class Bend:
    """How a wall is bent to a tower of this radius, or folded to a square pier of the same girth."""

    radius: float
    square: bool = False

    def turns(self, along):
        """How far the wall is turned at these places along it, radians."""
        turns = along / self.radius
        return np.round(turns / (np.pi / 2)) * (np.pi / 2) if self.square else turns

    def bent(self, flat):
        """Where these places on the plane wall are on the bent one."""
        turns = self.turns(flat[:, 1])
        out = self.radius * (np.pi / 4 if self.square else 1.0) + flat[:, 0]
        aside = flat[:, 1] - turns * self.radius
        cos, sin = np.cos(turns), np.sin(turns)
        return np.column_stack([out * cos - aside * sin, out * sin + aside * cos, flat[:, 2]])


@dataclass
class Scene:
    """A simulated survey, its two clouds being edited."""

    clouds: list[Cloud]
    # truth/stones.csv by stone_id, with points and visible share in the first epoch.
    stones: pd.DataFrame
    batter: float
    random: np.random.Generator
    # Motions of stones that edits add: functions of places in the first epoch.
    moved: list[Callable] = field(default_factory=list)
    lost: list[int] = field(default_factory=list)
    # Motion of all flanks.
    flanks: np.ndarray = field(default_factory=lambda: np.zeros(3))
    # Of a tower or pier: its shape, and the points of the first cloud on the wall before it was bent.
    bend: Bend | None = None
    flat: np.ndarray | None = None
    # Rotation vector and shift of the second epoch's frame.
    frame: tuple | None = None
    exchanged: bool = False

    def face(self, places):
        """The x of the face at the height of these places (plane walls)."""
        return -self.batter * places[:, 2]

    def on_wall(self, cloud):
        """Which points lie on stones or joints."""
        near = abs(cloud.places[:, 0] - self.face(cloud.places)) < FACE_M
        return (cloud.stone > 0) | near & (cloud.places[:, 2] > FOOT_M)

    def true_motions(self):
        """The true motion of each point on a stone or flank of the first cloud; zero elsewhere."""
        cloud = self.clouds[0]
        motions = np.zeros_like(cloud.places)
        chosen = cloud.stone > 0
        all_places = cloud.places if self.flat is None else self.flat
        places, own = all_places[chosen], self.stones.index.get_indexer(cloud.stone[chosen])
        centre, shift, turn = (self.stones[names].to_numpy()[own] for names in TRUE_MOTION)
        if self.exchanged:
            motions[chosen] = rotate(places - centre - shift, -turn) + centre - places
        else:
            motions[chosen] = rotate(places - centre, turn) + centre + shift - places
        for motion in self.moved:
            motions[chosen] += motion(places)
        motions[cloud.stone == FLANK] = self.flanks
        if self.bend:
            motions = rotate(motions, about_z(self.bend.turns(all_places[:, 1])))
        return motions


def rotate(vectors, turn):
    """Vectors turned about one rotation vector (radians), or about one each."""
    angle = np.linalg.norm(turn, axis=-1, keepdims=True)
    axis = np.divide(turn, angle, out=np.zeros(np.shape(turn)), where=angle > 0)
    along = (vectors * axis).sum(axis=-1, keepdims=True) * axis
    return along + (vectors - along) * np.cos(angle) + np.cross(axis, vectors) * np.sin(angle)


def about_z(angles):
    """Rotation vectors."""
    return angles[:, None] * np.array([0.0, 0.0, 1.0])


# Edits of the clouds: each takes the scene.


def tilt(radians):
    """The wall turns about its foot in the second epoch, its crown outwards."""
    turn = np.array([0.0, radians, 0.0])

    def edit(scene):
        cloud = scene.clouds[1]
        wall = scene.on_wall(cloud)
        cloud.places[wall] = rotate(cloud.places[wall], turn)
        scene.moved.append(lambda places: rotate(places, turn) - places)

    return edit


def lose(scene):
    """A well visible stone is gone in the second epoch, its bed 15 cm deep and rough."""
    stones = scene.stones
    large = (stones["edge"] == 0) & stones["area_m2"].between(0.05, 0.2)
    visible = (stones["points"] > 500) & (stones["visible"] > 0.9)
    stone = stones[large & visible].sample(1, random_state=scene.random)
    scene.lost += stone.index.tolist()
    cloud = scene.clouds[1]
    gone = cloud.stone == stone.index[0]
    cloud.places[gone] -= 0.15 * stone[["nx", "ny", "nz"]].to_numpy()
    cloud.places[gone] += scene.random.normal(0, 0.01, (gone.sum(), 3))
    cloud.intensity[gone] *= 0.6
    cloud.stone[gone] = NO_STONE


def box(random, low, high, faces):
    """Points on faces of a box: "x" is its low face across x, "X" the high one."""
    low, high = np.array(low), np.array(high)
    points = []
    for face in faces:
        axis = "xyz".index(face.lower())
        area = np.prod(np.delete(high - low, axis))
        drawn = low + random.random((int(area / SPACING_M**2), 3)) * (high - low)
        drawn[:, axis] = (high if face.isupper() else low)[axis]
        points.append(drawn)
    return np.vstack(points)


def hide(cloud, low, high):
    """Drops the points that a box hides from the station."""
    ray = cloud.places - STATION
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.array([(low - STATION) / ray, (high - STATION) / ray])
    enters, leaves = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    cloud.keep(~((enters < leaves) & (leaves > 0) & (enters < 0.999)))


def thing(low, high, epochs=(1,), shift=(0.0, 0.0, 0.0)):
    """A box before the wall in these epochs, moved by the shift in the second."""

    def edit(scene):
        for epoch in epochs:
            corners = [np.array(corner) + epoch * np.array(shift) for corner in (low, high)]
            hide(scene.clouds[epoch], *corners)
            scene.clouds[epoch].add(box(scene.random, *corners, "XyYZ"), 20000, THING, scene.random)

    return edit


def within(places, along, up):
    """Which places lie in these ranges of y and z."""
    y, z = places[:, 1], places[:, 2]
    return (y > along[0]) & (y < along[1]) & (z > up[0]) & (z < up[1])


def cover(along, up, off, intensity, scatter=0.0, share=1.0):
    """A skin hides the wall in these ranges in the second epoch.

    Leaves where it scatters, else sheeting or mortar.
    """

    def edit(scene):
        cloud, random = scene.clouds[1], scene.random
        part = scene.on_wall(cloud) & within(cloud.places, along, up)
        part &= random.random(len(part)) < share
        count = part.sum()
        if scatter:
            cloud.places[part, 0] += off + scatter * abs(random.normal(size=count))
        else:
            waves = 0.01 * np.sin(5 * cloud.places[part, 1])
            cloud.places[part, 0] = scene.face(cloud.places[part]) + off + waves
            cloud.places[part, 0] += random.normal(0, NOISE_M, count)
        cloud.intensity[part] = intensity * random.normal(1, 0.1, count)
        cloud.stone[part] = THING

    return edit


def repairs(scene):
    """Three patches of mortar in the second epoch."""
    for _ in range(3):
        y, z = scene.random.uniform(-1.2, 1.2), scene.random.uniform(0.4, 1.6)
        cover((y, y + 0.35), (z, z + 0.35), 0.008, 40000)(scene)


def wet(scene):
    """Water has run down the wall in six streaks in the second epoch."""
    cloud, random = scene.clouds[1], scene.random
    wall = scene.on_wall(cloud)
    for _ in range(6):
        y, width, low = random.uniform(-1.5, 1.4), random.uniform(0.1, 0.25), random.uniform(0, 1.2)
        cloud.intensity[wall & within(cloud.places, (y, y + width), (low, 3.0))] *= 0.4


def shadow(scene):
    """An oblique strip of the wall is darker in the second epoch, as the shadow of a crane's jib."""
    cloud = scene.clouds[1]
    y, z = cloud.places[:, 1:].T
    cloud.intensity[scene.on_wall(cloud) & (abs(y - 0.5 * z) < 0.15)] *= 0.5


def ladder(scene):
    """A ladder stands against the wall in the second epoch."""
    for low in np.arange(0.0, 2.1, 0.3):
        out = scene.face(np.array([[0.0, 0.0, low]]))[0] + 0.06
        for y in (-0.5, -0.1):
            thing((out, y, low), (out + 0.06, y + 0.05, low + 0.3))(scene)
        thing((out, -0.45, low + 0.27), (out + 0.04, -0.1, low + 0.3))(scene)


def snow(scene):
    """A drift of 12 cm on the ground and at the foot of the wall in the second epoch."""
    cloud = scene.clouds[1]
    x, y, z = cloud.places.T
    ground = (cloud.stone == NO_STONE) & (z < 0.03) & (x > 0.02)
    foot = (cloud.stone >= NO_STONE) & (z < 0.12) & (x < 0.05) & (x > -0.2) & ~ground
    depth = 0.12 * (1.1 - 0.3 * x + 0.2 * np.sin(3 * y)).clip(0.2, 2)
    cloud.places[ground, 2] += depth[ground]
    cloud.intensity[ground] = 55000
    cloud.keep(~foot)


def block(along, up, out, shift=(0.0, 0.0, 0.0)):
    """A buttress, or a recess where `out` is negative, that moves by the shift.

    Flanks of a recess belong to the wall around it and stand still. Not to be combined with motions
    of the simulator, which it does not follow.
    """
    flanks = np.array(shift) if out > 0 else np.zeros(3)

    def edit(scene):
        for epoch, cloud in enumerate(scene.clouds):
            wall = scene.on_wall(cloud)
            low, high = max(up[0], 0.0), min(up[1], cloud.places[wall, 2].max())
            part = wall & within(cloud.places, along, up)
            intensity = np.median(cloud.intensity[part])
            cloud.places[part] += np.array([out, 0, 0]) + epoch * np.array(shift)
            inner = cloud.places[:, 0] - scene.face(cloud.places) < out - 0.01
            cloud.keep(part | ~within(cloud.places, along, up) | ~inner)
            for y in along:
                places = scene.random.random((int(abs(out) * (high - low) / SPACING_M**2), 3))
                places = [out, 0, high - low] * places + [0, y, low] + epoch * flanks
                places[:, 0] += scene.face(places)
                cloud.add(places, intensity, FLANK, scene.random)
        scene.flanks = flanks
        scene.moved.append(lambda places: np.outer(within(places, along, up), shift))

    return edit


def recess(shift):
    """A part of the wall 30 cm behind the face, which moves out by the shift."""
    return block((-0.5, 0.4), (-0.1, 1.5), -0.3, (shift, 0.0, 0.0))


def buttress(centimetres, shift=0.004):
    """A buttress of this depth, which moves out by the shift."""
    return block((-0.45, 0.45), (-0.1, 3.0), centimetres / 100, (shift, 0.0, 0.0))


def steps(shift):
    """The risers of three steps at the foot of the wall, which move out by the shift."""
    courses = [(0.75, (-0.1, 0.25)), (0.5, (0.25, 0.5)), (0.25, (0.5, 0.75))]
    return [block((-0.6, 0.6), up, out, (shift, 0.0, 0.0)) for out, up in courses]


def two_buttresses(centimetres):
    """Two buttresses of this depth, 80 cm apart, which stand still."""
    return [block(along, (-0.1, 3.0), centimetres / 100) for along in [(-1.2, -0.4), (0.4, 1.2)]]


def turned(scene):
    """The second epoch is in a frame of its own (scans alone)."""
    scene.frame = (np.array([0, 0, np.radians(25)]), np.array([30.0, -12.0, 2.0]))


def exchange(scene):
    """The second epoch comes first (scans alone)."""
    scene.clouds.reverse()
    scene.exchanged = True


def one_station(scene):
    """The second epoch was scanned from one station."""
    cloud = scene.clouds[1]
    cloud.keep(cloud.source == cloud.source.min())


def no_sources(scene):
    """The files do not tell stations apart."""
    for cloud in scene.clouds:
        cloud.source[:] = 0


def copied(scene):
    """The second epoch is the first's cloud, exported again in millimetres."""
    scene.clouds[1] = dataclasses.replace(scene.clouds[0])
    scene.clouds[1].places = scene.clouds[0].places.round(3)


def half(scene):
    """The second epoch shows little more than half of the wall."""
    cloud = scene.clouds[1]
    cloud.keep(cloud.places[:, 1] < 0.2)


CAR = thing((0.6, -0.9, 0.0), (1.6, 0.2, 0.9))
PERSON = thing((0.5, -0.6, 0.0), (0.8, -0.2, 1.7), epochs=(0, 1), shift=(0.0, 0.25, 0.0))
POLE = thing((0.25, -0.3, 0.0), (0.3, -0.25, 2.4))
HUT = thing((0.5, -0.9, 0.0), (1.3, -0.1, 0.9), epochs=(0, 1), shift=(0.02, 0.03, 0.0))
FAR_HUT = thing((0.9, -0.9, 0.0), (1.6, -0.1, 0.9), epochs=(0, 1), shift=(0.004, 0.0, 0.0))
IVY = {"along": (-1.6, -0.5), "up": (0, 2.1), "off": 0.01, "intensity": 12000, "scatter": 0.03}


# Motions that the simulator makes.


def bulge(depth):
    """A bulge of 1.5 m amid the wall."""
    return {"kind": "bulge", "centre_m": [0.0, 1.1], "depth_m": depth, "diameter_m": 1.5}


def zone(along, up, out):
    """A zone of 1.5 m amid the wall creeps."""
    return {"kind": "zone", "centre_m": [0.0, 1.1], "d_m": [along, up, out], "diameter_m": 1.5}


def crack(*motion):
    """What lies beyond an oblique crack moves along, up and out."""
    return {"kind": "crack", "along_m": 0.0, "slope": 0.15, "d_m": motion}


def settlement(depth):
    """The middle of the wall goes down."""
    return {"kind": "settlement", "from_m": -0.3, "to_m": 0.3, "depth_m": depth}


def translation(*motion):
    """The whole wall moves along x, y, z."""
    return {"kind": "translation", "d_m": motion}


def loose(count, shift, turn=0.0):
    """Single stones move and turn (radians), besides what the wall does."""
    kind = {"kind": "loose", "share": 0.0, "at_least": count}
    return {**kind, "shift_m": [shift, shift], "rotation_rad": turn}


def toml(value):
    """A value as TOML, with tables inline."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def stable(*corners):
    """Lines of a project file that name stable areas by opposite corners."""
    return "".join(f"[[registration.stable]]\ncorners = {toml(pair)}\n" for pair in corners)


GROUND_AREA = [[0.2, -4.0, -0.5], [6.0, 4.0, 0.05]]
ANNEX_AREA = [[0.2, 0.3, 0.0], [0.9, 1.2, 0.9]]
FAR_HUT_AREA = [[0.8, -1.0, 0.1], [1.7, 0.0, 1.0]]
STABLE = stable(GROUND_AREA, ANNEX_AREA)
ALIGN = '[registration]\nalign = "stones"\n'
LIMITS = "[thresholds]\nattention_mm = 5.0\nalarm_mm = 10.0\n"
BARE = {"annex": False, "railing": False, "shrubs": 0}
NO_ANNEX = {"annex": False}
HOLLOW = {"plan_radius_m": 8.0, "width_m": 4.0}
CONVEX = {"plan_radius_m": -8.0, "width_m": 4.0}
PLUMB = {"batter": 0.0}
AROUND = {"width_m": 12.0}
TOWER, PIER = Bend(2.0), Bend(6 / np.pi, square=True)
MOVING = {"expected": "attention", "surroundings": NO_ANNEX}


@dataclass(frozen=True)
class Survey:
    """What is simulated and what is done to it."""

    name: str
    seed: int
    motions: list = field(default_factory=list)
    edits: list = field(default_factory=list)
    expected: str = ""  # the verdict; empty: attention where the simulator moves stones, else fine
    sensors: tuple = ("tls", "tls")  # of the two epochs
    wall: dict = field(default_factory=dict)
    surroundings: dict = field(default_factory=dict)
    spacing: float = 0.006  # of terrestrial scans
    noise: float | None = None  # of ranges; the simulator's own if none
    scale: float = 1e-6  # to which coordinates are rounded
    bend: Bend | None = None  # to a tower or a pier
    project: str = ""  # further lines of the project file

    @property
    def masks(self):
        """Whether there are photos with masks."""
        return self.name.startswith("m_")

    @property
    def verdict(self):
        """The expected verdict."""
        return self.expected or ("attention" if self.motions else "fine")

    def parameters(self):
        """The simulator's parameter file."""
        surroundings = {"annex": True, "railing": True, "shrubs": 1, "seed": self.seed}
        scene = {
            "seed": self.seed,
            "motions": self.motions,
            "wall": {"width_m": 3.0, "height_m": 2.0, "seed": self.seed} | self.wall,
            "surroundings": surroundings | self.surroundings,
        }
        for sensor in self.sensors:
            scene[sensor] = {"spacing_m": self.spacing} | ERROR_FREE if sensor == "tls" else {}
            if self.noise:
                scene[sensor]["beam"] = {"range_noise_m": self.noise}
        photos = {"columns": 2, "rows": 1, "width": 1024, "height": 768}
        photos |= {"focal_px": 1500.0, "distance_m": 6.0, "rendered": False}
        tables = {"masks": "coco" if self.masks else "none", "scene": scene, "photos": photos}
        return "".join(f"{key} = {toml(value)}\n" for key, value in tables.items())


SURVEYS = [
    # Walls that stand still.
    Survey("s_still_batter", 11),
    Survey("s_still_plumb", 12, wall=PLUMB, surroundings=NO_ANNEX),
    Survey("s_still_hollow", 13, wall=HOLLOW),
    Survey("s_still_bare", 15, surroundings=BARE),
    Survey("m_still", 51),
    Survey("m_no_sources", 63, edits=[no_sources], expected="cannot tell"),
    Survey("s_one_station", 86, edits=[one_station], expected="cannot tell"),
    Survey("s_half", 85, edits=[half]),
    Survey("m_copied", 51, edits=[copied], expected="cannot tell"),
    # Whole walls and large parts that move.
    Survey("s_tilt", 16, edits=[tilt(0.002)], expected="attention"),
    Survey("m_tilt", 53, edits=[tilt(0.002)], expected="attention"),
    Survey("s_translation", 89, [translation(0.004, 0.0, -0.002)]),
    Survey("s_bending", 44, [{"kind": "bending", "crown_m": 0.004}]),
    Survey("s_settle", 17, [settlement(0.003)]),
    Survey("s_crack_down", 18, [crack(0.0, -0.003, 0.0)]),
    Survey("s_crack_down_bare", 18, [crack(0.0, -0.003, 0.0)], surroundings=BARE),
    Survey("s_crack_along", 21, [crack(0.0015, 0.0, 0.0)]),
    Survey("m_crack_along", 52, [crack(0.0015, 0.0, 0.0)]),
    Survey("s_crack_out", 87, [crack(0.0, 0.0, 0.003)]),
    Survey("m_crack_hollow", 57, [crack(0.0, -0.003, 0.001)], wall=HOLLOW),
    # Bulges.
    Survey("s_bulge1", 19, [bulge(0.001)]),
    Survey("m_bulge1", 61, [bulge(0.001)]),
    Survey("s_bulge3", 27, [bulge(0.003)]),
    Survey("s_bulge3_exchanged", 27, [bulge(0.003)], [exchange]),
    Survey("s_dent3", 99, [bulge(-0.003)]),
    Survey("s_bulge3_convex", 96, [bulge(0.003)], wall=CONVEX),
    Survey("s_bulge3_loose", 20, [bulge(0.003), loose(1, 0.012)]),
    # Zones that creep along the face, or horizontally on a wall with batter.
    Survey("s_zone_up", 311, [zone(0.0, 0.002, 0.0)]),
    Survey("s_zone_along", 312, [zone(0.003, 0.0, 0.0)]),
    Survey("s_zone_level", 313, [zone(0.0, -0.00118, 0.00588)]),
    Survey("m_zone_up", 314, [zone(0.0, 0.002, 0.0)]),
    # Single stones.
    Survey("s_loose5", 22, [loose(1, 0.005)]),
    Survey("s_loose5_no_sources", 22, [loose(1, 0.005)], [no_sources]),
    Survey("m_loose5", 56, [loose(2, 0.005)]),
    Survey("s_loose8", 90, [loose(3, 0.008, turn=0.01)], surroundings=NO_ANNEX),
    Survey("s_loose20", 23, [loose(1, 0.02, turn=0.03)]),
    Survey("m_limits", 64, [loose(1, 0.02)], expected="alarm", project=LIMITS),
    Survey("s_lost", 24, edits=[lose], expected="attention"),
    Survey("s_own", 45, [{"kind": "own", "shift_m": 0.0005, "rotation_rad": 0.0005}]),
    # Coarse, noisy and rounded clouds.
    Survey("s_coarse", 25, spacing=0.012),
    *[Survey(f"s_sparse_{seed}", seed, spacing=0.019) for seed in range(201, 207)],
    Survey("s_noise5", 26, noise=0.005),
    Survey("m_noise10", 58, noise=0.01),
    Survey("s_1cm_still", 34, scale=0.01),
    Survey("s_1cm_loose", 35, [loose(1, 0.02)], scale=0.01),
    Survey("s_1cm_loose2", 83, [loose(2, 0.02)], scale=0.01),
    Survey("s_5mm_bulge", 84, [bulge(0.003)], scale=0.005),
    # Drones, alone and in one of the epochs.
    Survey("s_uav_still", 29, sensors=("uav", "uav")),
    Survey("s_uav_bulge5", 30, [bulge(0.005)], sensors=("uav", "uav")),
    Survey("m_uav_bulge5", 54, [bulge(0.005)], sensors=("uav", "uav")),
    Survey("s_tls_uav_still", 31, sensors=("tls", "uav")),
    Survey("m_tls_uav_still", 55, sensors=("tls", "uav")),
    Survey("s_uav_tls_bulge5", 32, [bulge(0.005)], sensors=("uav", "tls")),
    Survey("m_uav_tls_bulge5", 95, [bulge(0.005)], sensors=("uav", "tls")),
    # Frames and stable areas.
    Survey("s_align", 28, [bulge(0.003)], [turned], project=ALIGN),
    Survey("s_stable", 33, [translation(0.003, 0.0, -0.003)], project=STABLE),
    Survey("m_stable", 60, [translation(0.003, 0.0, -0.003)], project=STABLE),
    Survey("s_stable_moved", 98, edits=[FAR_HUT], project=stable(GROUND_AREA, FAR_HUT_AREA)),
    # Things before the wall and on it.
    Survey("s_car", 36, edits=[CAR]),
    Survey("s_hut_moves", 88, edits=[HUT]),
    Survey("s_person", 37, edits=[PERSON]),
    Survey("s_pole", 701, edits=[POLE]),
    Survey("s_ladder", 702, edits=[ladder]),
    Survey("s_snow", 38, edits=[snow]),
    Survey("s_banner", 39, edits=[cover((-0.7, 0.3), (0.9, 1.5), 0.03, 45000)]),
    Survey("s_repairs", 97, edits=[repairs]),
    Survey("s_wet", 703, edits=[wet]),
    Survey("s_shadow", 704, edits=[shadow]),
    Survey("s_ivy", 40, edits=[cover(**IVY, share=0.8)]),
    Survey("s_ivy_thin", 94, edits=[cover(**IVY, share=0.4)]),
    Survey("m_ivy", 93, edits=[cover(**IVY, share=0.8)]),
    Survey("s_tower", 901, [loose(3, 0.012)], wall=PLUMB | AROUND, surroundings=BARE, bend=TOWER),
    Survey("s_pier", 902, [loose(3, 0.012)], wall=PLUMB | AROUND, surroundings=BARE, bend=PIER),
    # Parts before or behind the face.
    Survey("s_recess", 42, edits=[recess(0.0)]),
    *(
        Survey(
            f"s_island_{kind}_{round(1e3 * shift)}mm",
            seed,
            edits=edits,
            expected="attention" if shift else "fine",
            surroundings=BARE,
        )
        for shift in (0.0, 0.005, 0.05)
        for kind, seed, edits in [
            ("recess", 401, [recess(shift)]),
            ("buttress", 501, [buttress(30, shift)]),
            ("steps", 601, steps(shift)),
        ]
    ),
    *(
        Survey(
            f"s_two_buttresses_{centimetres}cm",
            seed,
            edits=two_buttresses(centimetres),
            surroundings=NO_ANNEX,
        )
        for seed, centimetres in [(302, 15), (304, 30), (305, 35)]
    ),
    *(
        Survey(f"s_buttress_{centimetres}cm", seed, edits=[buttress(centimetres)], **MOVING)
        for seed, centimetres in [(73, 15), (71, 25), (72, 40)]
    ),
]


class RunError(Exception):
    """A command gave no result."""


def main():
    """Prints the table."""
    arguments = parse()
    patterns = arguments.names or ["*"]
    chosen = [
        survey
        for survey in SURVEYS
        if any(fnmatch.fnmatch(survey.name, pattern) for pattern in patterns)
    ]
    if not chosen:
        sys.exit(f"panel.py: no survey is called {' or '.join(patterns)}; --list shows the names")
    if arguments.list:
        print("\n".join(f"{survey.name:22} {survey.verdict}" for survey in chosen))
        return
    if not laspy.LazBackend.detect_available():
        sys.exit("panel.py: laspy cannot read LAZ; install lazrs with: pip install laspy[lazrs]")
    out = Path(arguments.out or tempfile.mkdtemp(prefix="stonewise-panel-"))
    print(f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}")
    for survey in chosen:
        survey = dataclasses.replace(survey, seed=survey.seed + arguments.seeds_up)
        figures = {"survey": survey.name, "expected": survey.verdict}
        try:
            figures |= measure(survey, out / survey.name, arguments.binary)
        except RunError as error:
            figures["verdict"] = f"none: {error}"
        print(f"| {' | '.join(str(figures.get(column, '')) for column in COLUMNS)} |", flush=True)


def parse():
    """The arguments of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="surveys, as shell patterns; all when absent")
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/stonewise")
    parser.add_argument(
        "--out", help="replaces a folder per survey in this one; a temporary one when absent"
    )
    parser.add_argument(
        "--seeds-up", type=int, default=0, metavar="N", help="add N to the seed of every survey"
    )
    parser.add_argument("--list", action="store_true", help="print names and expected verdicts")
    return parser.parse_args()


def measure(survey, folder, binary):
    """The figures of a survey by column."""
    shutil.rmtree(folder, ignore_errors=True)
    scene, motions, said = run(survey, folder, binary)
    if not (folder / "results/verdict.json").exists():
        raise RunError(said)
    return compare(scene, motions, folder / "results")


def run(survey, folder, binary):
    """Runs a survey in a new folder: scene, true motions of the points, last line of the run."""
    folder.mkdir(parents=True)
    (folder / "parameters.toml").write_text(survey.parameters())
    parameters, simulated = folder / "parameters.toml", folder / "simulated"
    call(binary, "test", "simulate", "--quiet", "--params", parameters, "--out", simulated)
    scene = read(survey, simulated)
    for edit in survey.edits:
        edit(scene)
    motions = scene.true_motions()
    write(survey, scene, folder)
    said = call(binary, "run", folder / "project.toml", "--out", folder / "results", may_fail=True)
    return scene, motions, said


def call(*command, may_fail=False):
    """Runs a command; the last line of what it said."""
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        sys.exit(f"panel.py: {command[0]}: {error.strerror}; --binary names another")
    said = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
    if done.returncode and not may_fail:
        raise RunError(f"{command[1]}: {said}")
    return said


def read(survey, folder):
    """The scene of a simulated survey."""
    stones = pd.read_csv(folder / "truth/stones.csv").set_index("stone_id")
    first = survey.sensors[0]
    stones["points"], stones["visible"] = stones[f"n_{first}_1"], stones[f"vis_{first}"]
    random = np.random.default_rng(survey.seed)
    clouds, flat = [], []
    for epoch, sensor in enumerate(survey.sensors, 1):
        path = folder / f"epoch{epoch}/cloud_{sensor}.laz"
        truth = folder / f"truth/epoch{epoch}_cloud_{sensor}_truth.laz"
        clouds.append(Cloud.read(path, truth))
        if survey.bend:
            flat.append(clouds[-1].close(survey.bend, random))
        if sensor == "tls":
            clouds[-1].register(random)
    scene = Scene(clouds, stones, survey.wall.get("batter", 0.2), random)
    if survey.bend:
        scene.bend, scene.flat = survey.bend, flat[0]
        normal = ["nx", "ny", "nz"]
        turn = about_z(survey.bend.turns(stones["cy"].to_numpy()))
        stones[normal] = rotate(stones[normal].to_numpy(), turn)
    return scene


def write(survey, scene, folder):
    """The clouds and the project; the second epoch in its own frame."""
    if scene.frame:
        turn, shift = scene.frame
        scene.clouds[1].places = rotate(scene.clouds[1].places, turn) + shift
    text = '[project]\nname = "panel"\n'
    for epoch, cloud in enumerate(scene.clouds, 1):
        cloud.write(folder / f"epoch{epoch}.laz", survey.scale)
        text += f'\n[[epochs]]\nname = "{epoch}"\nclouds = ["epoch{epoch}.laz"]\n'
        if survey.masks:
            text += f'images = "simulated/epoch{epoch}/images"\n'
            text += f'cameras = "simulated/epoch{epoch}/cameras_metashape.xml"\n'
            text += f'masks = "simulated/masks/epoch{epoch}.json"\n'
    (folder / "project.toml").write_text(f"{text}\n{survey.project}")


def compare(scene, motions, results):
    """The figures of a run against the true motions of the first cloud's points."""
    verdict = json.loads((results / "verdict.json").read_text())
    epoch = verdict["epochs"][0]
    stones = with_truth(scene, motions, results)
    measured = stones[stones["status"] == "ok"].copy()
    true_loose = {*scene.stones.index[scene.stones["loose"] == 1], *scene.lost}
    measured["free"] = measured["own"].isin(true_loose) | (measured["loose"] == 1)
    judged = measured[measured["mixed"] == 0]
    zones = (epoch.get("deformation") or {}).get("zones", [])

    lost = [stone["stone_id"] for stone in epoch["stones"] if stone["lost"]]
    loose = (stones["status"] == "ok") & (stones["loose"] == 1)
    called = stones["own"][loose | stones["stone_id"].isin(lost)]
    hits = true_loose.intersection(called)
    false = sum(own not in true_loose for own in called)
    return {
        "verdict": verdict["state"],
        "measured": f"{len(measured)} of {len(stones)}",
        "loose or lost: found / true / false": f"{len(hits)} / {len(true_loose)} / {false}",
        **motion_figures(judged, epoch["datum"]),
        **deformation_figures(judged[judged["on_wall"]].dropna(subset="def_dx"), scene, zones),
    }


def with_truth(scene, motions, results):
    """The stones of a run, each with the true stone of most of its points and the motion there."""
    [labelled] = (results / "data/epoch1").glob("*.laz")
    found = np.array(laspy.read(labelled).stone_id).astype(int)
    stones, true = pd.read_csv(results / "stones.csv"), scene.clouds[0].stone
    points = pd.DataFrame(motions, columns=[f"true_{axis}" for axis in XYZ])
    points = points.assign(stone_id=found, own=true, on_wall=true > 0)[found > 0]
    share = points.groupby("stone_id")["on_wall"].mean()
    moved = [f"true_{axis}" for axis in XYZ]
    points = points[points["on_wall"] | (points["own"] == FLANK)]
    groups = points.groupby("stone_id")
    truth = groups[moved].median()
    truth["own"] = groups["own"].agg(lambda own: own.mode()[0])
    off = np.linalg.norm(points[moved] - groups[moved].transform("median"), axis=1) > WRONG_M
    truth["mixed"] = pd.Series(off).groupby(points["stone_id"].to_numpy()).mean() > MIXED
    stones = stones.join(truth, on="stone_id")
    stones[truth.columns] = stones[truth.columns].fillna(0)
    stones["on_wall"] = stones["stone_id"].map(share) >= 0.5
    return stones


def vectors(stones, prefix):
    """The x, y, z of a quantity."""
    return stones[[prefix + axis for axis in XYZ]].to_numpy()


def motion_figures(stones, datum):
    """Errors of motions; less their rigid part where the run could not tell it."""
    if stones.empty:
        return {}
    names = [["cov_" + "".join(sorted(row + column)) for column in XYZ] for row in XYZ]
    covariance = np.stack([stones[columns].to_numpy() for columns in names], axis=1)
    errors = vectors(stones, "d") - vectors(stones, "true_")
    fixed = (stones["on_wall"] & ~stones["free"]).to_numpy()
    if datum == "unknown" and fixed.sum() > 3:
        weight = fixed / np.trace(covariance, axis1=1, axis2=2)
        errors -= rigid_part(vectors(stones, ""), errors, weight)
    sd = np.sqrt(np.einsum("nii->ni", covariance))
    in_sd = np.sqrt(np.einsum("ni,nij,nj->n", errors, np.linalg.pinv(covariance), errors))
    wrong = (in_sd > WRONG_SD) & (np.linalg.norm(errors, axis=1) > WRONG_M)
    wall = stones["on_wall"].to_numpy()
    return {
        "RMSE": millimetres(rms(errors[wall])),
        "sd": millimetres(sd[wall].mean()),
        "coverage": f"{(abs(errors) < COVERED_SD * sd)[wall].mean():.3f}",
        "wrong": wrong.sum(),
    }


def deformation_figures(stones, scene, zones):
    """Errors of deformations along, up and out, and the largest true deformation in each zone."""
    true = np.full((len(stones), 3), np.nan)
    figures = {}
    if len(stones) >= MIN_STONES:
        sd = stones[["sd_def_along", "sd_def_up", "sd_def_out"]].to_numpy()
        axes = face_axes(scene.stones.loc[stones["own"], ["nx", "ny", "nz"]].to_numpy())
        in_sd = abs(np.einsum("nij,nj->ni", axes, vectors(stones, "def_d"))) / sd
        base = (stones["zone_id"] == 0) & ~stones["free"] & (in_sd < WRONG_SD).all(axis=1)
        true = vectors(stones, "true_")
        true = true - rigid_part(vectors(stones, ""), true, base.to_numpy(float))
        errors = vectors(stones, "def_d") - true
        in_sd = abs(np.einsum("nij,nj->ni", axes, errors)) / sd
        figures = {
            "def_* RMSE": millimetres(rms(errors)),
            "def_* coverage": f"{(in_sd < COVERED_SD).mean():.3f}",
            "def_* largest error, sd": f"{in_sd.max():.1f}",
        }
    size = pd.Series(np.linalg.norm(true, axis=1), stones["zone_id"]).groupby(level=0).max()
    rows = []
    for zone in zones:
        low, high = zone["interval_mm"]
        claim = f"{zone['kind']} {zone['largest_mm']:.2f} ({low:.2f} to {high:.2f})"
        rows.append(f"{claim}, true {millimetres(size.get(zone['zone_id'], np.nan))}")
    return {**figures, "zones": "; ".join(rows)}


def rigid_part(places, motions, weight):
    """The small rigid motion that fits the motions best, at all places."""
    arms = places - places.mean(axis=0)
    rows = np.zeros((len(places), 3, 6))
    rows[:, :, :3] = np.eye(3)
    rows[:, :, 3:] = np.cross(np.eye(3), arms[:, None]).transpose(0, 2, 1)
    root = np.sqrt(weight)[:, None]
    scaled = (rows * root[:, :, None]).reshape(-1, 6)
    return rows @ np.linalg.lstsq(scaled, (motions * root).ravel())[0]


def face_axes(normals):
    """Directions along, up and out of the face for each normal."""
    along = np.cross([0.0, 0.0, 1.0], normals)
    along /= np.linalg.norm(along, axis=1)[:, None]
    return np.stack([along, np.cross(normals, along), normals], axis=1)


def rms(errors):
    """The root mean square length."""
    return np.sqrt((errors**2).sum(axis=1).mean())


def millimetres(metres):
    """A length as it is printed."""
    return f"{1e3 * metres:.3f}"


if __name__ == "__main__":
    main()
