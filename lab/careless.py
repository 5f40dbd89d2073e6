"""Careless and malicious surveys made from a sound one with truth (`dam_small/combo`), and what `check` and `run` say.

python3 lab/careless.py PROGRAM SURVEY OUT [NAME ...]

Prints a row of a Markdown table for each: exit codes, measured stones, median error, the share of errors within 1.96
standard deviations of the worst axis, the number of wrong rows (off by more than 5 standard deviations and 5 mm) and
of rows called loose by mistake, and doubts. Both numbers count only rows within 5 cm of a stone that is not cut by
the edge of the section and of which 35 % is visible. In surveys named `scene: ...`, the photos of the second epoch
show a changed scene, and no masks are given. Needs numpy, laspy and, for photos, Pillow.
"""

import csv
import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np

# Rows farther than this from every stone are left out, and so are rows of stones of which a smaller share is visible.
BESIDE_M = 0.05
COUNTABLE_SHARE = 0.35


def pixels(annotation):
    """The mask, by columns."""
    height, width = annotation["segmentation"]["size"]
    counts = annotation["segmentation"]["counts"]
    values = np.arange(len(counts)) % 2 == 1
    return np.repeat(values, counts).reshape(width, height)


def put(annotation, mask):
    """Replaces the mask; says whether anything is left of it."""
    flat = mask.ravel()
    ends = np.r_[0, np.flatnonzero(np.diff(flat.astype(np.int8))) + 1, flat.size]
    counts = np.diff(ends).tolist()
    columns, rows = np.nonzero(mask)
    if not len(columns):
        return False
    size = [int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]
    annotation["segmentation"]["counts"] = [0, *counts] if flat[0] else counts
    annotation["bbox"] = [int(columns.min()), int(rows.min()), *size]
    annotation["area"] = len(columns)
    return True


def shift(coco):
    """All masks 20 pixels to the right."""

    def moved(annotation):
        mask = pixels(annotation)
        new = np.zeros_like(mask)
        new[20:] = mask[:-20]
        return put(annotation, new)

    coco["annotations"] = [a for a in coco["annotations"] if moved(a)]


def of_photo(coco, photo):
    return [a for a in coco["annotations"] if a["image_id"] == photo["id"]]


def one_for_all(coco):
    """One mask over the whole wall in every photo."""
    kept = []
    for photo in coco["images"]:
        own = of_photo(coco, photo)
        put(own[0], np.any([pixels(a) for a in own], axis=0))
        kept.append(own[0])
    coco["annotations"] = kept


def one_over_all(coco):
    """One mask over the whole wall in every photo, beside the masks of the stones."""
    stones = json.loads(json.dumps(coco["annotations"]))
    one_for_all(coco)
    for number, annotation in enumerate(coco["annotations"]):
        annotation["id"] = 1_000_000 + number
    coco["annotations"] += stones


def pairs(coco):
    """Two neighbours under one mask each."""
    kept = []
    for photo in coco["images"]:
        own = sorted(of_photo(coco, photo), key=lambda a: (a["bbox"][1] // 40, a["bbox"][0]))
        for first, *other in (own[i : i + 2] for i in range(0, len(own), 2)):
            put(first, np.any([pixels(a) for a in (first, *other)], axis=0))
            kept.append(first)
    coco["annotations"] = kept


def exchange(count):
    """The masks of the first photos go to the next one each."""

    def change(coco):
        photos = coco["images"][:count]
        names = [photo["file_name"] for photo in photos]
        for photo, name in zip(photos, names[1:] + names[:1]):
            photo["file_name"] = name

    return change


def focal(factor):
    def change(text):
        return re.sub(r"<f>([\d.]+)</f>", lambda m: f"<f>{float(m[1]) * factor!r}</f>", text)

    return change


def poses(factor):
    """Positions of the cameras, for a block of another scale."""

    def transform(match):
        values = [float(v) for v in match[1].split()]
        values[3], values[7], values[11] = (factor * values[i] for i in (3, 7, 11))
        return f"<transform>{' '.join(map(repr, values))}</transform>"

    return lambda text: re.sub(r"<transform>([^<]*)</transform>", transform, text)


def scale(percent):
    return lambda points: points * (1 + percent / 100)


def mirror(points):
    return points * [1, -1, 1]


def mirrored(photo, target, _cameras):
    from PIL import Image, ImageOps

    ImageOps.mirror(Image.open(photo)).save(target, quality=95)


def numbers_of(text, tag):
    return np.array([float(v) for v in re.search(rf"<{tag}[^>]*>([^<]*)</{tag}>", text)[1].split()])


def rays(cameras, photo, size):
    """Where a photo was taken, and the direction of every pixel, without distortion; `None` without a pose."""
    text = cameras.read_text()
    pose = re.search(rf'label="{photo.stem}">\s*<transform>([^<]*)</transform>', text)
    if not pose:
        return None
    pose = np.array([float(v) for v in pose[1].split()]).reshape(4, 4)
    block = text[text.index("<rotation") :]
    turn, scaled = numbers_of(block, "rotation").reshape(3, 3), numbers_of(block, "scale")[0]
    adjusted = text[text.index('class="adjusted"') :]
    f, cx, cy = (numbers_of(adjusted, tag)[0] for tag in ("f", "cx", "cy"))
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    local = np.stack([(x - size[0] / 2 - cx) / f, (y - size[1] / 2 - cy) / f, np.ones_like(x)], axis=-1)
    place = scaled * turn @ pose[:3, 3] + numbers_of(block, "translation")
    return place, local @ (turn @ pose[:3, :3]).T


@dataclass
class Seen:
    """A photo (0 to 1), and for each pixel where its ray meets the plane of the face: metres along the wall and up."""

    pixels: np.ndarray
    along: np.ndarray
    up: np.ndarray
    # The first photo of the epoch: what a print shows.
    first: np.ndarray
    random: np.random.Generator

    def painted(self, part, colours):
        """The photo with other colours in a part."""
        return np.where(part[..., None], colours, self.pixels)


def paint(change, before=0.0):
    """Changes photos by something that stands this far in front of the wall, whose face has a batter of 1:5."""

    def painted(photo, target, cameras):
        from PIL import Image

        read = lambda path: Image.open(path).convert("RGB")
        image = read(photo)
        seen = rays(cameras, photo, image.size)
        if seen is None:
            image.save(target, quality=95)
            return
        place, ray = seen
        far = (before - place[0] - place[2] / 5) / (ray[..., 0] + ray[..., 2] / 5)
        along, up = (place[k] + far * ray[..., k] for k in (1, 2))
        first = np.asarray(read(min(photo.parent.iterdir()))) / 255.0
        pixels = change(Seen(np.asarray(image) / 255.0, along, up, first, np.random.default_rng(1)))
        Image.fromarray((255 * pixels.clip(0, 1)).astype(np.uint8)).save(target, quality=95)

    return painted


def within(values, low, high):
    return (values > low) & (values < high)


def night(seen):
    """A flash lights the middle of the photo; the rest is dark and noisy."""
    height, width = seen.along.shape
    y, x = np.mgrid[:height, :width]
    off = np.hypot(x - width / 2, y - height / 2) / (width / 2)
    lit = 0.9 / (1 + (1.6 * off) ** 4)
    return seen.pixels * lit[..., None] + seen.random.normal(0, 0.04, seen.pixels.shape)


def half_wet(seen):
    """Water darkens one half of the wall."""
    return seen.painted(seen.along > 0, 0.45 * seen.pixels**1.2)


def snowed(seen):
    """Snow hides the lowest 60 cm, and flakes are in the air."""
    drift = seen.up < 0.6 + 0.1 * np.sin(3 * seen.along)
    flakes = seen.random.random(seen.up.shape) < 0.01
    return seen.painted(drift | flakes, 0.93 + 0.03 * seen.random.normal(size=(*seen.up.shape, 1)))


def flooded(seen):
    """Water stands 80 cm deep in front of the wall and mirrors it."""
    waves = 0.06 * np.sin(25 * seen.up + 3 * np.sin(4 * seen.along))
    water = 0.35 * seen.pixels[::-1] + np.array([0.2, 0.3, 0.35]) + waves[..., None]
    return seen.painted(seen.up < 0.8, water)


def people(seen):
    """Three people stand in front of the wall."""
    for number, y in enumerate((-1.2, -0.1, 1.0)):
        head = np.hypot(seen.along - y, seen.up - 1.6) < 0.13
        body = within(seen.along, y - 0.25, y + 0.25) & within(seen.up, -0.3, 1.45)
        seen.pixels = seen.painted(head, np.array([0.8, 0.6, 0.5]))
        seen.pixels = seen.painted(body, np.roll([0.7, 0.2, 0.15], number))
    return seen.pixels


def printed(is_mirrored):
    """A print of the wall, mirrored or not, hangs in front of it: it shows stones where there are none."""

    def change(seen):
        height, width = seen.along.shape
        row = height * (0.25 + 0.3 * (1.8 - seen.up) / 1.1)
        column = width * (0.3 + 0.3 * (seen.along + 0.9) / 1.4)
        column = width - 1 - column if is_mirrored else column
        row, column = (v.clip(0, n - 1).astype(int) for v, n in ((row, height), (column, width)))
        part = within(seen.along, -0.9, 0.5) & within(seen.up, 0.7, 1.8)
        return seen.painted(part, seen.first[row, column])

    return change


# Which epochs, and what is done to them.
SURVEYS = {
    "sound": ((), {}),
    "masks 20 px beside": ((2,), {"masks": shift}),
    "masks 20 px beside, both epochs": ((1, 2), {"masks": shift}),
    "masks of two photos exchanged": ((2,), {"masks": exchange(2)}),
    "masks of all photos exchanged": ((2,), {"masks": exchange(99)}),
    "one mask over the wall": ((2,), {"masks": one_for_all}),
    "one mask over the wall, and the stones": ((2,), {"masks": one_over_all}),
    "one mask for two stones": ((2,), {"masks": pairs}),
    **{f"focal length +{p} %": ((2,), {"cameras": focal(1 + p / 100)}) for p in (1, 5, 10)},
    **{f"focal length +{p} %, both epochs": ((1, 2), {"cameras": focal(1 + p / 100)}) for p in (5, 10)},
    **{f"cloud +{p} %": ((2,), {"cloud": scale(p)}) for p in (0.1, 0.3, 1, 5)},
    **{
        f"cloud and cameras +{p} %": ((2,), {"cloud": scale(p), "cameras": poses(1 + p / 100)})
        for p in (0.1, 0.3, 1, 5)
    },
    "cloud mirrored": ((2,), {"cloud": mirror}),
    "clouds mirrored, both epochs": ((1, 2), {"cloud": mirror}),
    "photos mirrored": ((2,), {"photos": mirrored}),
    "photos mirrored, both epochs": ((1, 2), {"photos": mirrored}),
    **{
        f"scene: {name}": ((2,), {"photos": change})
        for name, change in {
            "sound": paint(lambda seen: seen.pixels),
            "night, flash": paint(night),
            "half wet": paint(half_wet),
            "snow": paint(snowed),
            "flood": paint(flooded),
            "people": paint(people, before=1.5),
            "print": paint(printed(False), before=0.5),
            "mirrored print": paint(printed(True), before=0.5),
        }.items()
    },
}


def write(survey, out, epochs, changes, has_masks):
    """The project of a survey with these changes in these epochs."""
    text = '[project]\nname = "careless"\n'
    for epoch in (1, 2):
        source = survey / f"epoch{epoch}"
        change = changes if epoch in epochs else {}
        paths = {
            "clouds": source / "cloud_tls.laz",
            "images": source / "images",
            "cameras": source / "cameras_metashape.xml",
            "masks": survey / f"truth/masks/epoch{epoch}_coco.json",
        }
        new = {key: out / f"{key}{epoch}{path.suffix}" for key, path in paths.items()}
        if "cloud" in change:
            cloud = laspy.read(paths["clouds"])
            points = change["cloud"](np.c_[cloud.x, cloud.y, cloud.z])
            cloud.header.offsets = points.min(axis=0).round()
            cloud.x, cloud.y, cloud.z = points.T
            paths["clouds"] = new["clouds"]
            cloud.write(new["clouds"])
        if "cameras" in change:
            new["cameras"].write_text(change["cameras"](paths["cameras"].read_text()))
            paths["cameras"] = new["cameras"]
        if "masks" in change:
            coco = json.loads(paths["masks"].read_text())
            change["masks"](coco)
            new["masks"].write_text(json.dumps(coco))
            paths["masks"] = new["masks"]
        if "photos" in change:
            new["images"].mkdir(exist_ok=True)
            for photo in paths["images"].iterdir():
                change["photos"](photo, new["images"] / photo.name, paths["cameras"])
            paths["images"] = new["images"]
        if not has_masks:
            del paths["masks"]
        keys = {key: json.dumps(str(path.resolve())) for key, path in paths.items()}
        keys["clouds"] = f"[{keys['clouds']}]"
        text += f'\n[[epochs]]\nname = "{epoch}"\n' + "".join(f"{k} = {v}\n" for k, v in keys.items())
    (out / "stonewise.toml").write_text(text)


def score(survey, results):
    """Measured stones, median error, coverage on the worst axis, wrong rows and rows called loose by mistake."""
    truth = list(csv.DictReader((survey / "truth/stones.csv").open()))
    rows = [r for r in csv.DictReader((results / "stones.csv").open()) if r["status"] == "ok"]
    numbers = lambda rows, names: np.array([[float(r[n]) for n in names] for r in rows]).reshape(-1, 3)
    places, motions = numbers(truth, ("cx", "cy", "cz")), numbers(truth, ("dx", "dy", "dz"))
    if not rows:
        return "0 | | |"
    apart = np.linalg.norm(places - numbers(rows, "xyz")[:, None], axis=2)
    owner = apart.argmin(axis=1)
    errors = numbers(rows, ("dx", "dy", "dz")) - motions[owner]
    deviations = np.sqrt(numbers(rows, ("cov_xx", "cov_yy", "cov_zz")))
    covered = (abs(errors) < 1.96 * deviations).mean(axis=0).min()
    lengths = np.linalg.norm(errors, axis=1)
    seen = np.array([t["edge"] == "0" and float(t["vis_tls"]) >= COUNTABLE_SHARE for t in truth])
    on_stone = (apart.min(axis=1) < BESIDE_M) & seen[owner]
    wrong = on_stone & (abs(errors) > 5 * deviations).any(axis=1) & (lengths > 0.005)
    called = on_stone & [r["loose"] == "1" and truth[k]["loose"] != "1" for r, k in zip(rows, owner)]
    return f"{len(rows)} | {1e3 * np.median(lengths):.1f} mm | {covered:.2f} | {wrong.sum()}, {called.sum()}"


def main():
    program, survey, out, *names = sys.argv[1:]
    survey, out = Path(survey), Path(out)
    print("| survey | check | run | measured | median error | coverage | wrong, loose by mistake | verdict; doubts |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name in names or SURVEYS:
        folder = out / re.sub(r"[^a-z0-9.]+", "-", name)
        folder.mkdir(parents=True, exist_ok=True)
        write(survey, folder, *SURVEYS[name], has_masks=not name.startswith("scene"))
        project, results = folder / "stonewise.toml", folder / "results"
        check = [program, "check", project, "--page", folder / "check.html"]
        run = [program, "--quiet", "run", project, "--out", results]
        codes, said = [], ""
        for command in (check, run):
            done = subprocess.run(command, capture_output=True, text=True)
            codes.append(str(done.returncode))
            said = done.stderr
        scored, verdict = " | | | ", said.strip().splitlines()[-1] if said else ""
        if (results / "verdict.json").exists():
            scored = score(survey, results)
            doubts = [w["message"] for w in json.loads((results / "run.json").read_text())["warnings"] if w.get("doubt")]
            state = json.loads((results / "verdict.json").read_text())["state"]
            verdict = "; ".join([state, *(doubt.split(":")[0][:90] for doubt in doubts)])
        print(f"| {name} | {' | '.join(codes)} | {scored} | {verdict} |", flush=True)


if __name__ == "__main__":
    main()
