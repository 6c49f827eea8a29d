"""Sections: what they keep of a state, its energy, its mirror image."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.maps.section import APEX, REST, VLO, section_of
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
SECTIONS = pytest.mark.parametrize("section", [VLO, APEX], ids=lambda s: s.name)
numbers = st.lists(st.floats(-10.0, 10.0), min_size=4, max_size=4)


@SECTIONS
@given(numbers)
def test_a_section_keeps_its_numbers_and_knows_the_others(section, values):
    state = np.array([*values, 7.0, 8.0])
    z = section.of(state)
    assert len(z) == section.dimension
    np.testing.assert_array_equal(z, [values[2], values[1], values[3]][: len(z)])
    z += 1.0
    np.testing.assert_array_equal(state[:4], values)
    np.testing.assert_array_equal(section.of(section.state(z, x=3.0)), z)
    assert section.state(z, x=3.0)[0] == 3.0
    assert np.count_nonzero(section.state(np.ones(len(z)))) == len(z)
    np.testing.assert_array_equal(section.padded(z), np.append(z, np.zeros(3 - len(z))))


@SECTIONS
def test_states_in_arrays_are_those_one_by_one(section):
    z = np.random.default_rng(2).uniform(0.5, 1.5, (4, 3, section.dimension))
    for i, j in np.ndindex(4, 3):
        one = z[i, j]
        assert section.energy(P, z)[i, j] == pytest.approx(section.energy(P, one), rel=1e-14)
        np.testing.assert_array_equal(section.padded(z)[i, j], section.padded(one))
        np.testing.assert_array_equal(section.mirror(z)[i, j], section.mirror(one))


@SECTIONS
@given(st.floats(0.5, 5.0), st.floats(0.9, 0.99))
def test_speed_is_that_of_the_energy(section, speed, height):
    energy = section.energy(P, section.of([0.0, height, speed, 0.0]))
    assert float(section.speed(P, height, energy)) == pytest.approx(speed, rel=1e-9)
    assert np.isnan(section.speed(P, height, 0.0))


def test_the_spring_counts_at_vlo_alone():
    at_rest = np.array([0.0, 0.9, 0.0])
    weight = P.mass * P.gravity * 0.9
    assert APEX.energy(P, at_rest[:2]) == pytest.approx(weight)
    spring = 0.5 * P.leg_stiffness * 0.01
    assert VLO.energy(P, at_rest) == pytest.approx(weight + spring)
    assert VLO.energy(P, at_rest, 0.0) == pytest.approx(weight)


def test_the_mirrored_template_walks_back():
    """Half a step forward from VLO is, mirrored, where half a step led to it."""
    z, k0 = np.array([1.1, 0.978, 0.03]), P.leg_stiffness
    there = simulate_stride(P, STRIDE_START["w"], VLO.state(z), controls(1.15, k0, 1.1 * k0))
    liftoff = next(e.state for e in there.events if e.event is Event.REAR_LIFTOFF)
    u = controls(float(np.arcsin(liftoff[1])), 1.1 * k0, k0)
    back = simulate_stride(P, STRIDE_START["w"], VLO.state(VLO.mirror(VLO.of(there.state))), u)
    np.testing.assert_allclose(VLO.mirror(VLO.of(back.state)), z, atol=1e-9)
    np.testing.assert_array_equal(APEX.mirror([2.0, 1.0]), [2.0, 1.0])


def test_sections_by_event():
    assert section_of(Event.VLO) is VLO
    assert section_of(Event.APEX) is APEX
    assert section_of(Event.REST) is REST
    with pytest.raises(ParameterError, match="TOUCHDOWN is no section: give VLO or APEX or REST"):
        section_of(Event.TOUCHDOWN)
