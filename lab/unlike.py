#!/usr/bin/env python3
"""Makes surveys of walls unlike those on which the built-in detector was trained, with true masks.

    python3 lab/unlike.py pebbles|herringbone|cyclopean OUT       # pip install numpy scipy pillow laspy[lazrs]

Writes a project of two epochs of a wall that stands still: `stonewise.toml`, and for each epoch a coloured cloud, six
photos with their poses (COLMAP) and the true masks of the photos (`masks.json`, COCO). The project file does not name
the masks; they serve to score what `stonewise detector segment` and `stonewise detector adapt` find.

x points out of the wall, y along it, z up; lengths are metres. A wall is a raster of heights, colours and stones. For
each pixel of a photo, the ray is intersected with the wall's plane and corrected four times for the height there; this
holds as long as no stone hides another.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

# Pixels of a photo, and its focal length in pixels.
SIZE = np.array([1200, 900])
FOCAL_PX = 1300.0
NOISE_M = 0.001
# Light from the left, and from the right and higher up.
LIGHTS = [(0.7, -0.5, 0.5), (0.6, 0.35, 0.7)]


@dataclass
class Wall:
    """Rasters with rows along z and columns along y, the lower left corner at (0, 0)."""

    step: float
    heights: np.ndarray
    colours: np.ndarray
    stones: np.ndarray


def grid(width, height, step):
    return np.meshgrid(np.arange(0, width, step), np.arange(0, height, step))


def noise(random, shape, sizes):
    """Smooth noise of standard deviation 1: equal parts of each size, in cells."""
    parts = [gaussian_filter(random.normal(size=shape), size) for size in sizes]
    return sum(part / part.std() for part in parts) / np.sqrt(len(sizes))


def jittered(random, width, height, spacing, jitter):
    """Points in rows, every second row shifted by half a spacing, with random offsets."""
    rows = np.arange(-1, height / (0.87 * spacing) + 1)
    columns = np.arange(-1, width / spacing + 2)
    z, y = np.meshgrid(rows, columns, indexing="ij")
    places = np.stack([(y + 0.5 * (z % 2)) * spacing, 0.87 * z * spacing], axis=-1).reshape(-1, 2)
    return places + random.uniform(-jitter, jitter, places.shape) * spacing


def painted(random, stones, tones, joint):
    """Colours each stone near one of the tones, and the joints."""
    count = stones.max() + 1
    tones = np.array(tones)[random.integers(0, len(tones), count)]
    tones = np.clip(tones * random.normal(1, 0.16, (count, 1)) + random.normal(0, 6, (count, 3)), 20, 235)
    tones[0] = joint
    return tones[stones]


def pebbles(random):
    """River pebbles of 7 to 12 cm, set in mortar with space between them."""
    width, height, step = 5.0, 4.0, 0.002
    y, z = grid(width, height, step)
    places = jittered(random, width, height, 0.115, 0.16)
    radii = random.uniform(0.035, 0.06, (len(places), 2))
    turns = random.uniform(0, np.pi, len(places))
    best = np.full(y.shape, 1.0)
    stones = np.zeros(y.shape, int)
    _, near = cKDTree(places).query(np.stack([y, z], axis=-1), k=4)
    for k in range(4):
        i = near[..., k]
        dy, dz = y - places[i, 0], z - places[i, 1]
        along = dy * np.cos(turns[i]) + dz * np.sin(turns[i])
        across = dz * np.cos(turns[i]) - dy * np.sin(turns[i])
        inside = (along / radii[i, 0]) ** 2 + (across / radii[i, 1]) ** 2
        nearer = inside < best
        best[nearer], stones[nearer] = inside[nearer], i[nearer] + 1
    heights = 0.03 * np.sqrt(1 - best) + 0.002 * noise(random, y.shape, [3, 20])
    tones = [(150, 140, 125), (105, 100, 98), (178, 160, 135), (130, 95, 80), (190, 186, 178)]
    return Wall(step, heights, painted(random, stones, tones, (165, 158, 145)), stones)


def herringbone(random):
    """Bricks of 24 x 8 cm at 45 degrees, each second one turned by a right angle."""
    width, height, step = 5.0, 4.0, 0.002
    y, z = grid(width, height, step)
    short, ratio, joint = 0.08, 3, 0.005
    a, b = (y + z) / np.sqrt(2) / short + 40, (z - y) / np.sqrt(2) / short + 80
    i, j = np.floor(a).astype(int), np.floor(b).astype(int)
    place = (i - j) % (2 * ratio)
    lies = place < ratio
    first = np.where(lies, i - place, i)
    last = np.where(lies, j, j - (2 * ratio - 1 - place))
    along = np.where(lies, a - first, b - last)
    across = np.where(lies, b - last, a - first)
    edge = short * np.minimum(np.minimum(along, ratio - along), np.minimum(across, 1 - across))
    _, stones = np.unique(first * 1000 + last, return_inverse=True)
    stones = np.where(edge > joint, stones.reshape(y.shape) + 1, 0)
    tilt = random.normal(0, 0.0015, stones.max() + 1)[stones]
    heights = np.where(stones > 0, 0.006 + tilt, 0) + 0.0007 * noise(random, y.shape, [2, 12])
    tones = [(150, 78, 58), (128, 66, 52), (165, 98, 70), (110, 62, 55)]
    return Wall(step, heights, painted(random, stones, tones, (172, 165, 152)), stones)


def cyclopean(random):
    """Blocks of 0.3 to 1.2 m with many corners, laid dry."""
    width, height, step = 10.0, 8.0, 0.004
    y, z = grid(width, height, step)
    places = jittered(random, width, height, 0.7, 0.32)
    bent = np.stack([y + 0.03 * noise(random, y.shape, [40]), z + 0.03 * noise(random, y.shape, [40])], axis=-1)
    distances, near = cKDTree(places).query(bent, k=2)
    edge = 0.5 * (distances[..., 1] - distances[..., 0])
    block = near[..., 0]
    stones = np.where(edge > 0.012, block + 1, 0)
    slope = random.normal(0, 0.05, (len(places), 2))
    tilt = ((bent - places[block]) * slope[block]).sum(axis=-1)
    pillow = 0.05 * (1 - np.exp(-edge / 0.06)) + tilt
    heights = np.where(stones > 0, pillow, -0.04) + 0.004 * noise(random, y.shape, [4, 25])
    tones = [(160, 158, 150), (138, 136, 130), (172, 165, 150)]
    return Wall(step, gaussian_filter(heights, 1), painted(random, stones, tones, (70, 66, 60)), stones)


WALLS = {"pebbles": pebbles, "herringbone": herringbone, "cyclopean": cyclopean}


def lit(random, wall, light):
    """Colours under a light, darker in hollows."""
    dz, dy = np.gradient(wall.heights, wall.step)
    normals = np.stack([np.ones_like(dy), -dy, -dz], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    light = np.array(light) / np.linalg.norm(light)
    hollow = np.clip((wall.heights - gaussian_filter(wall.heights, 12)) / (6 * wall.step), -1, 0)
    shade = (0.35 + 0.75 * np.clip(normals @ light, 0, None)) * (1 + 0.45 * hollow)
    grain = 1 + 0.07 * noise(random, wall.heights.shape, [1, 4, 30])
    return np.clip(wall.colours * (shade * grain)[..., None], 0, 255)


def poses(wall):
    """Rotations from the world to the camera, and places of the cameras: three columns, two rows."""
    height, width = np.array(wall.heights.shape) * wall.step
    distance = 0.62 * width * FOCAL_PX / SIZE[0]
    for k in range(6):
        column, row = k % 3 - 1, k // 3 - 0.5
        target = np.array([0, width * (0.5 + 0.14 * column), height * (0.5 + 0.14 * row)])
        place = target + [distance, 0.22 * distance * column, 0.12 * distance * row]
        forward = (target - place) / np.linalg.norm(target - place)
        right = np.cross([0, 0, -1], forward)
        right /= np.linalg.norm(right)
        yield np.stack([right, np.cross(forward, right), forward]), place


def at(raster, wall, y, z, order):
    where = [z / wall.step, y / wall.step]
    return map_coordinates(raster, where, order=order, mode="nearest")


def photo(random, wall, colours, turn, place):
    """Pixels and stones of a photo."""
    u, v = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    rays = np.stack([(u - SIZE[0] / 2) / FOCAL_PX, (v - SIZE[1] / 2) / FOCAL_PX, np.ones_like(u)], axis=-1) @ turn
    x = np.zeros_like(u)
    for _ in range(4):
        reach = (x - place[0]) / rays[..., 0]
        y, z = place[1] + reach * rays[..., 1], place[2] + reach * rays[..., 2]
        x = at(wall.heights, wall, y, z, 1)
    pixels = np.stack([at(gaussian_filter(colours[..., c], 0.8), wall, y, z, 1) for c in range(3)], axis=-1)
    pixels = np.clip(pixels + random.normal(0, 3, pixels.shape), 0, 255).astype(np.uint8)
    return pixels, at(wall.stones, wall, y, z, 0)


def run_lengths(mask):
    flat = mask.T.ravel()
    ends = np.r_[0, np.flatnonzero(np.diff(flat.astype(np.int8))) + 1, flat.size]
    counts = np.diff(ends).tolist()
    return [0, *counts] if flat[0] else counts


def write_cloud(random, wall, colours, path):
    height, width = np.array(wall.heights.shape) * wall.step
    spacing = 3 * wall.step
    y, z = (part.ravel() for part in grid(width, height, spacing))
    y, z = y + random.uniform(0, spacing, y.size), z + random.uniform(0, spacing, z.size)
    x = at(wall.heights, wall, y, z, 1) + random.normal(0, NOISE_M, y.size)
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.scales = [1e-4] * 3
    las = laspy.LasData(header)
    las.x, las.y, las.z = x, y, z
    las.red, las.green, las.blue = (257 * at(colours[..., c], wall, y, z, 1).astype(np.uint16) for c in range(3))
    las.write(path)


def write_epoch(random, wall, light, folder):
    (folder / "images").mkdir(parents=True)
    colours = lit(random, wall, light)
    write_cloud(random, wall, colours, folder / "cloud.laz")
    width, height = SIZE.tolist()
    images, annotations, lines = [], [], []
    for number, (turn, place) in enumerate(poses(wall), 1):
        name = f"{number:02}.png"
        pixels, stones = photo(random, wall, colours, turn, place)
        Image.fromarray(pixels).save(folder / "images" / name)
        q, t = Rotation.from_matrix(turn).as_quat(), -turn @ place
        lines.append(" ".join(map(str, [number, q[3], *q[:3], *t, 1, name])) + "\n\n")
        images.append({"id": number, "file_name": name, "width": width, "height": height})
        for stone in np.setdiff1d(np.unique(stones), [0]):
            shape = {"size": [height, width], "counts": run_lengths(stones == stone)}
            annotations.append(
                {"id": len(annotations) + 1, "image_id": number, "category_id": 1, "iscrowd": 0, "segmentation": shape}
            )
    (folder / "cameras.txt").write_text(f"1 PINHOLE {width} {height} {FOCAL_PX} {FOCAL_PX} {width / 2} {height / 2}\n")
    (folder / "images.txt").write_text("".join(lines))
    (folder / "points3D.txt").write_text("")
    categories = [{"id": 1, "name": "stone"}]
    coco = {"images": images, "annotations": annotations, "categories": categories}
    (folder / "masks.json").write_text(json.dumps(coco))


def main():
    kind, out = sys.argv[1], Path(sys.argv[2])
    random = np.random.default_rng(5)
    wall = WALLS[kind](random)
    project = f'[project]\nname = "{kind}"\n'
    for number, light in enumerate(LIGHTS, 1):
        name = f"epoch{number}"
        write_epoch(random, wall, light, out / name)
        project += f'\n[[epochs]]\nname = "{name}"\nclouds = ["{name}/cloud.laz"]\nimages = "{name}/images"\ncameras = "{name}"\n'
    (out / "stonewise.toml").write_text(project)


if __name__ == "__main__":
    main()
