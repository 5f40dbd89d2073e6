"""Training crops: rendered walls from files, changed towards real photos, with doors, windows and the like in
front of them, and with real photos that show no stone as background and as things in front."""

import io
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFilter
from scipy.ndimage import find_objects

from things import thing

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
    """Boxes, numbers and images of the stones that count."""
    count = int(stones.max()) + 1
    pixels = np.bincount(stones.ravel(), minlength=count)
    small = (pixels < LEAST_PIXELS) & (pixels > 0)
    small[0] = False
    unknown = unknown | small[stones]
    stones = np.where(small[stones], 0, stones)
    numbers = [n for n in range(1, count) if pixels[n] >= LEAST_PIXELS]
    found = find_objects(stones.astype(np.int32))
    boxes = [[found[n - 1][1].start, found[n - 1][0].start, found[n - 1][1].stop, found[n - 1][0].stop] for n in numbers]
    return {
        "boxes": torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4),
        "numbers": torch.tensor(numbers, dtype=torch.int64),
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


def shaded(relief, rng, side):
    """What a scan without colours shows: relief [4, rows, columns] in a light from above, left or right."""
    def metres(values, half):
        return half * values / (1.02 - np.abs(values))

    height = metres(relief[1], 0.04) + rng.uniform(0, 1) * metres(relief[0], 0.01)
    height = np.asarray(Image.fromarray(height).resize((side, side), Image.BICUBIC))
    is_known = np.asarray(Image.fromarray(relief[3]).resize((side, side), Image.NEAREST)) > 0
    down, right = np.gradient(height)
    slope = -down - rng.choice([-1, 1]) * rng.uniform(0.5, 1.5) * right
    usual = np.percentile(np.abs(slope[is_known]), 80) if is_known.any() else 0
    slope = slope / max(usual, 1e-4)
    value = rng.uniform(0.4, 0.7) + rng.uniform(0.1, 0.3) * slope / np.sqrt(1 + 0.25 * slope * slope)
    value = np.where(is_known, value, rng.choice([0.0, 0.5, 1.0]))
    return np.repeat((255 * value.clip(0, 1)).astype(np.uint8)[..., None], 3, 2)


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
    if some(0.2):
        grey = value.mean(2, keepdims=True)
        value = grey + (value - grey) * max(0.0, rng.uniform(-0.7, 1.5))
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


# Relief of a smooth face as far away as its surroundings.
FLAT = np.array([0, 0, 0, 1], np.float32)[:, None, None]


class Crops:
    """Crops without end: a random part of a random file, at a random size, mirrored in half of the cases.

    Shares of the crops: `furnished` with painted things in front of the wall, `covered` with parts of negatives,
    `empty` without any wall; `grey` is the share of those with relief that show the relief and nothing else.
    """

    def __init__(
        self, folder, negatives, seed,
        side=384, part=(0.6, 1.0), furnished=0.25, covered=0.15, empty=0.03, grey=0.12,
    ):
        self.folder, self.negatives, self.seed = Path(folder), negatives, seed
        self.side, self.part = side, part
        self.furnished, self.covered, self.empty, self.grey = furnished, covered, empty, grey

    def __iter__(self):
        rng = np.random.default_rng(self.seed)
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
        is_grey = relief is not None and rng.random() < self.grey
        if is_grey:
            photo = shaded(relief, rng, side)
        if not is_grey and rng.random() < self.furnished:
            for _ in range(rng.integers(1, 4)):
                colours, shape = thing(rng, side)
                height, width = shape.shape
                top, left = rng.integers(-height // 3, side - height // 2), rng.integers(-width // 3, side - width // 2)
                inner = [slice(max(0, -at), min(n, side - at)) for at, n in ((top, height), (left, width))]
                outer = [slice(max(0, at), min(side, at + n)) for at, n in ((top, height), (left, width))]
                mask = np.zeros_like(unknown)
                mask[outer[0], outer[1]] = shape[inner[0], inner[1]]
                photo[mask] = colours[inner[0], inner[1]][shape[inner[0], inner[1]]]
                stones[mask], unknown[mask] = 0, False
                if relief is not None:
                    relief = np.where(mask[::2, ::2], FLAT * (rng.random() < 0.7), relief)
        if not is_grey and negatives.photos and rng.random() < self.covered + self.empty:
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
