"""Where a robot on soles can have its centre of pressure, and where the foot of a stop lands."""

import numpy as np
import pytest

from template_control.embedding.free import sway

WAY, HALF = np.array([0.17, -0.15]), np.array([0.07, 0.024])


@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_point_of_the_ground_under_both_feet(seed):
    """Against all places of one of them on its way to the other."""
    rng = np.random.default_rng(seed)
    wanted = rng.uniform(-0.3, 0.4, 2)
    found = wanted.copy()
    sway._nearest(WAY, HALF, found)
    shares = np.linspace(0.0, 1.0, 20001)[:, None]
    there = np.clip(wanted, shares * WAY - HALF, shares * WAY + HALF)
    best = np.hypot(*(there - wanted).T).min()
    assert np.hypot(*(found - wanted)) == pytest.approx(best, abs=1e-6)
    inside = shares * WAY - HALF <= found + 1e-9, found - 1e-9 <= shares * WAY + HALF
    assert (inside[0] & inside[1]).all(axis=1).any()


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
