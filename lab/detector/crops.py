"""Training crops: rendered walls from files, changed towards real photos, with real photos that show no stone
as background and as things in front."""

import io
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFilter

# A smaller stone, or a part of one, teaches nothing.
LEAST_PIXELS = 40
# A stone of which less than this share remains beside what was put before it is doubtful.
LEAST_REST = 0.25
UNKNOWN_BIT = 0x8000


def read_crop(stem):
    """Photo, stone numbers, unknown places, relief of half the size or `None`, as arrays."""
    photo = np.asarray(Image.open(f"{stem}.photo.png").convert("RGB"))
    coded = np.asarray(Image.open(f"{stem}.labels.png")).astype(np.int64)
    path = Path(f"{stem}.relief.png")
    relief = np.asarray(Image.open(path)) if path.exists() else None
    return photo, coded & (UNKNOWN_BIT - 1), (coded & UNKNOWN_BIT) != 0, relief


def relief_values(relief):
    """Channels [4, rows, columns] from the bytes of the file."""
    values = relief.astype(np.float32).transpose(2, 0, 1) / 255
    values[:2] = values[:2] * 2 - 1
    return values * (values[3:4] > 0)


def targets(stones, unknown):
    """Boxes, numbers and images of the stones that count, for `Detector.losses`."""
    count = int(stones.max()) + 1
    pixels = np.bincount(stones.ravel(), minlength=count)
    small = (pixels < LEAST_PIXELS) & (pixels > 0)
    small[0] = False
    unknown = unknown | small[stones]
    stones = np.where(small[stones], 0, stones)
    numbers = [n for n in range(1, count) if pixels[n] >= LEAST_PIXELS]
    low = np.full((count, 2), 1 << 20)
    high = np.zeros((count, 2), np.int64)
    rows, columns = np.nonzero(stones)
    at = stones[rows, columns]
    for axis, places in enumerate((columns, rows)):
        np.minimum.at(low[:, axis], at, places)
        np.maximum.at(high[:, axis], at, places + 1)
    boxes = np.concatenate([low[numbers], high[numbers]], 1).reshape(-1, 4)
    return {
        "boxes": torch.from_numpy(boxes.astype(np.float32)),
        "labels": torch.ones(len(numbers), dtype=torch.int64),
        "numbers": torch.tensor(numbers, dtype=torch.int64),
        "masks": torch.empty(0),
        "stones": torch.from_numpy(stones),
        "unknown": torch.from_numpy(unknown),
    }


class Negatives:
    """Real photos that show no stone."""

    def __init__(self, folder):
        paths = sorted(Path(folder).glob("*.*")) if folder else []
        self.photos = [Image.open(path).convert("RGB") for path in paths]

    def patch(self, rng, side):
        """A square of a random photo, at a random size."""
        photo = self.photos[rng.integers(len(self.photos))]
        size = min(rng.uniform(0.3, 1.0) * min(photo.size), side / 0.5)
        left, top = (rng.uniform(0, n - size) for n in photo.size)
        return photo.resize((side, side), Image.BILINEAR, (left, top, left + size, top + size))

    def outline(self, rng, side):
        """A rectangle, an ellipse or a polygon as a mask."""
        mask = Image.new("L", (side, side))
        draw = ImageDraw.Draw(mask)
        wide, high = side * rng.uniform(0.1, 0.6, 2)
        x, y = rng.uniform(0, side, 2)
        box = [x - wide / 2, y - high / 2, x + wide / 2, y + high / 2]
        kind = rng.integers(3)
        if kind == 0:
            draw.rectangle(box, fill=255)
        elif kind == 1:
            draw.ellipse(box, fill=255)
        else:
            angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 12)))
            radii = rng.uniform(0.5, 1.0, len(angles)) / 2
            corners = zip(x + wide * radii * np.cos(angles), y + high * radii * np.sin(angles))
            draw.polygon(list(corners), fill=255)
        return np.asarray(mask) > 0


def towards_real(photo, rng):
    """Changes of light, lens, camera and file beyond those that the renderer draws, each in some photos."""
    def some(share):
        return rng.random() < share

    value = np.asarray(photo).astype(np.float32) / 255
    if some(0.3):
        value = value ** 2.0 ** rng.uniform(-0.7, 0.7)
    if some(0.25):
        value = value * 2.0 ** rng.uniform(-0.25, 0.25, 3).astype(np.float32)
    if some(0.1):
        haze = rng.uniform(0.5, 0.95, 3).astype(np.float32)
        share = rng.uniform(0.05, 0.5)
        value = value * (1 - share) + haze * share
    if some(0.15):
        grey = value.mean(2, keepdims=True)
        value = grey + (value - grey) * rng.uniform(0.0, 1.5)
    if some(0.15):
        value = value + rng.normal(0, rng.uniform(0.005, 0.04), value.shape).astype(np.float32)
    photo = Image.fromarray((value.clip(0, 1) * 255).round().astype(np.uint8))
    if some(0.15):
        photo = photo.filter(ImageFilter.GaussianBlur(rng.uniform(0.3, 1.3)))
    if some(0.25):
        photo = photo.filter(ImageFilter.UnsharpMask(rng.uniform(0.7, 2.5), int(rng.uniform(40, 200)), 0))
    if some(0.3):
        buffer = io.BytesIO()
        photo.save(buffer, "JPEG", quality=int(rng.uniform(35, 95)))
        photo = Image.open(buffer).convert("RGB")
    return photo


class Crops(torch.utils.data.IterableDataset):
    """Crops without end: a random part of a random file, at a random size, mirrored in half of the cases."""

    def __init__(self, folder, negatives, seed, side=320, part=(0.6, 1.0), covered=0.15, empty=0.03):
        self.folder, self.negatives, self.seed = Path(folder), negatives, seed
        self.side, self.part, self.covered, self.empty = side, part, covered, empty

    def __iter__(self):
        worker = torch.utils.data.get_worker_info()
        rng = np.random.default_rng([self.seed, worker.id if worker else 0])
        negatives = Negatives(self.negatives)
        while True:
            # The renderer may still be writing; the labels of a crop come last.
            stems = sorted(str(p)[: -len(".labels.png")] for p in self.folder.glob("*.labels.png"))[:-1]
            for stem in rng.choice(stems, min(len(stems), 400), replace=False):
                yield self.crop(stem, negatives, rng)

    def crop(self, stem, negatives, rng):
        photo, stones, unknown, relief = read_crop(stem)
        side, full = self.side, photo.shape[0]
        size = full * rng.uniform(*self.part)
        left, top = rng.uniform(0, full - size, 2)
        box = (left, top, left + size, top + size)
        photo = Image.fromarray(photo).resize((side, side), Image.BICUBIC, box)
        near = lambda a, t: np.asarray(Image.fromarray(a.astype(t)).resize((side, side), Image.NEAREST, box))
        stones = near(stones, np.int32).astype(np.int64)
        unknown = near(unknown, np.uint8) > 0
        if relief is not None:
            half = [v * relief.shape[0] / full for v in box]
            relief = np.stack([
                np.asarray(Image.fromarray(c).resize((side // 2, side // 2), Image.BILINEAR, half))
                for c in relief.transpose(2, 0, 1)
            ], 2)
            relief = relief_values(relief)

        photo = np.array(photo)
        before = np.bincount(stones.ravel())
        if negatives.photos and rng.random() < self.covered + self.empty:
            is_empty = rng.random() < self.empty / (self.covered + self.empty)
            for _ in range(1 if is_empty else rng.integers(1, 4)):
                mask = np.ones_like(unknown) if is_empty else negatives.outline(rng, side)
                photo[mask] = np.asarray(negatives.patch(rng, side))[mask]
                stones[mask], unknown[mask] = 0, False
                if relief is not None:
                    relief = relief * ~mask[::2, ::2]
        rest = np.bincount(stones.ravel(), minlength=len(before))
        torn = rest < LEAST_REST * before
        torn[0] = False
        unknown = unknown | torn[stones]
        stones[torn[stones]] = 0

        photo = np.asarray(towards_real(photo, rng)).astype(np.float32).transpose(2, 0, 1) / 255
        if rng.random() < 0.5:
            photo, stones, unknown = (a[..., ::-1].copy() for a in (photo, stones, unknown))
            relief = None if relief is None else relief[..., ::-1].copy()
        present = relief is not None
        if not present:
            relief = np.zeros((4, side // 2, side // 2), np.float32)
        return torch.from_numpy(photo), torch.from_numpy(relief), float(present), targets(stones, unknown)


def collate(crops):
    photos, reliefs, present, wanted = zip(*crops)
    return torch.stack(photos), torch.stack(reliefs), torch.tensor(present), list(wanted)
