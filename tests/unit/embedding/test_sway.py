"""Where a robot on soles can have its centre of pressure, and where the foot of a stop lands."""

import numpy as np
import pytest

from template_control.embedding.free import sway

WAY, HALF = np.array([0.17, -0.15]), np.array([0.07, 0.024])


def enclosed(points):
    """Whether both feet enclose each of (n, 2) points."""
    off = points[:, None] - np.linspace(0.0, 1.0, 2001)[:, None] * WAY
    return (np.abs(off) <= HALF + 1e-9).all(axis=2).any(axis=1)


@pytest.mark.slow(seconds=1)
@pytest.mark.parametrize("seed", range(6))
def test_the_pressure_leads_the_capture_point_back(seed):
    """Straight to the middle where both feet enclose it, else from as near as they reach."""
    rng = np.random.default_rng(seed)
    point = 0.5 * WAY + rng.uniform(-0.15, 0.15, 2)
    found = point.copy()
    outside = sway.hold(WAY, HALF, found)
    away = point - 0.5 * WAY
    if enclosed(point[None]).item():
        beyond = np.linspace(1.0, 2.5, 3001)[:, None] * away + 0.5 * WAY
        best = beyond[enclosed(beyond)][-1]
        np.testing.assert_allclose(found, best, atol=2e-4)
        assert outside == 0.0
    else:
        shares = np.linspace(0.0, 1.0, 20001)[:, None] * WAY
        there = np.clip(point, shares - HALF, shares + HALF)
        best = there[np.hypot(*(there - point).T).argmin()]
        np.testing.assert_allclose(found, best, atol=1e-4)
        assert outside == pytest.approx(np.hypot(*(best - point)), abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_a_stop_lands_with_the_capture_point_between_the_feet(seed):
    """The nearest to the gait's step that some place in the sole that stands leads to."""
    rng = np.random.default_rng(seed)
    point, growth, edge = rng.uniform(-0.02, 0.1), rng.uniform(1.5, 3.0), 0.02
    shares, steps = (0.6, 0.85), (0.15, 0.05)
    found = sway.distance_aside(point, growth, edge, shares, steps)
    pressures = np.linspace(-edge, edge, 2001)
    landed = pressures + (point - pressures) * growth
    can = (landed[:, None] / np.linspace(*shares, 2001)).ravel()
    best = can[np.abs(can - steps[0]).argmin()]
    assert found == pytest.approx(max(best, steps[1]), abs=1e-4)


@pytest.mark.parametrize("apart", [0.17, -0.17, 0.0])
def test_the_loads_say_where_the_pressure_is_ahead(apart):
    """A share of the front foot is possible if some places in both soles give that pressure."""
    half = 0.07
    shares, ways = np.linspace(0.0, 1.0, 1001), np.linspace(-half, half, 1001)
    for along in (-0.05, 0.02, 0.1, 0.2):
        low, high = sway.front_shares(along, apart, half)
        can = [np.abs(share * apart + ways - along).min() < 1e-3 for share in shares]
        if any(can):
            assert shares[can][[0, -1]] == pytest.approx((low, high), abs=1e-2)
