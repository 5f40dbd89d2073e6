"""Measures a trained detector on photos with known stones: a simplified form of what `stonewise segment
--reference` does (same tiles, same rule of scoring; masks cut by a tile are dropped instead of joined, and
enlargement is decided for a whole photo), so compare its figures with each other.

python3 measure_detector.py MODEL.pt --backbone FILE.pth walls FOLDER [COUNT]
python3 measure_detector.py MODEL.pt --backbone FILE.pth photos INSTANCES.json VALID.json IMAGES [NAME ...]
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image

from crops import read_crop, relief_values
from model import Detector

TILE, OVERLAP, CUT = 640, 160, 2
# A photo is enlarged where a quarter of the stones found are smaller, and reduced where larger ones hold a
# quarter of the area found, pixels across.
SMALL, LARGE = 30, 120
LEAST_PIXELS, LEAST_NEW, LEAST_IOU = 40, 0.6, 0.5
SCORES = (0.3, 0.4, 0.5, 0.6, 0.7)


def origins(length):
    """Equal overlapping tiles."""
    if length <= TILE:
        return [0]
    count = -(-(length - OVERLAP) // (TILE - OVERLAP))
    return [round(i * (length - TILE) / (count - 1)) for i in range(count)]


def detect(model, photo, relief, scale):
    """Masks as (score, left, top, boolean array) in pixels of the photo, whole ones only."""
    height, width = photo.shape[:2]
    size = round(width * scale), round(height * scale)
    image = np.asarray(Image.fromarray(photo).resize(size, Image.BICUBIC)) if scale != 1 else photo
    found = []
    for top in origins(size[1]):
        for left in origins(size[0]):
            tile = image[top : top + TILE, left : left + TILE]
            rows, columns = tile.shape[:2]
            pad = (0, -columns % 32, 0, -rows % 32)
            x = F.pad(torch.from_numpy(tile.astype(np.float32).transpose(2, 0, 1) / 255), pad)
            seen = None
            if relief is not None:
                part = torch.from_numpy(relief)[None]
                part = F.interpolate(part, (size[1] // 2, size[0] // 2), mode="bilinear")
                part = part[..., top // 2 : (top + rows) // 2, left // 2 : (left + columns) // 2]
                seen = F.pad(part, (0, x.shape[2] // 2 - part.shape[3], 0, x.shape[1] // 2 - part.shape[2]))
            boxes, scores, masks = model.find(x[None], seen, torch.ones(1))[0]
            edges = [left > 0, top > 0, left + columns < size[0], top + rows < size[1]]
            limits = [CUT, CUT, columns - CUT, rows - CUT]
            for box, score, mask in zip(boxes, scores, masks):
                box = box.tolist()
                cut = [box[0] < limits[0], box[1] < limits[1], box[2] > limits[2], box[3] > limits[3]]
                if score < min(SCORES) or any(c and e for c, e in zip(cut, edges)):
                    continue
                at = [(side + origin) / scale for side, origin in zip(box, (left, top, left, top))]
                drawn = paste(mask, at, width, height)
                if drawn is not None:
                    found.append((float(score), *drawn))
    return found


def paste(mask, box, width, height):
    """Left, top and pixels of a mask: interpolated between the centres of its cells, cut at one half."""
    x0, y0 = max(int(box[0]), 0), max(int(box[1]), 0)
    x1, y1 = min(int(np.ceil(box[2])), width), min(int(np.ceil(box[3])), height)
    if x1 <= x0 or y1 <= y0:
        return None
    u = (torch.arange(x0, x1) + 0.5 - box[0]) / (box[2] - box[0]) * 2 - 1
    v = (torch.arange(y0, y1) + 0.5 - box[1]) / (box[3] - box[1]) * 2 - 1
    grid = torch.stack(torch.meshgrid(u, v, indexing="xy"), -1)[None]
    inside = F.grid_sample(mask[None, None].float(), grid.float(), align_corners=False)[0, 0] >= 0.5
    return (x0, y0, inside.numpy()) if int(inside.sum()) >= LEAST_PIXELS else None


def segment(model, photo, relief):
    """Masks at all scales that the photo needs."""
    found = detect(model, photo, relief, 1)
    sure = [m for m in found if m[0] >= 0.4]
    areas = np.array([m[3].sum() for m in sure]) if sure else np.zeros(0)
    sides = np.sqrt(areas)
    if len(sides) and (sides < SMALL).mean() >= 0.25 and areas.sum() > 0.1 * photo.shape[0] * photo.shape[1]:
        found += detect(model, photo, relief, 2)
    whole = max(photo.shape[:2]) <= TILE
    if not whole and (not len(sides) or areas[sides > LARGE].sum() >= 0.25 * areas.sum()):
        found += [m for m in detect(model, photo, relief, 0.5) if max(m[3].shape) > OVERLAP]
    return found


def merge(found, shape, least_score):
    """Label image: the best first; a mask that repeats a better one or lies mostly on others is dropped."""
    labels = np.zeros(shape, np.int32)
    areas = [0]
    for score, left, top, mask in sorted(found, key=lambda m: -m[0]):
        if score < least_score:
            break
        here = labels[top : top + mask.shape[0], left : left + mask.shape[1]]
        area = int(mask.sum())
        under, counts = np.unique(here[mask], return_counts=True)
        repeats = any(n and c / (area + areas[n] - c) >= LEAST_IOU for n, c in zip(under, counts))
        free = mask & (here == 0)
        if repeats or free.sum() < LEAST_NEW * area or free.sum() < LEAST_PIXELS:
            continue
        areas.append(int(free.sum()))
        here[free] = len(areas) - 1
    return labels


def score(found, wanted, unknown):
    """References, of these recalled, found, of these right, sum of IoU. A stone counts if at least half of
    it is known; a wrong one if most of it is, unless it matches a stone that does not count."""
    def shares(labels):
        pixels = np.bincount(labels.ravel())
        return pixels, np.bincount(labels[unknown], minlength=len(pixels)) * 2 > pixels

    (theirs, theirs_unknown), (own, own_unknown) = shares(found), shares(wanted)
    both = found.astype(np.int64) * len(own) + wanted
    codes, counts = np.unique(both[(found > 0) & (wanted > 0)], return_counts=True)
    pairs = []
    for code, n in zip(codes, counts):
        f, w = divmod(int(code), len(own))
        iou = n / (theirs[f] + own[w] - n)
        if iou >= LEAST_IOU:
            pairs.append((iou, f, w))
    matched, hit = {}, set()
    for iou, f, w in sorted(pairs, reverse=True):
        if f not in matched and w not in hit:
            matched[f] = (iou, w)
            hit.add(w)
    counted = {w for w in range(1, len(own)) if own[w] and not own_unknown[w]}
    total = np.array([len(counted), len(counted & hit), 0, 0, 0.0])
    for f in range(1, len(theirs)):
        if not theirs[f] or (matched[f][1] not in counted if f in matched else theirs_unknown[f]):
            continue
        total[2:] += (1, f in matched, matched[f][0] if f in matched else 0)
    return total


def fill(polygon, shape):
    """Pixels whose centres lie inside a polygon (x, y, x, y, ...)."""
    points = np.array(polygon, float).reshape(-1, 2)
    mask = np.zeros(shape, bool)
    ends = np.roll(points, -1, 0)
    for row in range(max(int(points[:, 1].min() - 1), 0), min(int(points[:, 1].max()) + 2, shape[0])):
        y = row + 0.5
        crosses = (points[:, 1] <= y) != (ends[:, 1] <= y)
        a, b = points[crosses], ends[crosses]
        xs = np.sort(a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]))
        for x0, x1 in xs.reshape(-1, 2):
            mask[row, max(int(np.ceil(x0 - 0.5)), 0) : max(int(np.ceil(x1 - 0.5)), 0)] = True
    return mask


def walls(folder, count=None):
    """Rendered walls from files: name, photo, relief, stones, unknown."""
    stems = sorted(str(p)[: -len(".labels.png")] for p in Path(folder).glob("*.labels.png"))
    for stem in stems[: int(count) if count else None]:
        photo, stones, unknown, relief = read_crop(stem)
        yield Path(stem).name, photo, None if relief is None else relief_values(relief), stones, unknown


def photos(instances, valid, images, *names):
    """Real photos with reference masks that are complete in valid regions."""
    reference, regions = json.load(open(instances)), json.load(open(valid))
    regions = regions.get("images", regions)
    if isinstance(regions, list):
        regions = {r["file_name"]: r for r in regions}
    for image in reference["images"]:
        name = image["file_name"]
        if names and not any(n in name for n in names):
            continue
        photo = np.asarray(Image.open(Path(images) / name).convert("RGB"))
        known = np.zeros(photo.shape[:2], bool)
        for region in regions[name]["valid"]:
            known |= fill(region["outer"], known.shape)
            for hole in region["holes"]:
                known &= ~fill(hole, known.shape)
        stones = np.zeros(known.shape, np.int32)
        own = [a for a in reference["annotations"] if a["image_id"] == image["id"]]
        masks = [np.any([fill(p, known.shape) for p in a["segmentation"]], 0) for a in own]
        for number, mask in enumerate(sorted(masks, key=lambda m: -m.sum()), 1):
            stones[mask] = number
        yield name, photo, None, stones, ~known


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model")
    parser.add_argument("--backbone", required=True)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--no-relief", action="store_true")
    parser.add_argument("--fast", action="store_true", help="bfloat16, as in training")
    parser.add_argument("kind", choices=["walls", "photos"])
    parser.add_argument("where", nargs="+")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    model = Detector()
    stored = torch.load(args.model)
    model.load_state_dict({k: v.float() for k, v in stored["weights"].items()}, strict=False)
    model.backbone.body.load_package(args.backbone)
    model.eval().to(memory_format=torch.channels_last)
    model.is_fast = args.fast

    totals, begun = {s: np.zeros(5) for s in SCORES}, time.process_time()
    for name, photo, relief, stones, unknown in (walls if args.kind == "walls" else photos)(*args.where):
        found = segment(model, photo, None if args.no_relief else relief)
        for least in SCORES:
            totals[least] += score(merge(found, stones.shape, least), stones, unknown)
    seconds = time.process_time() - begun
    print(f"step {stored['step']}, {args.where[0]}: {int(totals[SCORES[0]][0])} stones, {seconds:.0f} s")
    for least, (references, recalled, number, right, iou) in totals.items():
        precision, recall = right / max(number, 1), recalled / max(references, 1)
        f1 = 2 * precision * recall / max(precision + recall, 1e-9)
        print(f"  from {least}: P {precision:.3f} R {recall:.3f} F1 {f1:.3f} IoU {iou / max(right, 1):.3f}")


if __name__ == "__main__":
    main()
