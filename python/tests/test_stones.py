"""Transfer, detector and adjustment on arrays: what a run finds on files."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import stonewise

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

laspy = pytest.importorskip("laspy")
Image = pytest.importorskip("PIL.Image")


@pytest.fixture(scope="module")
def epochs(survey):
    return tomllib.loads((survey / "stonewise.toml").read_text())["epochs"]


@pytest.fixture(scope="module")
def clouds(survey, results, epochs):
    """Points as measured, and the stones that the run gave them."""
    found = []
    for number, epoch in enumerate(epochs, start=1):
        (name,) = epoch["clouds"]
        labelled = laspy.read(results.path / "data" / f"epoch{number}" / f"{Path(name).stem}.laz")
        found.append((laspy.read(survey / name), np.asarray(labelled.stone_id, dtype=np.int64)))
    return found


def test_transfer_is_the_step_label(survey, results, epochs, clouds):
    views = stonewise.read_cameras(survey / epochs[0]["cameras"])
    cloud, expected = clouds[0]
    images = {view.name: label_image(results, number) for number, view in enumerate(views)}
    labels = stonewise.transfer(cloud, views, images)
    assert labels.dtype == np.int32 and labels.shape == (len(cloud),)
    assert labels.max() > 10
    np.testing.assert_array_equal(labels, expected)
    in_order = stonewise.transfer(cloud, views, [images[view.name] for view in views])
    np.testing.assert_array_equal(in_order, labels)
    with pytest.raises(stonewise.Error, match="label images"):
        stonewise.transfer(cloud, views, [])
    with pytest.raises(stonewise.Error, match="whole numbers"):
        stonewise.transfer(cloud, views, [np.zeros((600, 800))] * len(views))


def label_image(results, number: int) -> np.ndarray:
    """The label image that the run made of the masks of a photo, by its number."""
    return np.asarray(Image.open(next((results.path / "work" / "segment-1").glob(f"*/{number:05}.png")))).astype(np.int64)


def test_adjust_is_a_run_without_photos_whose_motions_are_not_corrected(survey, results, epochs, clouds, tmp_path):
    shutil.copytree(results.path, tmp_path / "out")
    points_alone = {"epoch_error_m": 0.001, "photos": {"enabled": False}}
    stated = stonewise.run(survey / "stonewise.toml", out=tmp_path / "out", registration=points_alone)
    views = stonewise.read_cameras(survey / epochs[0]["cameras"])
    (first, labels_1), (second, labels_2) = clouds
    motion = stonewise.adjust(first, labels_1, second, labels_2, viewpoints=[view.centre for view in views])
    assert motion.summary["converged"]
    for column in ("stone_id", "matched_id", "status", "points_1", "points_2", "loose"):
        assert motion.stones_arrow[column].to_pylist() == stated.stones_arrow[column].to_pylist(), column
    measured = np.isfinite(stated.displacement[:, 0])
    assert measured.sum() > 10
    np.testing.assert_allclose(motion.displacement, stated.displacement, rtol=1e-12)
    assert np.isfinite(motion.covariance[measured]).all()
    # Which side of the wall is outside hardly matters to the motion in world axes.
    alone = stonewise.adjust(first, labels_1, second, labels_2)
    np.testing.assert_allclose(alone.displacement[measured], motion.displacement[measured], atol=5e-4)


def test_adjust_checks_what_it_is_given():
    points = np.zeros((5, 3))
    with pytest.raises(stonewise.Error, match="5 points and 4 labels"):
        stonewise.adjust(points, np.zeros(4, int), points, np.zeros(5, int))
    with pytest.raises(stonewise.Error, match="between 0"):
        stonewise.adjust(points, -np.ones(5, int), points, np.zeros(5, int))


def test_views_project():
    turn = [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]  # looks along -x, z is up
    view = stonewise.View(800, 600, 1000.0, turn, [5.0, 0.0, 1.0], name="a")
    np.testing.assert_allclose(view.centre, [5.0, 0.0, 1.0], atol=1e-12)
    pixels = view.project(np.array([[0.0, 0.0, 1.0], [0.0, 0.5, 1.0], [0.0, 0.0, 1.5], [9.0, 0.0, 1.0]]))
    np.testing.assert_allclose(pixels[:3], [[400.0, 300.0], [500.0, 300.0], [400.0, 200.0]], atol=1e-9)
    assert np.isnan(pixels[3]).all()
    with pytest.raises(stonewise.Error, match="rotation matrix"):
        stonewise.View(800, 600, 1000.0, np.ones((3, 3)), [0.0, 0.0, 0.0])


def test_the_detector_is_the_command_segment(command, survey, epochs, tmp_path):
    photo = next(p for p in sorted((survey / epochs[0]["images"]).iterdir()) if p.suffix.lower() in (".jpg", ".png"))
    image = np.asarray(Image.open(photo).convert("RGB"))[150:450, 200:600]
    (tmp_path / "photos").mkdir()
    Image.fromarray(image).save(tmp_path / "photos" / "wall.png")
    command("detector", "segment", tmp_path / "photos", "--scales", "1", "--out", tmp_path / "out")
    labels = stonewise.Detector(scales=[1.0]).segment(image)
    assert labels.dtype == np.int32 and labels.shape == image.shape[:2]
    expected = np.asarray(Image.open(tmp_path / "out" / "labels" / "wall.png"))
    assert expected.max() > 3
    np.testing.assert_array_equal(labels, expected)
    shutil.rmtree(tmp_path / "out")

    boxes, stones = [], [stone for stone in range(1, labels.max() + 1) if (labels == stone).sum() > 400]
    for stone in stones:
        rows, columns = np.nonzero(labels == stone)
        boxes.append([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
    outlined = stonewise.Detector().outline(image, boxes)
    overlaps = []
    for number, stone in enumerate(stones, 1):
        a, b = outlined == number, labels == stone
        overlaps.append((a & b).sum() / (a | b).sum())
    assert len(overlaps) > 10 and np.mean(overlaps) > 0.8, overlaps
    with pytest.raises(stonewise.Error, match="left < right"):
        stonewise.Detector().outline(image, [[20.0, 0.0, 10.0, 5.0]])

    with pytest.raises(stonewise.Error, match="uint8"):
        stonewise.Detector().segment(image.astype(float))
    with pytest.raises(stonewise.Error, match="unknown field"):
        stonewise.Detector(min_scor=0.5)
    with pytest.raises(stonewise.Error, match="No such file|no such file"):
        stonewise.Detector("no.safetensors")
