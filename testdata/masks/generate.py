"""Makes masks.json: what pycocotools and OpenCV say about polygons and run-length masks.

runs       binary masks as rows of 0 and 1 with pycocotools' uncompressed and compressed runs
polygons   polygons with the runs that pycocotools (frPyObjects, merge) makes of them
filled     polygons with the runs that OpenCV's fillPoly makes of them, drawn eight times larger and sampled at pixel centres
parts      label images with the parts that OpenCV's connectedComponents (4-neighbours) finds in each label

Run: python3 generate.py   (needs numpy, opencv-python-headless and pycocotools; OpenCV 5.0.0, pycocotools 2.0.11 made the file)
"""
import json
from pathlib import Path

import cv2
import numpy as np
from pycocotools import mask as coco

rng = np.random.default_rng(5)


def compressed(mask):
    return coco.encode(np.asfortranarray(mask.astype(np.uint8)))["counts"].decode()


def uncompressed(mask):
    """Runs column by column, written out; pycocotools only exports the compressed form."""
    flat = mask.flatten(order="F").astype(int)
    ends = np.flatnonzero(np.diff(flat)) + 1
    runs = np.diff(np.concatenate([[0], ends, [flat.size]]))
    runs = ([0] if flat[0] else []) + [int(r) for r in runs]
    check = coco.decode(coco.frPyObjects({"size": list(mask.shape), "counts": runs}, *mask.shape))
    assert (check == mask).all()
    return runs


def rows(mask):
    return ["".join(str(int(v)) for v in row) for row in mask]


def runs():
    masks = [np.zeros((5, 7)), np.ones((5, 7)), np.eye(6, 9), 1 - np.eye(6, 9), np.tri(13, 4), rng.random((9, 14)) < 0.5]
    long = np.zeros((90, 60))
    long[7:80, 3:50] = 1
    long[20:40, 11:13] = 0
    masks.append(long)
    for mask in masks:
        yield {"rows": rows(mask), "counts": uncompressed(mask), "compressed": compressed(mask)}


def star(cx, cy, radius, n, roughness):
    angle = np.sort(rng.uniform(0, 2 * np.pi, n))
    r = radius * (1 + roughness * rng.uniform(-1, 1, n))
    return np.round(np.stack([cx + r * np.cos(angle), cy + r * np.sin(angle)], axis=1), 2)


def scenes():
    yield [star(200, 150, 110, 30, 0.15)]
    yield [star(200, 150, 120, 80, 0.3)]
    yield [star(90, 150, 70, 20, 0.1), star(300, 120, 75, 20, 0.1)]          # two parts
    yield [star(150, 150, 90, 20, 0.1), star(210, 150, 90, 20, 0.1)]         # overlapping parts: joined
    yield [star(390, 10, 130, 30, 0.1)]                                      # cut by the photo's corner
    yield [np.round(star(200, 150, 110, 40, 0.2))]                           # whole numbers
    yield [np.array([[100.0, 50], [300, 50], [300, 250], [100, 250]])]


def polygons():
    h, w = 300, 400
    for parts in scenes():
        flat = [p.ravel().tolist() for p in parts]
        merged = coco.merge(coco.frPyObjects(flat, h, w))
        yield {"width": w, "height": h, "polygons": flat, "compressed": merged["counts"].decode()}


def filled():
    h, w, k = 300, 400, 8
    for parts in scenes():
        total = np.zeros((h, w), np.uint8)
        for part in parts:
            # OpenCV's integer coordinates are pixel centres, so a corner at c lies at k c - 1/2 of the larger picture.
            big = np.zeros((h * k, w * k), np.uint8)
            shifted = np.round((part * k - 0.5) * 256).astype(np.int32)
            cv2.fillPoly(big, [shifted.reshape(-1, 1, 2)], 1, shift=8)
            total |= big[k // 2::k, k // 2::k]
        yield {"width": w, "height": h, "polygons": [p.ravel().tolist() for p in parts], "compressed": compressed(total)}


def parts():
    for density in (0.4, 0.6, 0.8):
        labels = (rng.random((24, 31)) < density) * rng.integers(1, 3, (24, 31))
        sizes = {}
        for label in (1, 2):
            _, _, stats, _ = cv2.connectedComponentsWithStats((labels == label).astype(np.uint8), connectivity=4)
            sizes[str(label)] = sorted(int(a) for a in stats[1:, cv2.CC_STAT_AREA])
        yield {"rows": rows(labels), "areas": sizes}


if __name__ == "__main__":
    data = {"runs": list(runs()), "polygons": list(polygons()), "filled": list(filled()), "parts": list(parts())}
    text = json.dumps(data, separators=(",", ":")).replace("},{", "},\n{")
    Path(__file__).with_name("masks.json").write_text(text + "\n")
