"""Centre of pressure through a list of phases, and the curves over feet that it gives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from template_control.embedding.standing.curves import BetweenFeet, StandingOptions
from template_control.slip.dynamics.timed import polynomial
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.pressure import (
    ARRIVE,
    SMOOTH,
    UNLOADING,
    Ground,
    Pieces,
    Ways,
    best_way,
    bounded,
    pressure,
)

P = SlipParameters()
OPTIONS = StandingOptions(half_length=0.5)
G = P.gravity


def problem(rng, n):
    """Phases of changing bounds, and where they begin and end."""
    low = rng.uniform(-0.3, 0.0, n)
    pieces = Pieces(
        rng.uniform(0.01, 0.04, n),
        rng.uniform(2.8, 3.4, n),
        low,
        low + rng.uniform(0.0, 0.4, n),
        rng.uniform(-0.3, 0.3, n),
    )
    return pieces, rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.2, 0.2, 2)


def end(pieces, start, p):
    """x and x' / w after the pieces."""
    x, v = start
    for w, dt, at in zip(pieces.rate, pieces.duration, p, strict=True):
        c, s = np.cosh(w * dt), np.sinh(w * dt)
        x, v = at + c * (x - at) + s / w * v, w * s * (x - at) + c * v
    return np.array([x, v / pieces.rate[-1]])


@pytest.mark.parametrize("seed", range(5))
def test_the_plan_is_the_bounded_least_squares_solution(seed):
    """Of the costs as they stand in the module, by SciPy."""
    rng = np.random.default_rng(seed)
    n, smooth, arrive, first = 12, 0.1, 50.0, 0.05
    pieces, start, goal = problem(rng, n)
    free = end(pieces, start, np.zeros(n))
    gain = np.array([end(pieces, np.zeros(2), one) for one in np.eye(n)]).T
    change = smooth / np.sqrt(pieces.duration)[:, None] * (np.eye(n) - np.eye(n, k=-1))
    begun = np.zeros(n)
    begun[0] = smooth / np.sqrt(pieces.duration[0]) * first
    still = np.sqrt(pieces.duration)
    aim = goal / (1.0, pieces.rate[-1])
    rows = np.vstack((np.diag(still), change, np.sqrt(arrive) * gain))
    wanted = np.concatenate((still * pieces.wish, begun, np.sqrt(arrive) * (aim - free)))
    best = lsq_linear(rows, wanted, (pieces.low, pieces.high), tol=1e-14).x
    p = np.empty(n)
    miss = pressure(pieces, start, goal, first, (smooth, arrive), p)
    np.testing.assert_allclose(p, best, atol=1e-6)
    assert ((p <= pieces.low) | (p >= pieces.high)).any()
    assert miss == pytest.approx(np.abs(end(pieces, start, p) - aim).sum())


def test_bounds_that_meet_hold():
    matrix, right = np.array([[2.0, -1.0], [-1.0, 2.0]]), np.array([1.0, 1.0])
    x = np.empty(2)
    bounded(matrix, right, np.array([0.2, -9.0]), np.array([0.2, 9.0]), x)
    np.testing.assert_allclose(x, [0.2, 0.6])


def samples(found):
    """Time, x, y and the centre of pressure all along a curve."""
    rows, begun = [], 0.0
    for piece in found.pieces:
        for t in np.linspace(0.0, piece.duration, 5):
            (x, _, ddx), (y, _, ddy) = (polynomial(c, t) for c in piece.coefficients)
            rows.append((begun + t, x, y, x - y * ddx / (G + ddy)))
        begun += piece.duration
    return np.array(rows).T


@pytest.mark.parametrize(
    ("toes", "drift"), [((0.0, 0.0), 0.0), ((-0.15, 0.2), 0.0), ((0.0, 0.0), 1e-4)]
)
def test_a_start_ends_where_the_rear_foot_has_no_load(toes, drift):
    """A stand that drifts past its feet by micrometres is no CoM that is about to pass them."""
    feet = BetweenFeet(toes, P, OPTIONS)
    rest = feet.at_rest(feet.place(0.5))
    rest[0, :2] += 1e-5, drift
    liftoff = np.array([[toes[1] - 0.02, 0.7, 0.0], [0.96, 0.1, 0.0]])
    found = feet.to_liftoff(rest, liftoff[None], False)
    assert feet.fits(found)
    _, x, y, p = samples(found)
    middle = sum(toes) / 2
    assert middle - 0.5 < p.min() < middle - 0.1, "back first"
    assert p.max() < middle + 0.5
    assert p[-1] == pytest.approx(toes[1], abs=0.02)
    np.testing.assert_allclose([x[-1], y[-1]], liftoff[:, 0], atol=0.005)
    assert np.abs(np.diff(x)).max() < 0.05, "pieces follow each other"


def test_a_fast_walk_comes_to_rest_between_its_feet():
    feet = BetweenFeet((0.0, 0.3), P, OPTIONS)
    found = feet.to_rest(np.array([[0.12, 1.1, 0.0], [0.96, 0.0, 0.0]]), True)
    assert feet.fits(found)
    _, x, y, p = samples(found)
    np.testing.assert_allclose([x[-1], y[-1]], [0.15, OPTIONS.height], atol=0.005)
    assert 0.15 < p.max() < 0.65
    fast = feet.to_rest(np.array([[0.12, 2.2, 0.0], [0.96, 0.0, 0.0]]), True)
    assert not feet.fits(fast), "its capture point is beyond the feet"


def test_a_curve_within_the_feet_is_taken_where_there_is_one():
    """A quicker one, 0.1 mm beyond, would be made up for by a step."""
    feet = BetweenFeet((0.0, 0.433), P, replace(OPTIONS, half_length=0.1265, slant=0.169))
    found = feet.to_rest(np.array([[0.191, 0.471, -2.0], [0.958, -0.134, 2.0]]), True)
    assert feet.fits(found)


def test_soles_side_by_side_bear_more_midway_than_their_toes():
    pushed = np.array([[0.15, 0.85, 0.0], [OPTIONS.height, 0.0, 0.0]])
    for slant, holds in ((0.0, False), (0.2, True)):
        feet = BetweenFeet((0.0, 0.3), P, replace(OPTIONS, half_length=0.3, slant=slant))
        found = feet.to_rest(pushed)
        assert feet.fits(found) == holds
        share = 0.9 if slant else 0.8
        assert samples(found)[3].max() <= 0.15 + share * 0.3 + slant * 0.3 + 0.005


@pytest.mark.parametrize("height", [-0.5, 0.0, 0.05])
def test_a_com_that_falls_cannot_be_held(height):
    """Below its feet it would diverge so fast that nothing of the plan is left but rounding."""
    feet = BetweenFeet((0.0, 0.3), P, replace(OPTIONS, half_length=0.1))
    found = feet.to_rest(np.array([[-1.0, 0.0, 0.0], [height, -6.0, -9.0]]))
    assert not feet.fits(found)
    assert np.isfinite([piece.coefficients for piece in found.pieces]).all()


def test_a_com_that_is_about_to_pass_is_not_thrown_back():
    feet = BetweenFeet((0.0, 0.0), P, OPTIONS)
    liftoff = np.array([[-0.05, 0.9, 0.0], [0.96, 0.1, 0.0]])
    late = np.array([[-0.1, 1.0, 0.0], [0.95, 0.2, 0.0]])
    found = feet.to_liftoff(late, liftoff[None], False)
    assert samples(found)[0][-1] < 0.25


def test_a_start_leaves_time_to_shift_the_com_aside():
    liftoff = np.array([[0.08, 0.5, 0.0], [0.96, 0.1, 0.0]])

    def lasts(shift, speed=0.0, lands=False):
        feet = BetweenFeet((0.0, 0.1), P, replace(OPTIONS, shift=shift))
        start = np.array([[0.05, speed, 0.0], [OPTIONS.height, 0.0, 0.0]])
        found = feet.to_liftoff(start, liftoff[None], lands)
        return sum(piece.duration for piece in found.pieces)

    assert lasts(0.0) < 0.8 <= lasts(0.8)
    assert lasts(0.8, speed=0.3) == lasts(0.0, speed=0.3), "it does not begin at rest"
    assert lasts(0.8, lands=True) == lasts(0.0, lands=True)


@pytest.mark.parametrize("seed", range(4))
def test_the_cheapest_way_that_fits_comes_before_cheaper_ones_that_do_not(seed):
    """Ways to rest between feet 0.3 m apart, of a CoM that moves, each tried by itself too."""
    rng = np.random.default_rng(seed)
    times, slack = np.geomspace(0.03, 1.6, 14), 0.005
    price = np.sort(rng.uniform(0.0, 0.3, len(times)))
    stages = np.array([[[t, 0.0, 0.3, 0.15, 0.0, 0.3, 0.0]] for t in rng.permutation(times)])
    ends = np.tile([[0.15, 0.0, 0.0], [0.97, 0.0, 0.0]], (len(times), 1, 1))
    ground = Ground((G, 0.0), 1.025, slack, UNLOADING, SMOOTH, 10.0 * ARRIVE, True)
    fits = []
    for speed in np.linspace(0.4, 0.9, 26):
        start = np.array([[0.1, speed, 0.0], [0.96, -0.1, 0.0]])
        alone = []
        for i in range(len(times)):
            p, rates = np.empty((2, 20))
            one = Ways(stages[i : i + 1], ends[i : i + 1], price[i : i + 1])
            alone.append(best_way(start, one, ground, p, rates)[2])
        p, rates = np.empty((2, 20))
        i, _, excess = best_way(start, Ways(stages, ends, price), ground, p, rates)
        within = np.flatnonzero(np.array(alone) <= slack)
        fits.append(len(within) > 0)
        if fits[-1]:
            assert i == within[0]
            assert excess == alone[i]
        else:
            assert excess > slack
    assert any(fits)
    assert not all(fits)
