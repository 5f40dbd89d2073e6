"""M3C2 against brute force and a closed form."""

from __future__ import annotations

import numpy as np
import pytest

import stonewise


def wavy(shift: float, seed: int, n: int = 20_000) -> np.ndarray:
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.0, 2.0, (2, n))
    z = 0.02 * np.sin(4.0 * x) * np.cos(3.0 * y) + rng.normal(0.0, 0.002, n) + shift
    return np.column_stack([x, y, z])


def by_hand(first, second, core, normal, radius, depth):
    """Lague et al. (2013), point by point."""
    along = []
    for cloud in (first, second):
        offset = cloud - core
        t = offset @ normal
        across = np.linalg.norm(offset - np.outer(t, normal), axis=1)
        along.append(t[(across <= radius) & (np.abs(t) <= depth)])
    a, b = along
    limit = 1.96 * np.sqrt(a.var(ddof=1) / len(a) + b.var(ddof=1) / len(b))
    return b.mean() - a.mean(), limit, len(a), len(b)


def test_distances_and_limits_are_those_of_brute_force():
    first, second = wavy(0.0, 1), wavy(0.01, 2)
    core = first[(np.abs(first[:, :2] - 1.0) < 0.6).all(axis=1)][:200]
    change = stonewise.m3c2(first, second, core, cyl_radius=0.08, normal_radius=0.2, max_distance=0.2)
    distances, uncertainties = change
    assert distances.shape == uncertainties.shape == (len(core),)
    assert (change.directions[:, 2] > 0.9).all()
    for i in range(0, len(core), 10):
        near = first[np.linalg.norm(first - core[i], axis=1) <= 0.2]
        _, _, axes = np.linalg.svd(near - near.mean(axis=0), full_matrices=False)
        normal = axes[2] * np.sign(axes[2][2])
        np.testing.assert_allclose(change.directions[i], normal, atol=1e-9)
        distance, limit, n1, n2 = by_hand(first, second, core[i], normal, 0.08, 0.2)
        assert (uncertainties["num_samples1"][i], uncertainties["num_samples2"][i]) == (n1, n2)
        assert distances[i] == pytest.approx(distance, abs=1e-10)
        assert uncertainties["lodetection"][i] == pytest.approx(limit, abs=1e-10)
    assert abs(np.median(distances) - 0.01) < 5e-4
    assert change.significant.all()


def test_given_normals_and_places_without_points():
    first, second = wavy(0.0, 1), wavy(0.01, 2)
    core = np.array([[1.0, 1.0, 0.0], [9.0, 9.0, 9.0], [np.nan, 0.0, 0.0]])
    change = stonewise.m3c2(first, second, core)
    assert np.isfinite(change.distances[0]) and np.isnan(change.distances[1:]).all()
    assert np.isnan(change.directions[1:]).all()
    down = stonewise.m3c2(first, second, core[:1], corepoint_normals=[[0.0, 0.0, -2.0]])
    assert down.distances[0] == pytest.approx(-0.01, abs=1e-3)
    from_below = stonewise.m3c2(first, second, core[:1], viewpoints=[[1.0, 1.0, -5.0]])
    assert from_below.distances[0] == pytest.approx(-change.distances[0], abs=1e-12)
    with pytest.raises(stonewise.Error, match="one normal for each core point"):
        stonewise.m3c2(first, second, core, corepoint_normals=[[0.0, 0.0, 1.0]])


def test_core_points_thinned_from_the_first_epoch():
    first = wavy(0.0, 1)
    change = stonewise.m3c2(first, wavy(0.01, 2), core_spacing=0.25)
    cells = {tuple(c) for c in np.floor(change.corepoints / 0.25).astype(int)}
    assert len(cells) == len(change.corepoints) == len({tuple(c) for c in np.floor(first / 0.25).astype(int)})
    assert {tuple(p) for p in change.corepoints} <= {tuple(p) for p in first}


def test_points_of_other_libraries():
    class Epoch:
        """An epoch as py4dgeo has it."""

        def __init__(self, cloud):
            self.cloud = cloud

    first, second = wavy(0.0, 1), wavy(0.01, 2)
    core = first[:50]
    expected = stonewise.m3c2(first, second, core).distances
    np.testing.assert_array_equal(stonewise.m3c2(Epoch(first), Epoch(second), core).distances, expected)
    laspy = pytest.importorskip("laspy")
    cloud = laspy.create()
    cloud.header.scales = [1e-6] * 3
    cloud.x, cloud.y, cloud.z = second.T
    np.testing.assert_allclose(stonewise.m3c2(first, cloud, core).distances, expected, atol=1e-6)
    with pytest.raises(stonewise.Error, match="shape"):
        stonewise.m3c2(first[:, :2], second, core)
    with pytest.raises(stonewise.Error, match="above 0"):
        stonewise.m3c2(first, second, core, cyl_radius=0.0)


def test_the_same_as_py4dgeo():
    py4dgeo = pytest.importorskip("py4dgeo")
    first, second = wavy(0.0, 1), wavy(0.01, 2)
    core = first[:300]
    peer = py4dgeo.M3C2(
        epochs=(py4dgeo.Epoch(first), py4dgeo.Epoch(second)),
        corepoints=core,
        cyl_radius=0.08,
        normal_radii=[0.2],
        max_distance=0.2,
    )
    distances, uncertainties = peer.run()
    ours = stonewise.m3c2(first, second, core, cyl_radius=0.08, normal_radius=0.2, max_distance=0.2)
    np.testing.assert_allclose(ours.distances, distances, atol=1e-6)
    np.testing.assert_allclose(ours.uncertainties["lodetection"], uncertainties["lodetection"], atol=1e-6)
