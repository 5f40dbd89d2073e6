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
        labelled = laspy.read(results.path / f"epoch{number}" / f"{Path(name).stem}.laz")
        found.append((laspy.read(survey / name), np.asarray(labelled.stone_id, dtype=np.int64)))
    return found


def test_transfer_is_the_step_label(survey, results, epochs, clouds):
    views = stonewise.read_cameras(survey / epochs[0]["cameras"])
    cloud, expected = clouds[0]
    images = {view.name: label_image(results, view.name) for view in views}
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


def label_image(results, name: str) -> np.ndarray:
    """The label image that the run made of the photo's masks."""
    (path,) = (results.path / "work" / "segment-1").rglob(f"{Path(name).stem}*.png")
    return np.asarray(Image.open(path)).astype(np.int64)


def test_adjust_is_a_run_without_a_datum(survey, results, epochs, clouds):
    views = stonewise.read_cameras(survey / epochs[0]["cameras"])
    (first, labels_1), (second, labels_2) = clouds
    motion = stonewise.adjust(first, labels_1, second, labels_2, viewpoints=[view.centre for view in views])
    assert motion.summary["converged"]
    table = motion.stones_arrow
    assert table["stone_id"].to_pylist() == results.stones_arrow["stone_id"].to_pylist()
    assert table["matched_id"].to_pylist() == results.stones_arrow["matched_id"].to_pylist()
    assert table["status"].to_pylist() == results.stones_arrow["status"].to_pylist()
    measured = np.isfinite(results.displacement[:, 0])
    assert measured.sum() > 10
    # What the run took off the motion as the error of the epochs' registration is one small rigid motion.
    difference = (motion.displacement - results.displacement)[measured]
    place = np.column_stack([results.stones_arrow[c].to_numpy() for c in "xyz"])[measured]
    assert residual_of_rigid(place, difference) < 1e-6
    assert np.isfinite(motion.covariance[measured]).all()
    # One side of the wall is as good as the other for what is not told in the wall's axes.
    alone = stonewise.adjust(first, labels_1, second, labels_2)
    np.testing.assert_allclose(alone.displacement[measured], motion.displacement[measured], atol=2e-4)


def residual_of_rigid(place: np.ndarray, difference: np.ndarray) -> float:
    """Largest deviation from the best small rigid motion, metres."""
    q = place - place.mean(axis=0)
    zero = np.zeros(len(q))
    turn = np.stack(
        [
            np.column_stack([zero, q[:, 2], -q[:, 1]]),
            np.column_stack([-q[:, 2], zero, q[:, 0]]),
            np.column_stack([q[:, 1], -q[:, 0], zero]),
        ],
        axis=1,
    )
    design = np.concatenate([np.broadcast_to(np.eye(3), (len(q), 3, 3)), turn], axis=2).reshape(-1, 6)
    solution, *_ = np.linalg.lstsq(design, difference.reshape(-1), rcond=None)
    return float(np.abs(design @ solution - difference.reshape(-1)).max())


def test_adjust_checks_what_it_is_given():
    points = np.zeros((5, 3))
    with pytest.raises(stonewise.Error, match="5 points and 4 labels"):
        stonewise.adjust(points, np.zeros(4, int), points, np.zeros(5, int))
    with pytest.raises(stonewise.Error, match="between 0"):
        stonewise.adjust(points, -np.ones(5, int), points, np.zeros(5, int))


def test_views_project():
    turn = [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]  # looks along -x, z is up
    view = stonewise.View(800, 600, 1000.0, turn, [5.0, 0.0, 1.0], name="a")
    np.testing.assert_allclose(view.centre, [5.0, 0.0, 1.0])
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
    command("segment", tmp_path / "photos", "--scales", "1", "--out", tmp_path / "out")
    labels = stonewise.Detector(scales=[1.0]).segment(image)
    assert labels.dtype == np.int32 and labels.shape == image.shape[:2]
    expected = np.asarray(Image.open(tmp_path / "out" / "labels" / "wall.png"))
    assert expected.max() > 3
    np.testing.assert_array_equal(labels, expected)
    shutil.rmtree(tmp_path / "out")
    with pytest.raises(stonewise.Error, match="uint8"):
        stonewise.Detector().segment(image.astype(float))
    with pytest.raises(stonewise.Error, match="unknown field"):
        stonewise.Detector(min_scor=0.5)
    with pytest.raises(stonewise.Error, match="No such file|no such file"):
        stonewise.Detector("no.safetensors")
