"""Makes masks that are partly right, and scores them with pycocotools.

Run with numpy and pycocotools (2.0.11); writes reference.json, found.json and expected.json beside itself.
"""

import json
from pathlib import Path

import numpy as np
from pycocotools import mask as runs
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

WIDTH, HEIGHT, CELLS, PHOTOS = 96, 72, 28, 3
rng = np.random.default_rng(7)


def cells(points):
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.argmin((x[..., None] - points[:, 0]) ** 2 + (y[..., None] - points[:, 1]) ** 2, axis=2)


def annotation(number, photo, mask, score):
    code = runs.encode(np.asfortranarray(mask.astype(np.uint8)))
    return {
        "id": number,
        "image_id": photo,
        "category_id": 1,
        "iscrowd": 0,
        "area": int(mask.sum()),
        "bbox": [float(v) for v in runs.toBbox(code)],
        "segmentation": {"size": [HEIGHT, WIDTH], "counts": code["counts"].decode()},
        "score": score,
    }


reference, found = [], []
for photo in range(1, PHOTOS + 1):
    points = rng.uniform(0, 1, (CELLS, 2)) * [WIDTH, HEIGHT]
    moved = points + rng.normal(0, 1, points.shape) * rng.uniform(0, 4, (CELLS, 1))
    truth, guess = cells(points), cells(moved)
    guess[guess == 5] = 6  # two stones as one
    for cell in range(CELLS):
        if (truth == cell).any() and rng.uniform() < 0.85:
            reference.append(annotation(len(reference) + 1, photo, truth == cell, 1.0))
        if (guess == cell).any() and rng.uniform() < 0.85:
            # Every score once, so that the order does not hang on how ties are broken.
            score = round(float(rng.uniform(0.05, 0.9)), 3) + 1e-5 * len(found)
            found.append(annotation(len(found) + 1, photo, guess == cell, score))

images = [{"id": p, "file_name": f"{p}.png", "width": WIDTH, "height": HEIGHT} for p in range(1, PHOTOS + 1)]
category = [{"id": 1, "name": "stone"}]
here = Path(__file__).parent
for name, annotations in [("reference", reference), ("found", found)]:
    content = {"images": images, "annotations": annotations, "categories": category}
    (here / f"{name}.json").write_text(json.dumps(content))

truth = COCO(str(here / "reference.json"))
evaluation = COCOeval(truth, truth.loadRes(found), "segm")
evaluation.params.maxDets = [1000]
evaluation.params.areaRng, evaluation.params.areaRngLbl = [[0, 1e10]], ["all"]
evaluation.evaluate()
evaluation.accumulate()
precision = evaluation.eval["precision"][:, :, 0, 0, 0]  # IoU thresholds x recalls
right = sum(int((e["dtMatches"][0] > 0).sum()) for e in evaluation.evalImgs)
expected = {
    "ap": float(precision.mean()),
    "ap50": float(precision[0].mean()),
    "right": right,
    "found": len(found),
    "references": len(reference),
}
(here / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")
