"""Fixed points, branches, eigenvalues, basins and the deadbeat set, against the paper."""

import json

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from template_control.cli.main import main
from template_control.errors import GaitError, ParameterError
from template_control.paper.stability import branch, lower_limit
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Outcome
from template_control.slip.gaits.branch import Kind, Special, classify
from template_control.slip.gaits.gait_branch import Family
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
K0 = P.leg_stiffness


@pytest.fixture(scope="module")
def points():
    return branch()


def test_every_point_is_a_gait(points):
    step = ReturnMap(P)
    for point in points:
        mapped = step(point.state, point.controls)
        np.testing.assert_allclose(mapped.state, point.state, atol=1e-8)
        assert point.state[1] == pytest.approx(0.9818, abs=1e-8)
        assert point.energy == pytest.approx(VLO.energy(P, point.state), rel=1e-12)


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
    closed = linear.state_jacobian - linear.control_jacobian @ gain
    eigenvalues = np.linalg.eigvals(closed)
    assert np.max(np.abs(eigenvalues)) < 1.0

    z = paper_gait.vlo + [0.01, 0.001, -0.01]
    for _ in range(30):
        z, outcome = ReturnMap(P).step(z, paper_gait.controls - gain @ (z - paper_gait.vlo))
        assert outcome is Outcome.SECTION
    np.testing.assert_allclose(z, paper_gait.vlo, atol=1e-3)


@pytest.mark.slow(seconds=1)
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


@pytest.mark.slow
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
        (["--fix", "height=tall"], "--fix height is 'tall': give a positive number"),
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
