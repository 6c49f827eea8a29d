"""Basins of attraction: states and energies, steps to fall, and the deadbeat controller's set."""

import numpy as np
import pytest

from template_control.paper.stability import (
    backward_set,
    branch,
    controlled_end,
    inside_share,
    settles,
)
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import MapKind, Outcome, Slot
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.basin import (
    _many,
    margin,
    steps_to_fall,
    velocity_angle,
    vlo_state,
)
from template_control.slip.gaits.branch import Kind
from template_control.slip.gaits.gait import gait_from_energy
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
K0 = P.leg_stiffness


def test_vlo_states_and_energies_belong_together():
    y, phi = np.meshgrid(np.linspace(0.95, 0.99, 5), np.radians([-5.0, 0.0, 5.0]))
    z = vlo_state(P, y, phi, 826.0)
    for state, angle in zip(z.reshape(-1, 3), phi.ravel(), strict=True):
        assert VLO.energy(P, state) == pytest.approx(826.0, rel=1e-12)
        assert velocity_angle(state) == pytest.approx(angle)
        assert np.sign(state[2]) == -np.sign(angle), "downward is positive"
    assert np.isnan(vlo_state(P, 0.98, 0.0, 700.0)[0])


@pytest.mark.slow(seconds=3)
def test_steps_are_compiled_once_whatever_the_arrays_layouts_are(paper_gait):
    goal, z = np.array([0.9818, 0.0]), np.tile(paper_gait.vlo, (3, 1))
    for states in (z[:1], z, np.asfortranarray(z), z[::2]):
        steps_to_fall(P, states, paper_gait.controls, goal, limit=1)
        steps_to_fall(P, states, np.tile(paper_gait.controls, (len(states), 1)), goal, limit=1)
    assert len(_many.signatures) == 1


@pytest.mark.slow(seconds=3)
def test_steps_to_fall_counts_steps(paper_gait):
    goal = np.array([0.9818, 0.0])
    z = vlo_state(P, [0.9818, 0.9818, 0.955, 0.9818], np.radians([0.0, 1.0, 0.0, 0.0]), 826.0)
    z[3] = np.nan
    result = steps_to_fall(P, z, paper_gait.controls, goal)
    assert result.steps.tolist()[:2] == [50, 50]
    assert result.converges.tolist() == [True, True, False, False]
    assert result.steps[3] == 0
    state, count = z[2], 0
    step = ReturnMap(P)
    while True:
        state, outcome = step.step(state, paper_gait.controls)
        if outcome is not Outcome.SECTION:
            break
        count += 1
    assert result.steps[2] == count < 50


def test_convergence_is_to_this_gait_and_not_to_another():
    """Under the lower limit a walk may go on for 50 steps, but not to the unstable gait."""
    gait = gait_from_energy(P, 0.9818, 821.5)
    z = vlo_state(P, 0.9818 + np.array([-1e-4, 1e-4]), 0.0, 821.5)
    assert not steps_to_fall(P, z, gait.controls, np.array([0.9818, 0.0])).converges.any()


@pytest.mark.slow(seconds=1)
def test_margin_shrinks_towards_the_lower_limit():
    radii = []
    for energy in (822.5, 824.0, 826.0):
        gait = gait_from_energy(P, 0.9818, energy)
        radii.append(margin(P, gait.controls, (0.9818, 0.0), energy))
    assert 0.0 < radii[0] < radii[1] < radii[2] < 0.05


@pytest.mark.slow(seconds=4)
def test_deadbeat_set_and_what_the_maps_make_of_it(paper_gait):
    found = backward_set(paper_gait, counts=(20, 120))
    assert len(found.state) > 200
    for z, u in zip(found.state[::20], found.controls[::20], strict=True):
        stride = simulate_stride(P, STRIDE_START["w"], VLO.state(z), u)
        np.testing.assert_allclose(VLO.of(stride.state), paper_gait.vlo, atol=1e-7)
        assert 0.5 * K0 <= u[Slot.K_SD] <= 1.5 * K0
        assert u[Slot.K_SC] == K0
    stable = [p for p in branch(0.001) if p.kind is Kind.STABLE]
    failing = {}
    for kind in (MapKind.EXACT, MapKind.IMPROVED, MapKind.PAPER):
        settled = settles(controlled_end(found, paper_gait, kind), stable, paper_gait)
        shares, _ = inside_share(found, settled, np.radians([0.0, 70.8]))
        failing[kind] = 1.0 - shares
    assert np.all(failing[MapKind.EXACT] == 0.0)
    assert np.all(failing[MapKind.IMPROVED] <= 0.005)
    assert 0.1 < failing[MapKind.PAPER][0] < 0.4
    assert failing[MapKind.PAPER][1] < 0.02, "the paper: 100 % from 70.8 degrees on"
