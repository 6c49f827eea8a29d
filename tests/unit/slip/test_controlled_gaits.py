"""Fixed points and branches of gaits under a controller, and the targets they are drawn over."""

import numpy as np
import pytest

from template_control.errors import ParameterError
from template_control.paper.stability import branch
from template_control.slip.automaton.vocabulary import MapKind, Outcome
from template_control.slip.control.controllers import (
    ActiveRunning,
    ModifiedWalking,
    section_target,
    targeted,
)
from template_control.slip.dynamics.stride import controls
from template_control.slip.gaits.branch import Kind, Special
from template_control.slip.gaits.gait_branch import ControlledFamily, controlled_fixed_point
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import APEX, VLO
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
K0 = P.leg_stiffness


def test_deadbeat_running_has_no_memory():
    controller, target = ActiveRunning(P), np.array([4.0, 0.98])
    z, eigenvalues = controlled_fixed_point(
        ReturnMap(P, "r"), lambda s: controller.solve(s, target).controls, target + 0.01
    )
    np.testing.assert_allclose(z, target, atol=1e-6)
    assert np.max(np.abs(eigenvalues)) < 1e-3


def test_papers_map_settles_walking_beside_its_target():
    """A closed form's error moves the fixed point; simulation settles where Newton says."""
    controller, target = ModifiedWalking(P, MapKind.IMPROVED), np.array([1.125, 0.98, 0.0])
    guess = controller.solve(target, target).controls

    def policy(s):
        return controller.solve(s, target, guess).controls

    z, eigenvalues = controlled_fixed_point(ReturnMap(P), policy, target)
    assert 1e-7 < np.max(np.abs(z - target)) < 0.02
    assert np.max(np.abs(eigenvalues)) < 1.02
    again, _ = ReturnMap(P).step(z, policy(z))
    np.testing.assert_allclose(again, z, atol=1e-7)


@pytest.fixture(scope="module")
def modified_branch():
    """Modified walking on the exact map, its target moved along 0.9818 m."""
    guess, held = controls(np.radians(70.0), K0, K0), {"height": 0.9818}
    policy = targeted(ModifiedWalking(P), P, VLO, held, "energy", guess)
    family = ControlledFamily(ReturnMap(P), policy, "energy")
    start = section_target(P, VLO, {"height": 0.9818, "energy": 826.0})
    return policy, family.trace(np.append(start, 826.0), "target", (815.0, 830.0), step=0.004)


@pytest.mark.slow(seconds=3)
def test_controlled_walking_settles_on_its_target_up_to_the_fold(modified_branch):
    policy, found = modified_branch
    fold = next(p for p in branch() if p.special is Special.FOLD)
    for point in found:
        again, outcome = ReturnMap(P).step(point.state, policy(point.state, point.target))
        assert outcome is Outcome.SECTION
        np.testing.assert_allclose(again, point.state, atol=1e-8)
        assert point.quantity("target") == pytest.approx(point.energy, abs=1e-3)
        off = abs(point.state[1] - 0.9818)
        if point.target < fold.energy:
            assert off < 1e-5
            assert point.kind is Kind.STABLE or abs(point.target - 821.87) < 1.0
        else:
            # There is no gait of that height; the nearest ones are folds of their energy.
            assert off > 1e-4
            assert point.kind is Kind.NEUTRAL
    # Passive walking is unstable there.
    assert min(p.target for p in found) < 816.0
    assert not any(p.special for p in found)


def test_controlled_eigenvalue_is_the_rate_at_which_a_walk_comes_back(modified_branch):
    policy, found = modified_branch
    point = min(found, key=lambda p: abs(p.target - 826.0))
    expected = np.max(np.abs(point.eigenvalues))
    z, size = point.state + [0.0, 1e-5, 1e-5], []
    for _ in range(40):
        z, _ = ReturnMap(P).step(z, policy(z, point.target))
        size.append(np.linalg.norm(z - point.state))
    assert (size[-1] / size[9]) ** (1.0 / 30.0) == pytest.approx(expected, abs=2e-3)


def test_what_a_robot_adds_to_a_step_makes_modified_walking_circle():
    controller, target = ModifiedWalking(P), np.array([1.14837527, 0.9818, 0.0])
    guess = controls(np.radians(70.0), K0, K0)

    def walk(added):
        z, states = target, []
        for _ in range(80):
            z = ReturnMap(P).step(z, controller.solve(z, target, guess).controls)[0] + added
            states.append(z)
        return np.array(states[40:]) - target

    assert np.all(np.abs(walk(np.zeros(3))) < 1e-6)
    beside = walk(np.array([0.0033, 0.00075, -0.019]))  # five-link's
    assert 0.015 < beside[:, 2].std() < 0.025
    assert -0.002 < beside[:, 1].mean() < -0.001


def test_controlled_running_has_no_memory_at_any_speed():
    guess, held = controls(np.radians(70.0), K0, K0), {"height": 0.98}
    policy = targeted(ActiveRunning(P), P, APEX, held, "speed", guess)
    family = ControlledFamily(ReturnMap(P, "r"), policy, "speed")
    found = family.trace(np.array([4.0, 0.98, 4.0]), "target", (2.0, 6.0), step=0.2)
    assert len(found) > 5
    for point in found:
        np.testing.assert_allclose(point.state, [point.target, 0.98], atol=1e-6)
        assert np.max(np.abs(point.eigenvalues)) < 1e-3


@pytest.mark.parametrize(
    ("section", "quantities"),
    [
        (VLO, {"energy": 826.0, "height": 0.9818}),
        (VLO, {"speed": 1.1, "height": 0.98}),
        (VLO, {"energy": 826.0, "speed": 1.1}),
        (APEX, {"energy": 1500.0, "height": 0.98}),
        (APEX, {"energy": 1500.0, "speed": 4.0}),
    ],
)
def test_targets_have_the_quantities_asked_for(section, quantities):
    z = section_target(P, section, quantities)
    spring = 0.5 * K0 * (1.0 - z[1]) ** 2 if section is VLO else 0.0
    energy = 0.5 * P.mass * z[0] ** 2 + P.mass * P.gravity * z[1] + spring
    found = {"energy": energy, "height": z[1], "speed": z[0]}
    assert {name: found[name] for name in quantities} == pytest.approx(quantities)
    assert len(z) == (3 if section is VLO else 2)


def test_impossible_targets_and_families_are_named():
    with pytest.raises(ParameterError, match="no VLO state has energy 500"):
        section_target(P, VLO, {"energy": 500.0, "height": 0.98})
    with pytest.raises(ParameterError, match="give two of"):
        section_target(P, VLO, {"energy": 500.0})
    with pytest.raises(ParameterError, match="cannot vary the target's 'angle'"):
        ControlledFamily(ReturnMap(P), lambda z, _: z, "angle")
    with pytest.raises(ParameterError, match="stride is 'wr'"):
        ControlledFamily(ReturnMap(P, "wr"), lambda z, _: z, "energy")
    family = ControlledFamily(ReturnMap(P), lambda z, _: controls(1.2, K0, K0), "energy")
    with pytest.raises(ParameterError, match="cannot draw over 'energy'"):
        family.trace(np.array([1.1, 0.98, 0.0, 826.0]), "energy", (820.0, 830.0))
