"""Fixed points, branches, eigenvalues, basins and the deadbeat set, against the paper."""

import json

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from template_control.cli.main import main
from template_control.cli.reproductions.stability import branch, lower_limit
from template_control.errors import GaitError, ParameterError
from template_control.slip.automaton import STRIDE_START
from template_control.slip.basin import margin, steps_to_fall, velocity_angle, vlo_state
from template_control.slip.branch import Special
from template_control.slip.controlled_branch import ControlledFamily, controlled_fixed_point
from template_control.slip.controllers import ActiveRunning, ModifiedWalking
from template_control.slip.deadbeat import backward_set, controlled_end, inside_share, settles
from template_control.slip.gait import gait_from_energy, vlo_energy
from template_control.slip.gait_branch import Family
from template_control.slip.parameters import SlipParameters
from template_control.slip.return_map import ReturnMap
from template_control.slip.section_target import section_target, targeted
from template_control.slip.stability import (
    Kind,
    classify,
    closed_loop_eigenvalues,
)
from template_control.slip.stride import controls, run
from template_control.slip.vocabulary import NUM_SLOTS, Event, MapKind, Outcome, Slot

P = SlipParameters()
K0 = P.leg_stiffness


@pytest.fixture(scope="module")
def points():
    return branch()


@pytest.fixture(scope="module")
def paper_gait():
    return gait_from_energy(P, 0.9818, 826.0)


def test_every_point_is_a_gait(points):
    step = ReturnMap(P)
    for point in points:
        mapped = step(point.state, point.controls)
        np.testing.assert_allclose(mapped.state, point.state, atol=1e-8)
        assert point.state[1] == pytest.approx(0.9818, abs=1e-8)
        assert point.energy == pytest.approx(vlo_energy(P, point.state), rel=1e-12)


def test_the_branch_passes_the_fold_the_paper_stops_at(points):
    (fold,) = [p for p in points if p.special is Special.FOLD]
    assert fold.energy == pytest.approx(827.62, abs=0.02)
    assert max(p.energy for p in points) == pytest.approx(fold.energy, abs=1e-6)
    near = [p for p in points if abs(p.energy - 826.0) < 1.0]
    steep = [p for p in near if p.angle > fold.angle]
    flat = [p for p in near if p.angle < fold.angle]
    assert steep
    assert flat
    assert all(p.kind is Kind.STABLE for p in steep)
    assert all(p.kind is Kind.UNSTABLE for p in flat)


def test_stability_ends_where_the_eigenvalues_say(points):
    (lost,) = [p for p in points if p.special is Special.SADDLE_NODE]
    assert np.max(np.abs(lost.eigenvalues)) == pytest.approx(1.0, abs=1e-6)
    assert lost.energy == pytest.approx(822.06, abs=0.3)
    for point in points:
        if point.special is Special.FLIP:
            assert np.min(np.abs(point.eigenvalues + 1.0)) < 1e-6
        if point.special is Special.NEIMARK_SACKER:
            assert np.abs(point.eigenvalues[0]) == pytest.approx(1.0, abs=1e-6)
    assert lower_limit() == pytest.approx(822.06, abs=0.3)


def test_shell_eigenvalues_are_the_full_ones_without_energys(points):
    point = points[len(points) // 2]
    full = np.linalg.eigvals(ReturnMap(P).linearise(point.state, point.controls).state_jacobian)
    trivial = np.argmin(np.abs(full - 1.0))
    assert full[trivial] == pytest.approx(1.0, abs=1e-7)
    others = np.sort_complex(np.delete(full, trivial))
    np.testing.assert_allclose(np.sort_complex(point.eigenvalues), others, atol=1e-6)


def test_running_branch_is_passed_through_its_fold():
    family = Family(P, "r", {"angle": np.radians(68.0), "stiffness": 20e3})
    start = np.array([4.9, 0.947, np.radians(68.0), 20e3])
    found = family.trace(start, "energy", (1500.0, 2100.0), step=0.05)
    specials = {p.special: p for p in found if p.special}
    assert set(specials) == {Special.FOLD, Special.SADDLE_NODE, Special.FLIP}
    # With angle and stiffness held, the fold is where the one eigenvalue is 1.
    assert specials[Special.FOLD].energy == pytest.approx(
        specials[Special.SADDLE_NODE].energy, abs=1e-6
    )
    for point in found:
        mapped = ReturnMap(P, "r")(point.state, point.controls)
        np.testing.assert_allclose(mapped.state, point.state, atol=1e-8)


@pytest.mark.parametrize(
    ("stride", "fixed", "culprit"),
    [
        ("wr", {"height": 0.98, "stiffness": K0}, "stride is 'wr'"),
        ("w", {"height": 0.98}, "give two of"),
        ("w", {"height": 0.98, "colour": 1.0}, "give two of"),
        ("w", {"height": np.nan, "stiffness": K0}, "height is nan"),
    ],
)
def test_bad_families_are_named(stride, fixed, culprit):
    with pytest.raises(ParameterError, match=culprit):
        Family(P, stride, fixed)


def test_no_gait_near_the_start_is_told():
    family = Family(P, "w", {"height": 0.9818, "stiffness": K0})
    with pytest.raises(GaitError, match="no periodic gait near"):
        family.trace(np.array([3.0, 0.9818, 0.0, 1.5, K0]), "energy", (800.0, 900.0))


def test_classification():
    assert classify(np.array([0.5, -0.9j])) is Kind.STABLE
    assert classify(np.array([0.5, 1.1])) is Kind.SADDLE
    assert classify(np.array([-1.2, 1.1])) is Kind.UNSTABLE


def test_closed_loop_eigenvalues_of_an_lqr(paper_gait):
    linear = ReturnMap(P).linearise(paper_gait.vlo, paper_gait.controls)
    scale = np.array([1.0, K0, K0])
    b = linear.control_jacobian[:, :3] * scale
    cost = solve_discrete_are(linear.state_jacobian, b, np.eye(3), np.eye(3))
    gain = np.zeros((NUM_SLOTS, 3))
    small = np.linalg.solve(np.eye(3) + b.T @ cost @ b, b.T @ cost @ linear.state_jacobian)
    gain[:3] = scale[:, None] * small
    eigenvalues = closed_loop_eigenvalues(linear, gain)
    assert np.max(np.abs(eigenvalues)) < 1.0

    z = paper_gait.vlo + [0.01, 0.001, -0.01]
    for _ in range(30):
        z, outcome = ReturnMap(P).step(z, paper_gait.controls - gain @ (z - paper_gait.vlo))
        assert outcome is Outcome.SECTION
    np.testing.assert_allclose(z, paper_gait.vlo, atol=1e-3)


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
    policy = targeted(ModifiedWalking(P), P, Event.VLO, held, "energy", guess)
    family = ControlledFamily(ReturnMap(P), policy, "energy")
    start = section_target(P, Event.VLO, {"height": 0.9818, "energy": 826.0})
    return policy, family.trace(np.append(start, 826.0), "target", (815.0, 830.0), step=0.004)


def test_controlled_walking_settles_on_its_target_up_to_the_fold(modified_branch, points):
    policy, found = modified_branch
    fold = next(p for p in points if p.special is Special.FOLD)
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
    policy = targeted(ActiveRunning(P), P, Event.APEX, held, "speed", guess)
    family = ControlledFamily(ReturnMap(P, "r"), policy, "speed")
    found = family.trace(np.array([4.0, 0.98, 4.0]), "target", (2.0, 6.0), step=0.2)
    assert len(found) > 5
    for point in found:
        np.testing.assert_allclose(point.state, [point.target, 0.98], atol=1e-6)
        assert np.max(np.abs(point.eigenvalues)) < 1e-3


@pytest.mark.parametrize(
    ("section", "quantities"),
    [
        (Event.VLO, {"energy": 826.0, "height": 0.9818}),
        (Event.VLO, {"speed": 1.1, "height": 0.98}),
        (Event.VLO, {"energy": 826.0, "speed": 1.1}),
        (Event.APEX, {"energy": 1500.0, "height": 0.98}),
        (Event.APEX, {"energy": 1500.0, "speed": 4.0}),
    ],
)
def test_targets_have_the_quantities_asked_for(section, quantities):
    z = section_target(P, section, quantities)
    spring = 0.5 * K0 * (1.0 - z[1]) ** 2 if section is Event.VLO else 0.0
    energy = 0.5 * P.mass * z[0] ** 2 + P.mass * P.gravity * z[1] + spring
    found = {"energy": energy, "height": z[1], "speed": z[0]}
    assert {name: found[name] for name in quantities} == pytest.approx(quantities)
    assert len(z) == (3 if section is Event.VLO else 2)


def test_impossible_targets_and_families_are_named():
    with pytest.raises(ParameterError, match="no VLO state has energy 500"):
        section_target(P, Event.VLO, {"energy": 500.0, "height": 0.98})
    with pytest.raises(ParameterError, match="give two of"):
        section_target(P, Event.VLO, {"energy": 500.0})
    with pytest.raises(ParameterError, match="cannot vary the target's 'angle'"):
        ControlledFamily(ReturnMap(P), lambda z, _: z, "angle")
    with pytest.raises(ParameterError, match="stride is 'wr'"):
        ControlledFamily(ReturnMap(P, "wr"), lambda z, _: z, "energy")
    family = ControlledFamily(ReturnMap(P), lambda z, _: controls(1.2, K0, K0), "energy")
    with pytest.raises(ParameterError, match="cannot draw over 'energy'"):
        family.trace(np.array([1.1, 0.98, 0.0, 826.0]), "energy", (820.0, 830.0))


def test_vlo_states_and_energies_belong_together():
    y, phi = np.meshgrid(np.linspace(0.95, 0.99, 5), np.radians([-5.0, 0.0, 5.0]))
    z = vlo_state(P, y, phi, 826.0)
    for state, angle in zip(z.reshape(-1, 3), phi.ravel(), strict=True):
        assert vlo_energy(P, state) == pytest.approx(826.0, rel=1e-12)
        assert velocity_angle(state) == pytest.approx(angle)
        assert np.sign(state[2]) == -np.sign(angle), "downward is positive"
    assert np.isnan(vlo_state(P, 0.98, 0.0, 700.0)[0])


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


def test_margin_shrinks_towards_the_lower_limit():
    radii = []
    for energy in (822.5, 824.0, 826.0):
        gait = gait_from_energy(P, 0.9818, energy)
        radii.append(margin(P, gait.controls, (0.9818, 0.0), energy))
    assert 0.0 < radii[0] < radii[1] < radii[2] < 0.05


@pytest.mark.slow
def test_deadbeat_set_and_what_the_maps_make_of_it(paper_gait):
    found = backward_set(paper_gait, counts=(20, 120))
    assert len(found.state) > 200
    for z, u in zip(found.state[::20], found.controls[::20], strict=True):
        stride = run(P, STRIDE_START["w"], [0.0, z[1], z[0], z[2]], u)
        np.testing.assert_allclose(stride.state[[2, 1, 3]], paper_gait.vlo, atol=1e-7)
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


def test_gaits_command(tmp_path, capfd):
    assert main(["gaits", "--output", str(tmp_path), "--json"]) == 0
    data = json.loads(capfd.readouterr().out)
    assert (tmp_path / "branch.png").is_file()
    specials = [p["special"] for p in data["points"] if p["special"]]
    assert "fold" in specials
    assert main(["gaits", "--gait", "run", "--step", "0.05", "--no-figures"]) == 0
    out = capfd.readouterr().out
    for text in ("branch of run gaits", "fold", "flip", "stable"):
        assert text in out


def test_gaits_command_follows_controlled_ones(tmp_path, capfd):
    arguments = ["gaits", "--controlled", "improved", "--limits", "825", "827"]
    assert main([*arguments, "--output", str(tmp_path), "--json"]) == 0
    data = json.loads(capfd.readouterr().out)
    assert (tmp_path / "branch.png").is_file()
    assert all(p["energy"] == pytest.approx(p["target"], abs=1e-3) for p in data["points"])
    # The improved map's error, 1 mm.
    assert all(1e-4 < abs(p["height"] - 0.9818) < 2e-3 for p in data["points"])
    run_arguments = ["--gait", "run", "--over", "speed", "--limits", "3", "5", "--step", "0.2"]
    assert main(["gaits", "--controlled", "paper", *run_arguments, "--no-figures"]) == 0
    out = capfd.readouterr().out
    for text in ("branch of run gaits", "target", "|eig.|", "stable"):
        assert text in out


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["--fix", "colour=3"], "names no quantity"),
        (["--fix", "height=tall"], "has no number"),
        (["--fix", "height=0.98"], "give two of"),
        (["--limits", "830", "815"], "give low, then high"),
        (["--over", "speed"], "needs --limits"),
        (["--step", "-1"], "--step is -1"),
        (["--start", "speed=9"], "no periodic gait near"),
        (["--controlled", "exact", "--fix", "angle=70"], "--fix one of"),
        (["--controlled", "exact", "--over", "height", "--limits", "0.97", "0.98"], "--fix one of"),
        (["--controlled", "exact", "--limits", "500", "600"], "no VLO state has"),
    ],
)
def test_gaits_command_names_mistakes(arguments, culprit, capfd):
    assert main(["gaits", "--no-figures", *arguments]) == 2
    error = capfd.readouterr().err
    assert culprit in error
    assert error.count("\n") == 1
