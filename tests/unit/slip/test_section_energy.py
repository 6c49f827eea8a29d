"""Energy at a section: its formulas against the energy of the stride that came there."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.gaits.gait_branch import energy_gradient
from template_control.slip.maps.section import APEX, VLO
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
K0, L0 = P.leg_stiffness, P.rest_length
stiffnesses = st.floats(0.8 * K0, 1.3 * K0)


def path_energy(stride, time):
    """Kinetic, potential and the legs' energy on a stride's path, of the legs as they are then."""
    row = stride.meta[np.searchsorted(stride.meta[:, 0], time, side="right") - 1]
    x, y, u, v = stride.sample(time)[0, :4]
    length = np.hypot(x - row[3:5], y)
    spring = 0.5 * np.sum(row[5:7] * (L0 - length) ** 2)
    return 0.5 * P.mass * (u**2 + v**2) + P.mass * P.gravity * y + spring


@given(
    speed=st.floats(0.95, 1.25),
    height=st.floats(0.965, 0.985),
    vertical=st.floats(-0.05, 0.05),
    k=st.tuples(stiffnesses, stiffnesses),
)
@settings(max_examples=30, deadline=None)
def test_vlo_energy_is_that_of_the_stride(speed, height, vertical, k):
    u = controls(np.radians(68.0), *k)
    stride = simulate_stride(P, STRIDE_START["w"], [0.0, height, speed, vertical], u)
    assume(stride.completed)
    z0, z1 = np.array([speed, height, vertical]), VLO.of(stride.state)
    for z, time, slot in ((z0, 0.0, Slot.K_SC), (z1, stride.duration, Slot.K_SD)):
        expected = path_energy(stride, time)
        assert VLO.energy(P, z, u[slot]) == pytest.approx(expected, rel=1e-11)
        # The stance leg's stiffness is k0 again in the next stride.
        reset = 0.5 * (K0 - u[slot]) * (L0 - z[1]) ** 2
        assert VLO.energy(P, z) == pytest.approx(expected + reset, rel=1e-11)
        check_derivatives(VLO, z, u[slot])


@given(speed=st.floats(2.0, 6.0), height=st.floats(0.96, 1.05), k=st.floats(20e3, 35e3))
@settings(max_examples=30, deadline=None)
def test_apex_energy_is_that_of_the_stride(speed, height, k):
    u = controls(np.radians(68.0), k, 1.1 * k)
    stride = simulate_stride(P, STRIDE_START["r"], [0.0, height, speed, 0.0], u)
    assume(stride.completed)
    for z, time in (([speed, height], 0.0), (APEX.of(stride.state), stride.duration)):
        z = np.array(z)
        assert APEX.energy(P, z, k) == pytest.approx(path_energy(stride, time), rel=1e-11)
        assert energy_gradient(APEX, P, z, k)[1] == 0.0
        check_derivatives(APEX, z, k)


def check_derivatives(section, z, stiffness):
    """Against central differences."""
    gradient, by_stiffness = energy_gradient(section, P, z, stiffness)
    h = 1e-5
    for i, unit in enumerate(np.eye(len(z))):
        ahead, behind = (section.energy(P, z + s * h * unit, stiffness) for s in (1, -1))
        assert gradient[i] == pytest.approx((ahead - behind) / (2 * h), abs=1e-4)
    ahead, behind = (section.energy(P, z, stiffness + s) for s in (1.0, -1.0))
    assert by_stiffness == pytest.approx((ahead - behind) / 2.0, abs=1e-9)
