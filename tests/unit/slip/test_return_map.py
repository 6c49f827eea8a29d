"""Return maps, exact and closed-form: symmetries, scaling, derivatives, the paper's formulas."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from template_control.errors import ParameterError
from template_control.paper.map_errors import study
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, MapKind, Outcome
from template_control.slip.dynamics.closed_form import (
    axial_torsional,
    harmonic,
    momentum_changes,
)
from template_control.slip.dynamics.guards import COEFFICIENTS, STANCE, Path, sample
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.gaits.walking_by_speed import walking_by_speed
from template_control.slip.maps.return_map import (
    LANDING_TIME,
    LIFTED_TIME,
    RESULTS,
    ReturnMap,
    new_workspace,
    recorded_jacobian,
    recorded_stride,
)
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.plan_costs import DEFECT

P = SlipParameters()
K0 = P.leg_stiffness
RUN = controls(np.radians(70.0), 26e3, 30e3)
STRIDES = {
    "w": ([1.1, 0.978, 0.02], controls(np.radians(66.0), K0, 1.05 * K0)),
    "wp": (
        [1.1, 0.978, 0.02],
        controls(np.radians(66.0), K0, 1.05 * K0, k_push=1.1 * K0),
    ),
    "r": ([4.8, 0.98], RUN),
    "wr": ([1.101, 0.9797, -0.0442], controls(np.radians(71.94), K0, K0, 9.86e3, 48.51e3)),
    "rw": ([1.754, 0.9766], controls(np.radians(71.53), 66.97e3, 18.35e3)),
}
CASES = [(stride, kind) for stride in STRIDES for kind in MapKind]
walking = st.tuples(st.floats(0.95, 1.25), st.floats(0.965, 0.985), st.floats(-0.05, 0.05))


@pytest.mark.parametrize(("stride", "kind"), CASES)
def test_derivatives_agree_with_central_differences(stride, kind):
    z, u = (np.array(v) for v in STRIDES[stride])
    step = ReturnMap(P, stride, kind)
    linear = step.linearise(z, u)
    assert linear.outcome is Outcome.SECTION
    np.testing.assert_allclose(linear.state, step(z, u).state, rtol=1e-12)
    size = np.maximum(np.abs(u), 1.0)
    for jacobian, x, scale, at in (
        (linear.state_jacobian, z, np.ones(len(z)), lambda v: step(v, u).state),
        (linear.control_jacobian, u, size, lambda v: step(z, v).state),
    ):
        for j, unit in enumerate(np.eye(len(x))):
            h = 1e-6 * scale[j]
            difference = (at(x + h * unit) - at(x - h * unit)) / (2.0 * h)
            np.testing.assert_allclose(
                jacobian[:, j] * scale[j], difference * scale[j], atol=1e-6, rtol=1e-6
            )


def extrapolated(at, x, h):
    """Derivative by central differences of three widths, extrapolated to none (order h^6)."""
    wide, middle, narrow = ((at(x + w) - at(x - w)) / (2.0 * w) for w in (h, h / 2.0, h / 4.0))
    first, second = (4.0 * middle - wide) / 3.0, (4.0 * narrow - middle) / 3.0
    return (16.0 * second - first) / 15.0


@pytest.mark.parametrize("stride", ["w", "wp", "rw"])
def test_times_of_touchdown_and_liftoff_and_their_derivatives(stride):
    z, u = (np.array(v) for v in STRIDES[stride])
    step, columns = ReturnMap(P, stride), np.array([0, 1, 2, *range(3, 3 + NUM_SLOTS)])
    columns = columns[np.r_[: len(z), 3 : len(columns)]]

    def times(z, u):
        whole = simulate_stride(P, STRIDE_START[stride], step.sections[0].state(z), u)
        lifted = whole.time_of(Event.REAR_LIFTOFF)
        return np.array([whole.time_of(Event.TOUCHDOWN), whole.duration - lifted])

    result, slopes, _ = step.derivatives(z, u, columns)
    found = [LANDING_TIME, LIFTED_TIME]
    np.testing.assert_allclose(result[found], times(z, u), atol=1e-12)
    np.testing.assert_array_equal(step.evaluate(z, u)[0][found], result[found])
    for c, column in enumerate(columns):
        h = 1e-6 if column < 4 else 1e-6 * K0
        change = h * np.eye(3 + NUM_SLOTS)[column]
        there, back = (
            times(z + sign * change[: len(z)], u + sign * change[3:]) for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(slopes[found, c] * h, (there - back) / 2.0, atol=1e-12)


def test_short_series_give_nearly_the_same_step_and_derivatives():
    """Of degree 10, over steps for 1e-13: 0.2 % of a column's largest at most, and mostly less.

    As plans have them, for 1e-6: 5 %, and ends within 1/100 of what their errors cost.
    """
    columns, family, work = np.arange(3 + NUM_SLOTS), walking_by_speed(), new_workspace()
    errors, missed = [], []
    for speed in np.arange(0.45, 1.4, 0.1):
        gait = family.gait_for(P, speed)
        exact, found, ends = ReturnMap(P, gait.stride).kernel[0], [], []
        ten = exact._replace(degree=10)
        for kernel in (exact, ten, ten._replace(tolerance=1e-6)):
            ends.append(np.empty(RESULTS))
            found.append(np.empty((RESULTS, len(columns))))
            recorded_stride(kernel, gait.vlo, gait.controls, work.scratch, ends[-1])
            recorded_jacobian(kernel, gait.controls, columns, work, found[-1])
        whole, *short = (slopes[:3, np.abs(found[0][:3]).max(0) > 0] for slopes in found)
        errors.append([np.max(np.abs(s - whole) / np.abs(whole).max(0)) for s in short])
        missed.append(np.abs(ends[-1][:3] - ends[0][:3]))
    of_ten, planned = np.array(errors).T
    assert of_ten.max() < 2e-3
    assert np.median(of_ten) < 5e-5
    assert planned.max() < 0.05
    assert np.median(planned) < 2e-3
    assert np.all(planned > 10.0 * of_ten)
    assert np.all(np.max(missed, axis=0) < 0.01 * DEFECT)


@pytest.mark.parametrize("stride", STRIDES)
def test_tangents_are_what_differences_tend_to(stride):
    """Of all that the exact map yields: state, distance covered, legs at the bottom."""
    z, u = (np.array(v) for v in STRIDES[stride])
    step, n = ReturnMap(P, stride), len(z)
    columns = [*range(n), *range(3, 3 + len(u))]
    _, jacobian, _ = step.derivatives(z, u, np.array(columns))
    inputs = np.concatenate((z, u))
    for j, x in enumerate(inputs):
        size = max(abs(x), 1.0)

        def at(value, j=j):
            moved = inputs.copy()
            moved[j] = value
            return step.evaluate(moved[:n], moved[n:])[0]

        expected = extrapolated(at, x, 1e-3 * size) * size
        np.testing.assert_allclose(jacobian[:, j] * size, expected, atol=2e-9, rtol=2e-9)


@settings(max_examples=50, deadline=None)  # the first example loads what is compiled
@given(z=walking, alpha=st.floats(64.0, 68.0))
@example(z=(0.953125, 0.9674171601112809, 0.0), alpha=66.9375)  # dE(z') J by dy/dt nearly 0
def test_tangents_keep_energy(z, alpha):
    """With springs that do not change, E(z') = E(z): dE(z') J is dE(z) by z, and 0 by alpha."""
    step, u = ReturnMap(P, "w"), controls(np.radians(alpha), K0, K0)
    end, jacobian, outcome = step.derivatives(np.array(z), u, np.arange(4))
    if outcome is not Outcome.SECTION:
        return

    def slope(state):  # the spring under the CoM at VLO, gravity, speed
        return np.array(
            [
                P.mass * state[0],
                P.mass * P.gravity - K0 * (P.rest_length - state[1]),
                P.mass * state[2],
            ]
        )

    kept = slope(end) @ jacobian[:3]
    scale = np.abs(slope(end)) @ np.abs(jacobian[:3])
    # A column that nearly vanishes is rounded like others: half the energy over its unit counts.
    units = np.array([P.speed_unit, P.rest_length, P.speed_unit, 1.0])
    scale = np.maximum(scale, 0.5 * P.mass * P.gravity * P.rest_length / units)
    # The map keeps energy to its series' 1e-13; by the state it varies a thousand times as much.
    np.testing.assert_array_less(np.abs(kept - [*slope(z), 0.0]), 1e-9 * scale)


@pytest.mark.parametrize(("stride", "kind"), CASES)
def test_batch_equals_scalar(stride, kind):
    z, u = STRIDES[stride]
    rng = np.random.default_rng(3)
    states = np.array(z) * (1.0 + 0.01 * rng.standard_normal((40, len(z))))
    step = ReturnMap(P, stride, kind)
    many = step(states, u)
    for i, state in enumerate(states):
        one = step(state, u)
        assert one.outcome == many.outcome[i]
        np.testing.assert_array_equal(one.state, many.state[i])
        np.testing.assert_array_equal(one.advance, many.advance[i])
        if one.outcome == Outcome.SECTION:
            np.testing.assert_array_equal(step.step(state, u)[0], one.state)
    assert np.any(many.outcome == Outcome.SECTION)
    grid = step(states.reshape(8, 5, -1), np.tile(u, (8, 5, 1)))
    np.testing.assert_array_equal(grid.state.reshape(40, -1), many.state)


@pytest.mark.parametrize(("stride", "kind"), CASES)
@settings(max_examples=10, deadline=None)
@given(mass=st.floats(5.0, 120.0), length=st.floats(0.3, 1.3), gravity=st.floats(1.6, 12.0))
def test_dynamic_similarity(stride, kind, mass, length, gravity):
    z, u = STRIDES[stride]
    z = np.array(z)
    stiffness = mass * gravity / length / (P.mass * P.gravity / P.rest_length)
    other = SlipParameters(mass, gravity, length, K0 * stiffness)
    scale = np.full(len(z), np.sqrt(gravity * length / (P.gravity * P.rest_length)))
    scale[1] = length / P.rest_length
    u_other = np.array(u) * [1.0, *[stiffness] * (len(u) - 1)]
    here, there = ReturnMap(P, stride, kind), ReturnMap(other, stride, kind)
    expected = here(z, u).state
    out = np.ones(here.dimensions[1])
    out[:] = scale[0]
    out[1] = scale[1]
    tolerance = 1e-9 if kind is MapKind.EXACT else 1e-7
    np.testing.assert_allclose(
        there(z * scale, u_other).state, expected * out, rtol=tolerance, atol=tolerance
    )


@given(walking)
@settings(max_examples=30, deadline=None)
def test_exact_and_improved_maps_conserve_energy(z):
    u = controls(np.radians(68.0), K0, K0)
    for kind in (MapKind.EXACT, MapKind.IMPROVED):
        mapped = ReturnMap(P, "w", kind)(z, u)
        if mapped.outcome == Outcome.SECTION:
            energy = VLO.energy(P, mapped.state)
            assert energy == pytest.approx(VLO.energy(P, np.array(z)), rel=1e-10)


def test_a_passive_symmetric_step_is_its_own_mirror_image(gait):
    stride = simulate_stride(
        P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], gait.controls
    )
    t = np.linspace(0.0, stride.duration, 101)
    there, back = stride.sample(t), stride.sample(stride.duration - t)
    np.testing.assert_allclose(there[:, 1:3], back[:, 1:3], atol=1e-8)  # y, dx/dt
    np.testing.assert_allclose(there[:, 3], -back[:, 3], atol=1e-7)
    np.testing.assert_allclose(there[:, 0] + back[:, 0], stride.state[0], atol=1e-8)


def test_composed_maps_equal_a_simulation_on_through_sections():
    """Walk, walk to run, run, run to walk: maps composed against one continued simulation."""
    plan = [("w", controls(np.radians(71.0), K0, K0)), ("wr", STRIDES["wr"][1])]
    plan += [("r", controls(np.radians(76.0), 18e3, 20e3)), ("rw", STRIDES["rw"][1])]
    z = np.array([1.1, 0.98, -0.03])
    state = VLO.state(z)
    for stride, u in plan:
        mapped = ReturnMap(P, stride)(z, u)
        before = state[0]
        simulated = simulate_stride(P, STRIDE_START[stride], state, u, (state[0], state[0]))
        assert mapped.outcome == simulated.outcome == Outcome.SECTION
        state, z = simulated.state, mapped.state
        np.testing.assert_allclose(VLO.of(state)[: len(z)], z, rtol=1e-10, atol=1e-10)
        assert mapped.advance == pytest.approx(state[0] - before, rel=1e-10)


def test_double_stance_constants_solve_the_papers_equations():
    """(18), (20), (23) with the notes' reading, (24), (25)."""
    c, weight, l0 = 0.62, P.mass * P.gravity, P.rest_length
    k_r, l_r0, k_t = axial_torsional(c, K0, P.mass, P.gravity, l0)
    roots = np.roots(
        [
            1.0,
            -2.0 * l0,
            l0**2 - c**2 / 4 - (weight / K0) ** 2 / 4,
            c**2 / 2 * l0,
            -(c**2) / 4 * l0**2,
        ]
    )
    l_eq = next(r.real for r in roots if abs(r.imag) < 1e-9 and c / 2 < r.real < l0)
    y_eq = np.sqrt(l_eq**2 - c**2 / 4)
    assert k_r == pytest.approx(weight / (np.sqrt(l0**2 - c**2 / 4) - y_eq), rel=1e-9)
    assert l_r0 == pytest.approx(weight / k_r + y_eq, rel=1e-9)
    assert k_t == pytest.approx(
        4 * K0 * c**2 * l0 * l_r0**2 / (c**2 + 4 * l_r0**2) ** 1.5, rel=1e-9
    )


def test_momentum_changes_are_the_integrals_they_stand_for():
    """(13) and (27) are exact integrals of (11); (12) is the trapezoid of gravity's torque."""
    a, t = np.zeros(COEFFICIENTS), 0.12
    harmonic(a, (0.3, 0.96, 1.7, -0.2), -1.05, K0 / P.mass, 0.97, P.gravity)

    def polar(time):
        out = np.empty(6)
        sample(STANCE, Path(a, a), time, out)
        return np.hypot(out[0] - 0.3, out[1]), np.arctan2(out[1], out[0] - 0.3)

    mean_r = quad(lambda s: polar(s)[0], 0.0, t)[0] / t
    ends = np.cos(polar(0.0)[1]) + np.cos(polar(t)[1])
    gravity = -0.5 * t * P.gravity * mean_r * ends
    assert momentum_changes(a, t, (P.gravity, 0.0), 0.0) == pytest.approx(gravity, rel=1e-10)
    torsion = 7.0 * quad(lambda s: np.pi / 2 - polar(s)[1], 0.0, t)[0]
    assert momentum_changes(a, t, (P.gravity, 0.0), 7.0) - gravity == pytest.approx(
        torsion, rel=1e-9
    )


def test_error_study_meets_its_targets():
    result = study()
    assert len(result.distance) >= 5000
    improved = result.errors[MapKind.IMPROVED].statistics()
    paper = result.errors[MapKind.PAPER].statistics()
    assert improved["position"]["mean"] <= 0.1 * paper["position"]["mean"] <= 0.1
    assert improved["velocity"]["mean"] <= 0.1 * paper["velocity"]["mean"]
    assert improved["velocity"]["mean"] <= 0.2
    near = result.distance < 0.1
    for errors in result.errors.values():
        assert np.nanmean(errors.position[near]) < np.nanmean(errors.position[~near])


@pytest.mark.parametrize(
    ("z", "u", "expected"),
    [
        ([0.2, 0.93, 0.0], controls(np.radians(66.0), K0, K0), Outcome.BACKWARD),
        ([0.3, 0.978, -1.0], controls(np.radians(85.0), 2e3, 2e3), Outcome.NO_TOUCHDOWN),
        ([1.0, 0.99, 1.2], controls(np.radians(66.0), K0, K0), Outcome.UNWANTED_FLIGHT),
    ],
)
def test_reasons_for_failure_are_values(z, u, expected):
    mapped = ReturnMap(P)(z, u)
    assert mapped.outcome == expected
    assert np.all(np.isnan(mapped.state))
    assert ReturnMap(P, "w", MapKind.IMPROVED)(z, u).outcome != Outcome.SECTION


@pytest.mark.parametrize("kind", list(MapKind))
@pytest.mark.parametrize("stride", STRIDE_START)
def test_no_state_and_no_controls_raise(stride, kind):
    """Failed strides are values to the derivatives as to the map, even on legs without spring."""
    rng = np.random.default_rng(7)
    step = ReturnMap(P, stride, kind)
    n = step.dimensions[0]
    nodes = AUTOMATON.stride(STRIDE_START[stride])
    slots = {slot for node in nodes for slot in (node.rear, node.front) if slot is not None}
    for _ in range(150):
        z = np.array([rng.normal(1.0, 2.0), rng.uniform(0.5, 1.2), rng.normal()])[:n]
        stiffness = rng.choice([0.0, K0, 1e5], 5) * rng.uniform(0.3, 2.0, 5)
        u = controls(rng.uniform(0.3, 1.57), *stiffness)
        mapped, linear = step(z, u), step.linearise(z, u)
        # A closed form may carry the CoM into its own foot, and out at any speed. By a stiffness of
        # 0, where a leg neither carries nor is in the air, it has no derivative.
        done = mapped.outcome == linear.outcome == Outcome.SECTION and mapped.state[0] < 1e3
        if done and all(u[slot] > 0.0 for slot in slots):
            assert np.all(np.isfinite(linear.state_jacobian))
            np.testing.assert_allclose(linear.state, mapped.state, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("kind", list(MapKind))
def test_a_phase_may_end_as_it_begins(kind):
    """Backward from the start: the stance phase is over at touchdown, after no time."""
    step, u = ReturnMap(P, "r", kind), controls(0.907571211, 11550.0, 11550.0)
    z = [-0.01476402, 0.91469749]
    assert step(z, u).outcome == Outcome.BACKWARD
    assert step.linearise(z, u).outcome is Outcome.BACKWARD


def test_nan_and_wrong_shapes_do_not_enter():
    step = ReturnMap(P)
    u = STRIDES["w"][1]
    with pytest.raises(ParameterError, match="state holds a number that is not finite"):
        step([1.1, np.nan, 0.0], u)
    with pytest.raises(ParameterError, match=r"controls is .* give finite"):
        step.linearise([1.1, 0.98, 0.0], u + np.inf)
    with pytest.raises(ParameterError, match="last axis must hold 3"):
        step([1.1, 0.98], u)
    with pytest.raises(ParameterError, match=r"state has shape \(2, 3\)"):
        step.linearise(np.ones((2, 3)), u)
    with pytest.raises(ParameterError, match="no stride 'trot'"):
        ReturnMap(P, "trot")
