"""Careless and malicious surveys made from a sound one with truth (`dam_small/combo`), and what `check` and `run` say.

python3 lab/careless.py PROGRAM SURVEY OUT [NAME ...]

Prints a row of a Markdown table for each: exit codes, measured stones, median error, the share of errors within 1.96
standard deviations of the worst axis, doubts. Needs numpy, laspy and, for mirrored photos, Pillow.
"""

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import laspy
import numpy as np


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


def mirrored(photo, target):
    from PIL import Image, ImageOps

    ImageOps.mirror(Image.open(photo)).save(target, quality=95)


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
}


def write(survey, out, epochs, changes):
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
                change["photos"](photo, new["images"] / photo.name)
            paths["images"] = new["images"]
        keys = {key: json.dumps(str(path.resolve())) for key, path in paths.items()}
        keys["clouds"] = f"[{keys['clouds']}]"
        text += f'\n[[epochs]]\nname = "{epoch}"\n' + "".join(f"{k} = {v}\n" for k, v in keys.items())
    (out / "stonewise.toml").write_text(text)


def score(survey, results):
    """Measured stones, their median error, and coverage on the worst axis."""
    truth = list(csv.DictReader((survey / "truth/stones.csv").open()))
    rows = [r for r in csv.DictReader((results / "stones.csv").open()) if r["status"] == "ok"]
    numbers = lambda rows, names: np.array([[float(r[n]) for n in names] for r in rows]).reshape(-1, 3)
    places, motions = numbers(truth, ("cx", "cy", "cz")), numbers(truth, ("dx", "dy", "dz"))
    if not rows:
        return "0 | |"
    owner = [np.argmin(((places - place) ** 2).sum(axis=1)) for place in numbers(rows, "xyz")]
    errors = numbers(rows, ("dx", "dy", "dz")) - motions[owner]
    deviations = np.sqrt(numbers(rows, ("cov_xx", "cov_yy", "cov_zz")))
    covered = (abs(errors) < 1.96 * deviations).mean(axis=0).min()
    return f"{len(rows)} | {1e3 * np.median(np.linalg.norm(errors, axis=1)):.1f} mm | {covered:.2f}"


def main():
    program, survey, out, *names = sys.argv[1:]
    survey, out = Path(survey), Path(out)
    print("| survey | check | run | measured | median error | coverage | verdict; doubts |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in names or SURVEYS:
        folder = out / re.sub(r"[^a-z0-9.]+", "-", name)
        folder.mkdir(parents=True, exist_ok=True)
        write(survey, folder, *SURVEYS[name])
        project, results = folder / "stonewise.toml", folder / "results"
        check = [program, "check", project, "--page", folder / "check.html"]
        run = [program, "--quiet", "run", project, "--out", results]
        codes, said = [], ""
        for command in (check, run):
            done = subprocess.run(command, capture_output=True, text=True)
            codes.append(str(done.returncode))
            said = done.stderr
        scored, verdict = " | | ", said.strip().splitlines()[-1] if said else ""
        if (results / "verdict.json").exists():
            scored = score(survey, results)
            doubts = [w["message"] for w in json.loads((results / "run.json").read_text())["warnings"] if w.get("doubt")]
            state = json.loads((results / "verdict.json").read_text())["state"]
            verdict = "; ".join([state, *(doubt.split(":")[0][:90] for doubt in doubts)])
        print(f"| {name} | {' | '.join(codes)} | {scored} | {verdict} |", flush=True)


if __name__ == "__main__":
    main()
