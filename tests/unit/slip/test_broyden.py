"""Broyden's update of a map's derivatives."""

import numpy as np
import pytest

from template_control.slip.control.broyden import LinearMap, carried

UNIT, CLOSE = np.array([1.0, 2.0, 0.5]), np.array([1e-3, 1e-3])
JACOBIAN = np.array([[1.0, 0.5, -0.2], [0.3, -1.0, 0.1], [2.0, 0.0, 1.0], [0.0, 1.0, 1.0]])


def about(place, jacobian=JACOBIAN):
    """A linear map about a place that it leads to zero from."""
    return LinearMap(jacobian.copy(), place.copy(), np.zeros(len(jacobian)))


def test_what_a_linear_map_foretells_leaves_its_derivatives():
    linear, place = about(np.zeros(3)), np.array([0.3, -0.1, 0.2])
    assert carried(linear, place, JACOBIAN @ place, UNIT, CLOSE)
    np.testing.assert_allclose(linear.jacobian, JACOBIAN, atol=1e-15)
    np.testing.assert_array_equal(linear.place, place)
    np.testing.assert_array_equal(linear.result, JACOBIAN @ place)


def test_derivatives_then_foretell_what_was_found():
    """The secant's condition; directions at right angles, in units, are as they were."""
    linear, place = about(np.zeros(3)), np.array([0.3, -0.1, 0.2])
    result = JACOBIAN @ place + [0.002, -0.003, 5.0, -3.0]
    assert carried(linear, place, result, UNIT, CLOSE)
    np.testing.assert_allclose(linear.jacobian @ place, result, rtol=1e-12)
    across = np.cross(place / UNIT, [1.0, 0.0, 0.0]) * UNIT
    np.testing.assert_allclose(linear.jacobian @ across, JACOBIAN @ across, atol=1e-12)


@pytest.mark.parametrize(("error", "close"), [(0.99e-4, True), (1.01e-4, False)])
def test_small_errors_are_none_where_nothing_changes(error, close):
    linear = about(np.zeros(3))
    assert carried(linear, np.zeros(3), np.array([error, 0.0, 0.0, 0.0]), UNIT, CLOSE) is close


@pytest.mark.parametrize(("share", "close"), [(0.019, True), (0.021, False)])
def test_a_share_of_a_large_change_may_be_missed(share, close):
    linear, place = about(np.zeros(3)), np.array([1.0, 0.0, 0.0])
    found = JACOBIAN @ place * (1.0 + share)
    assert carried(linear, place, found, UNIT, CLOSE) is close


def test_only_results_with_a_tolerance_are_judged():
    linear, place = about(np.zeros(3)), np.array([0.3, -0.1, 0.2])
    assert carried(linear, place, JACOBIAN @ place + [0.0, 0.0, 1e3, np.nan], UNIT, CLOSE)


def test_nothing_changes_where_the_place_does_not():
    linear = about(np.ones(3))
    assert carried(linear, np.ones(3), np.zeros(4), UNIT, CLOSE)
    np.testing.assert_array_equal(linear.jacobian, JACOBIAN)


def test_a_result_that_is_no_number_is_not_foretold():
    linear = about(np.zeros(3))
    assert not carried(linear, np.ones(3), np.full(4, np.nan), UNIT, CLOSE)
