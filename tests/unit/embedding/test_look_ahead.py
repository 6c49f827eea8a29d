"""The planner that looks several steps ahead: its derivatives, its bounds and its governor."""

import json
from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.embedding.planners.ahead import (
    RISE,
    SPACING,
    AheadOptions,
    AheadPlanner,
    check_feasibility,
    plan_problem,
)
from template_control.embedding.planners.gait_table import (
    CONTROL,
    SLOTS,
    STATE,
    STIFFNESS,
    gait_table,
    row_at,
)
from template_control.embedding.planners.look_ahead import (
    BOUNDS,
    PER_STEP,
    PlanTarget,
    knee_moment,
    look_ahead,
    new_plan,
    residuals,
    slopes,
)
from template_control.embedding.planners.planner import ANY_ANGLE, Cause, Context
from template_control.embedding.planners.step_search import TOP_MARGIN
from template_control.errors import ScenarioError
from template_control.run.summary import summarise
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome
from template_control.slip.dynamics.stride import StrideSimulator
from template_control.slip.gaits.walking_by_speed import walking_by_speed
from template_control.slip.maps.return_map import REAR_BOTTOM, ReturnMap, new_workspace
from template_control.slip.maps.section import VLO
from template_control.slip.scenario.route import SpeedProfile
from template_control.slip.scenario.speed_route import SpeedRoute

P = tc.SlipParameters()
OPTIONS = AheadOptions()
SCENARIO = """
start = [0.4, 0.977, 0.0]
[[segment]]
gait = "walk"
speed = 0.4
acceleration = {acceleration}
until_speed = {until}
"""


@pytest.fixture(scope="module")
def planner():
    return AheadPlanner(P)


def table():
    """Of the planner's gaits; whoever asks first waits a second for it."""
    return gait_table(P)


def plan_from(z, speed, steps=3, **changes):
    """A plan's cost, the plan, and what it was made with."""
    known = plan_problem(P, table())._replace(**changes)
    plan, work = new_plan(steps), new_workspace()
    aim = PlanTarget(speed, np.zeros(3), ANY_ANGLE)
    cost, _ = look_ahead(known, work, z, aim, plan)
    return cost, plan, (known, work, aim)


@pytest.mark.parametrize("moment", [np.inf, 250.0])
def test_derivatives_are_those_of_the_residuals(moment):
    z = row_at(table(), 0.8)[STATE : STATE + 3] + [0.03, 0.002, 0.16]
    _, plan, (known, work, _) = plan_from(z, 0.9, rounds=1, knee_moment=moment)
    size = plan.controls.size
    rows = np.empty((PER_STEP * len(plan.controls), size))
    slopes(known, work, plan, rows)
    step = ReturnMap(P, "wp")

    def missed(change):
        states, controls = [plan.states[0]], plan.controls + change.reshape(plan.controls.shape)
        legs = []
        for row in controls:
            u = np.zeros(6)
            u[SLOTS] = row * [1.0, *[plan.row[STIFFNESS]] * 3]
            result, _ = step.evaluate(states[-1], u)
            states.append(result[:3])
            legs.append(result[REAR_BOTTOM:])
        out = np.empty(len(rows))
        states, legs = np.array(states), np.array(legs)
        residuals(known, plan._replace(states=states, controls=controls, lengths=legs), out)
        return out

    for column, change in zip(rows.T, 1e-6 * np.eye(size), strict=True):
        difference = (missed(change) - missed(-change)) / 2e-6
        np.testing.assert_allclose(column, difference, rtol=1e-4, atol=1e-4 * np.abs(rows).max())


@pytest.mark.parametrize("speed", [0.2, 0.36, 0.8, 1.3])
def test_a_gait_is_kept(planner, speed):
    row = row_at(table(), speed)
    z = row[STATE : STATE + 3]
    decision = planner.decide(Context(z, z))
    assert decision.accepted is None
    assert decision.nominal
    np.testing.assert_allclose(decision.predicted, z, atol=2e-3)
    k = row[STIFFNESS]
    np.testing.assert_allclose(decision.controls[SLOTS[1:]], k, rtol=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_a_plan_stays_within_its_bounds(seed):
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0.3, 1.2)
    z = row_at(table(), speed)[STATE : STATE + 3] + rng.uniform(-1, 1, 3) * [0.15, 0.006, 0.15]
    cost, plan, _ = plan_from(z, speed)
    if not np.isfinite(cost):
        pytest.skip("no plan from there")
    low, high = BOUNDS.copy()
    low[0] += plan.row[CONTROL]
    high[0] += plan.row[CONTROL]
    assert np.all(plan.controls >= low - 1e-12)
    assert np.all(plan.controls <= high + 1e-12)
    top = np.arcsin(np.minimum(plan.states[0, 1], 1.0))
    assert plan.controls[0, 0] <= top - TOP_MARGIN + 1e-12


def test_a_foot_does_not_land_at_once():
    """Slow and sinking at VLO, the CoM would else be at the height of a landing in 0.05 s."""
    z = row_at(table(), 0.3)[STATE : STATE + 3] + [0.1, 0.0, -0.05]
    simulator, node = StrideSimulator(P, AUTOMATON), AUTOMATON.start("wp").name

    def lands(**changes):
        _, plan, _ = plan_from(z, 0.3, **changes)
        u = np.zeros(NUM_SLOTS)
        u[SLOTS] = plan.controls[0] * [1.0, *[plan.row[STIFFNESS]] * 3]
        return simulator.run(node, VLO.state(z), u).time_of(Event.TOUCHDOWN)

    assert lands() < 0.1
    assert lands(earliest=0.12) > 0.11


def test_the_first_angle_is_one_that_the_foot_can_reach(planner):
    z = row_at(table(), 0.9)[STATE : STATE + 3]
    free = planner.decide(Context(z, z + [0.1, 0.0, 0.0]))
    angle = free.controls[0] + 0.01
    held = planner.decide(Context(z, z + [0.1, 0.0, 0.0], (angle, angle + 1e-9)))
    assert held.controls[0] == pytest.approx(angle, abs=1e-8)


def test_dy_dt_costs_above_its_bound():
    z = row_at(table(), 0.9)[STATE : STATE + 3]
    below, *_ = plan_from(z + [0.0, 0.0, 0.1], 0.9, rounds=1)
    calm, plan, _ = plan_from(z + [0.0, 0.0, 0.1], 0.9)
    assert calm <= below
    assert np.abs(plan.states[1:, 2]).max() < sum(RISE)


@pytest.mark.parametrize("faster", [0.15, -0.15])
def test_a_plan_keeps_to_what_the_knees_bear(faster):
    z = row_at(table(), 0.8)[STATE : STATE + 3]

    def largest(limit):
        _, plan, (known, *_) = plan_from(z, 0.8 + faster, knee_moment=limit)
        legs = [(i, leg) for i in range(len(plan.lengths)) for leg in range(3)]
        return max(knee_moment(known, plan, i, leg)[0] for i, leg in legs)

    free = largest(np.inf)
    limit = 0.9 * free
    assert largest(limit) - limit < 0.6 * (free - limit)  # the limit is soft


def test_what_cannot_be_done_is_told_from_what_is_dear():
    """A change of all controls costs, and exceeds nothing."""
    z = row_at(table(), 0.8)[STATE : STATE + 3]
    cost, plan, (known, work, aim) = plan_from(z, 0.9)
    _, excess = look_ahead(known, work, z, aim, plan)
    assert excess < 0.5 * cost
    weak = known._replace(knee_moment=0.3 * known.knee_moment)
    assert look_ahead(weak, work, z, aim, plan)[1] > OPTIONS.cheap


def test_a_small_change_is_taken_and_a_large_one_reduced(planner):
    z = row_at(table(), 0.9)[STATE : STATE + 3]
    taken = planner.decide(Context(z, z + [0.05, 0.0, 0.0]))
    assert taken.accepted is None
    reduced = planner.decide(Context(z, z + [0.5, 0.0, 0.0]))
    assert 0.9 < reduced.accepted <= 0.9 + OPTIONS.pace
    assert 0.9 < reduced.predicted[0] < reduced.accepted
    assert planner.gait.vlo[0] == pytest.approx(reduced.accepted)


@pytest.mark.parametrize("cause", [Cause.TOUCHDOWN, Cause.DEVIATION])
def test_a_step_goes_on_to_where_it_went(planner, cause):
    z = row_at(table(), 0.9)[STATE : STATE + 3]
    wanted, seems = z - [0.5, 0.0, 0.0], z + [0.04, 0.0, 0.0]
    began = planner.decide(Context(z, wanted))
    planner.decide(Context(began.predicted, wanted, cause=Cause.FUTURE))
    goes_on = planner.decide(Context(seems, wanted, cause=cause, decision=began))
    assert goes_on.accepted == began.accepted
    assert planner.decide(Context(seems, wanted)).accepted > began.accepted


@pytest.mark.parametrize(("wanted", "end"), [(0.02, 0), (3.0, 1)])
def test_beyond_the_family_its_end_is_accepted(planner, wanted, end):
    there = planner.speeds[end]
    z = row_at(table(), there)[STATE : STATE + 3]
    decision = planner.decide(Context(z, np.array([wanted, z[1], 0.0])))
    assert decision.accepted == pytest.approx(there)


@pytest.mark.slow(seconds=2)
def test_a_plan_that_is_not_cheap_gives_way_to_a_search():
    hasty = AheadPlanner(P, AheadOptions(cheap=1e-9))
    z = row_at(table(), 0.9)[STATE : STATE + 3] + [0.1, 0.0, 0.0]
    decision = hasty.decide(Context(z, z))
    assert decision.feasible
    assert decision.lasting
    assert not decision.nominal
    assert decision.accepted == pytest.approx(z[0], abs=SPACING)


def test_the_template_goes_through_all_speeds_and_back(planner):
    """Across the gap of the family too, up and down."""
    step, z, speeds = ReturnMap(P, "wp"), walking_by_speed().gait_for(P, 0.35).vlo, []
    for wanted in [1.3] * 28 + [0.27] * 28:
        decision = planner.decide(Context(z, np.array([wanted, 0.0, 0.0])))
        assert decision.nominal
        z, outcome = step.step(z, decision.controls)
        assert outcome is Outcome.SECTION
        assert abs(z[2]) < 0.15
        speeds.append(z[0])
    assert max(speeds) == pytest.approx(1.3, abs=0.02)
    assert speeds[-1] == pytest.approx(0.27, abs=0.02)


def test_a_table_scales_with_the_template():
    small = replace(P, mass=10.0, rest_length=0.3)
    unit = np.sqrt(0.3)
    low, high = AheadPlanner(small).speeds
    assert (low / unit, high / unit) == pytest.approx((table().speed[0], table().speed[-1]))


def test_a_rehearsal_refuses_what_cannot_be_had(planner):
    check_feasibility(SpeedRoute(P, SpeedProfile((0.0, 8.0), (0.8, 0.95)), 8.0), planner)
    with pytest.raises(ScenarioError, match=r"wants .* m/s at VLO .* can be had then"):
        check_feasibility(SpeedRoute(P, SpeedProfile((2.0, 2.5), (0.5, 1.2)), 8.0), planner)


def test_strict_refuses_a_scenario_in_one_line(tmp_path, capsys):
    path = tmp_path / "scenario.toml"
    path.write_text(SCENARIO.format(acceleration=0.5, until=1.2))
    assert main(["walk", "--scenario", str(path), "--strict", "--output", str(tmp_path)]) == 2
    line = capsys.readouterr().err.strip()
    assert "segment 1 wants" in line
    assert len(line.splitlines()) == 1
    assert main(["walk", "--strict", "--steps", "1", "--output", str(tmp_path)]) == 2
    assert "strict goes with a scenario" in capsys.readouterr().err


@pytest.mark.slow
def test_a_robot_changes_its_speed_and_tells_what_it_accepted(tmp_path):
    """Up and down through the gap: no fall, and what was accepted is kept."""
    template = tc.template_for(tc.load_robot("five-link"))
    profile = SpeedProfile((1.0, 1.6, 6.0, 7.0), (0.38, 0.7, 0.7, 0.4))
    record = tc.simulate(
        tc.Experiment(tc.load_robot("five-link"), SpeedRoute(template, profile, 11.0))
    )
    assert not record.fell
    record = tc.Record.load(record.save(tmp_path / "run.npz"))
    speed = record.section_state[:, 0]
    assert speed.max() > 0.5
    assert speed[-1] < 0.42
    accepted = summarise(record, None)["accepted_speed"]
    assert accepted["error_rms"] < 0.08
    assert np.all(record.section_nominal)


@pytest.mark.slow
def test_a_scenario_walks_where_it_was_refused(tmp_path, capfd):
    path = tmp_path / "scenario.toml"
    path.write_text(SCENARIO.format(acceleration=0.2, until=0.5))
    run = ["walk", "--scenario", str(path), "--json", "--no-figures", "--output", str(tmp_path)]
    assert main(run) == 0
    figures = json.loads(capfd.readouterr().out)
    assert figures["strides"] == {"walking with push-off": figures["steps"]}
    assert figures["vlo_target"]["speed"] == pytest.approx(0.5, abs=0.12)
