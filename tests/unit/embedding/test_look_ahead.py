"""The planner that looks several steps ahead: its plans, their limits, and its governor."""

import json
from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.embedding.planners.ahead import (
    SPACING,
    AheadOptions,
    AheadPlanner,
)
from template_control.embedding.planners.planner import Cause, Context
from template_control.embedding.standing.curves import StandingOptions
from template_control.embedding.standing.passes import PassTable
from template_control.errors import ScenarioError
from template_control.robot.template import walk_limits
from template_control.run.robot_route import check_feasibility
from template_control.run.summary import summarise
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Event, Outcome
from template_control.slip.control.least_squares import Search
from template_control.slip.control.touchdown import ANY_ANGLE, TOP_MARGIN
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.dynamics.stride import StrideSimulator
from template_control.slip.gaits.walking_by_speed import gaits_by_speed, walking_by_speed
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.planning.gait_table import (
    CONTROL,
    CONTROLS,
    FACTOR,
    SETTLING,
    SLOTS,
    STATE,
    STATE_TOLERANCE,
    STIFFNESS,
    gait_table,
    row_at,
)
from template_control.slip.planning.look_ahead import (
    BLOCK,
    BOUNDS,
    SEARCH,
    SMALL,
    STATES,
    begin,
    knee_moment,
    look_ahead,
    make_plan,
    new_problem,
    roughness,
    step_controls,
)
from template_control.slip.planning.plan_costs import KNEE_MOMENT, RISE, WalkLimits, plan_costs
from template_control.slip.scenario.route import SpeedProfile
from template_control.slip.scenario.speed_route import SpeedRoute
from template_control.structured import keep
from template_control.warm_up import ANNOUNCEMENT

P = tc.SlipParameters()
OPTIONS = AheadOptions()
KNEES = KNEE_MOMENT * P.mass * P.gravity  # [N m], l0 = 1 m
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
    """Of the planner's gaits; the first user waits a second for it."""
    return gait_table(P)


def problem_from(z, speed, steps=3, **changes):
    """A plan that is to be near a gait, and its start."""
    limits = WalkLimits(KNEES, (0.2, 1.4), 0.155)
    p = new_problem(plan_costs(P, limits, OPTIONS.ease)._replace(**changes), steps)
    row = row_at(table(), speed)
    p.start[:], p.offset[:] = z, 0.0
    r = p.reference
    r.states[:], r.end[:] = row[STATE:CONTROL], row[STATE:CONTROL]
    r.controls[:], r.stiffness[:] = row[CONTROL : CONTROL + CONTROLS], row[STIFFNESS]
    r.factor[:] = row[FACTOR:SETTLING].reshape(3, 3)
    x = np.empty(BLOCK * steps - STATES)
    begin(p, ANY_ANGLE, x)
    return p, x


def plan_from(z, speed, steps=3, search=SEARCH, **changes):
    """A plan near a gait: its cost and excess, its problem and its unknowns."""
    p, x = problem_from(z, speed, steps, **changes)
    cost, excess = look_ahead(p, search, x)
    return cost, excess, p, x


def controls_of(p, x, i=0):
    """(6,) controls of a plan's step."""
    return step_controls(x[BLOCK * i :][:CONTROLS], p.reference.stiffness[i])


@pytest.mark.parametrize("moment", [np.inf, 250.0])
def test_a_plan_is_where_its_cost_is_least(moment):
    """The derivatives are those of the cost: else Gauss and Newton's method ends elsewhere."""
    z = row_at(table(), 0.8)[STATE:CONTROL] + [0.03, 0.002, 0.16]
    fully = Search(rounds=60, close=1e-9, grid=0, damping=1e-3)
    p, x = problem_from(z, 0.9, knee_moment=moment, kernel=stride_kernel(P, "wp"))
    p.close[:] = np.nan  # no derivatives are carried
    cost, _ = look_ahead(p, fully, x)

    def at(y):
        return look_ahead(p, Search(rounds=0, grid=0), y.copy())[0]

    assert at(x) == pytest.approx(cost)
    free = (x > p.lower + 1e-4 * p.change) & (x < p.upper - 1e-4 * p.change)
    for i in np.flatnonzero(free):
        change = 1e-4 * p.change[i] * np.eye(len(x))[i]
        slope = (at(x + change) - at(x - change)) / 2e-4
        assert abs(slope) < 2e-3 * cost
    far = x + 0.01 * p.change
    left = look_ahead(p, Search(rounds=1, grid=0), far.copy())[0] - cost
    assert left < 0.1 * (at(far) - cost)


@pytest.mark.parametrize("speed", [0.65, 0.8, 1.0, 1.2])
def test_carried_derivatives_lead_to_the_plan_of_exact_ones(speed):
    """To the least cost that many rounds with new ones find, along exact series."""
    z = row_at(table(), speed)[STATE:CONTROL] + [0.03, 0.002, 0.06]
    cost, excess, p, x = plan_from(z, speed + 0.05)
    exact, y = problem_from(z, speed + 0.05, kernel=stride_kernel(P, "wp"))
    exact.close[:] = np.nan  # none are carried
    least, _ = look_ahead(exact, Search(rounds=60, close=1e-9, grid=0, damping=1e-3), y)
    assert cost == pytest.approx(least, rel=0.02)
    assert excess < 0.01
    assert np.max(np.abs(x - y) / p.change) < 0.05


@pytest.mark.parametrize("speed", [0.3, 0.8, 1.3])
def test_roughness_is_what_the_linear_map_misses(speed):
    row, step = row_at(table(), speed), ReturnMap(P, "wp")
    p, x = problem_from(row[STATE:CONTROL], speed, kernel=step.kernel[0])
    z, u = p.start.copy(), controls_of(p, x)
    here = step.linearise(z, u)
    misses = [
        step.evaluate(z + change, u)[0][:3] - here.state - here.state_jacobian @ change
        for change in (*np.diag(SMALL), *-np.diag(SMALL))
    ]
    expected = np.max(np.abs(misses) / STATE_TOLERANCE)
    assert roughness(p, x, 0) == pytest.approx(expected, rel=1e-6)
    assert roughness(p, x, 0) < 2.5
    short, x = problem_from(row[STATE:CONTROL], speed)
    assert roughness(short, x, 0) == pytest.approx(expected, abs=0.02)


def test_a_step_that_another_state_does_not_complete_is_rough():
    _, _, p, x = plan_from(np.array([0.241, 0.977, 0.105]), 0.24)  # rises out of a slow gait
    assert roughness(p, x, 0) == np.inf


@pytest.mark.parametrize("judged", [(20.0, np.inf), (-1.0, 0.0)])
def test_a_plan_in_one_call_is_that_of_three(judged):
    z = row_at(table(), 0.8)[STATE:CONTROL] + [0.03, 0.002, 0.05]
    cost, excess, p, x = plan_from(z, 0.9)
    y = np.empty_like(x)
    rough = roughness(p, x, 0) if judged[0] > excess else 0.0
    p.reference.end[:], p.reference.stiffness[:] = 0.0, 0.0  # of another plan
    found = make_plan(keep(p), (0.9, True), ANY_ANGLE, SEARCH, judged, y)
    assert found == (cost, excess, rough)
    np.testing.assert_array_equal(y, x)


@pytest.mark.parametrize("speed", [0.2, 0.36, 0.8, 1.3])
def test_a_gait_is_kept(planner, speed):
    row = row_at(table(), speed)
    z = row[STATE:CONTROL]
    decision = planner.decide(Context(z, z))
    assert decision.accepted is None
    assert decision.nominal
    np.testing.assert_allclose(decision.predicted, z, atol=2e-3)
    k = row[STIFFNESS]
    np.testing.assert_allclose(decision.controls[SLOTS[1:]], k, rtol=0.02)


@pytest.mark.parametrize("speed", [0.14, 0.2, 0.3, 0.3259, 0.337, 0.338, 0.36, 0.8, 1.3])
def test_a_walk_goes_on_from_where_a_start_leads(planner, speed):
    """The gait of a start is the planner's own at that speed, whichever chain it is of."""
    over = PassTable(P, StandingOptions(), gaits_by_speed(P)).at(speed)
    decision = planner.decide(Context(over.vlo, over.vlo))
    assert decision.nominal
    np.testing.assert_allclose(decision.predicted, over.vlo, atol=2e-3)


@pytest.mark.parametrize("seed", range(5))
def test_a_plan_stays_within_its_bounds(seed):
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0.3, 1.2)
    z = row_at(table(), speed)[STATE:CONTROL] + rng.uniform(-1, 1, 3) * [0.15, 0.006, 0.15]
    cost, _, p, x = plan_from(z, speed)
    if not np.isfinite(cost):
        pytest.skip("no plan from there")
    controls = np.append(x, np.zeros(STATES)).reshape(-1, BLOCK)[:, :CONTROLS]
    low, high = BOUNDS.copy()
    low[0] += p.reference.controls[0, 0]
    high[0] += p.reference.controls[0, 0]
    assert np.all(controls >= low - 1e-12)
    assert np.all(controls <= high + 1e-12)
    assert controls[0, 0] <= np.arcsin(min(z[1], 1.0)) - TOP_MARGIN + 1e-12


def test_a_foot_does_not_land_at_once():
    """Slow and sinking at VLO, the CoM would else be at the height of a landing in 0.05 s."""
    z = row_at(table(), 0.3)[STATE:CONTROL] + [0.1, 0.0, -0.05]
    simulator, node = StrideSimulator(P, AUTOMATON), AUTOMATON.start("wp").name

    def lands(**changes):
        _, _, p, x = plan_from(z, 0.3, **changes)
        stride = simulator.run(node, VLO.state(z), controls_of(p, x))
        return stride.time_of(Event.TOUCHDOWN)

    assert lands(earliest=0.0) < 0.1
    assert lands(earliest=0.12) > 0.11


@pytest.mark.parametrize("lifted", [0.1, 0.2])
def test_a_swing_has_its_time(lifted):
    """As above, of a foot that has lifted off shortly before VLO."""
    z = row_at(table(), 0.3)[STATE:CONTROL] + [0.1, 0.0, -0.05]
    simulator, node = StrideSimulator(P, AUTOMATON), AUTOMATON.start("wp").name

    def swings(shortest):
        """From each liftoff to the touchdown in the next step."""
        p, x = problem_from(z, 0.3, swing=shortest)
        p.lifted[0] = lifted
        look_ahead(p, SEARCH, x)
        before, times = lifted, []
        for i in range(len(p.ends)):
            begins = z if i == 0 else x[BLOCK * i - STATES : BLOCK * i]
            stride = simulator.run(node, VLO.state(begins), controls_of(p, x, i))
            times.append(before + stride.time_of(Event.TOUCHDOWN))
            before = stride.duration - stride.time_of(Event.REAR_LIFTOFF)
        return np.array(times)

    quick, longer = swings(0.0), lifted + 0.2
    assert quick[0] < lifted + 0.1
    assert swings(longer)[0] > longer - 0.01
    assert np.all(swings(0.55)[1:] > 0.54)
    assert np.all(quick[1:] < 0.54)


@pytest.mark.parametrize("speed", [0.3, 0.32])
def test_a_foot_that_was_due_later_has_the_time_for_the_rest_of_its_way(speed):
    """It has lifted off long ago, and swung slowly: it cannot land at once."""
    z = row_at(table(), speed)[STATE:CONTROL] + [0.02, 0.0, -0.05]
    simulator, node = StrideSimulator(P, AUTOMATON), AUTOMATON.start("wp").name
    speeds, swing = (0.25, 1.4), 0.25

    def lands(due):
        planner = AheadPlanner(P, limits=WalkLimits(KNEES, speeds, swing))
        context = Context(z, np.array([speed, 0.0, 0.0]), lifted=0.25, due=due)
        stride = simulator.run(node, VLO.state(z), planner.decide(context).controls)
        return stride.time_of(Event.TOUCHDOWN)

    assert lands(np.inf) < 0.1
    assert lands(0.0) == lands(-0.1) == lands(np.inf)
    assert lands(0.2) > swing * 0.2 / (0.25 + 0.2) - 0.01


def test_a_search_that_is_hopeless_ends():
    z = row_at(table(), 0.9)[STATE:CONTROL] + [0.0, 0.0, 0.1]
    ends = [
        plan_from(z, 0.9, search=search)[0]
        for search in (SEARCH._replace(rounds=2), SEARCH._replace(hopeless=0.0), SEARCH)
    ]
    assert ends[0] == ends[1] > ends[2]
    assert plan_from(z, 0.9, search=SEARCH._replace(hopeless=1.01 * ends[0]))[0] == ends[2]


def test_the_first_angle_is_one_that_the_foot_can_reach(planner):
    z = row_at(table(), 0.9)[STATE:CONTROL]
    free = planner.decide(Context(z, z + [0.1, 0.0, 0.0]))
    angle = free.controls[0] + 0.01
    held = planner.decide(Context(z, z + [0.1, 0.0, 0.0], (angle, angle + 1e-9)))
    assert held.controls[0] == pytest.approx(angle, abs=1e-8)


def test_dy_dt_costs_above_its_bound():
    z = row_at(table(), 0.9)[STATE:CONTROL] + [0.0, 0.0, 0.1]
    begun, *_ = plan_from(z, 0.9, search=Search(rounds=1, grid=0))
    calm, _, p, _ = plan_from(z, 0.9)
    assert calm <= begun
    assert np.abs(p.ends[:, 2]).max() < sum(RISE)


@pytest.mark.parametrize("faster", [0.15, -0.15])
def test_a_plan_keeps_to_what_the_knees_bear(faster):
    z = row_at(table(), 0.8)[STATE:CONTROL]

    def largest(limit):
        _, _, p, x = plan_from(z, 0.8 + faster, knee_moment=limit)
        return max(knee_moment(p, x, i, leg)[0] for i in range(3) for leg in range(5))

    free = largest(np.inf)
    limit = 0.9 * free
    assert largest(limit) - limit < 0.6 * (free - limit)  # the limit is soft


def test_the_knees_bear_the_leg_force_at_vlo_too():
    """Legs 3 and 4 are the stance legs before and after; the arm is that of equal links."""
    z = row_at(table(), 0.8)[STATE:CONTROL] - [0.0, 0.03, 0.0]
    _, _, p, x = plan_from(z, 0.8)
    k, (_, front, _, _) = p.reference.stiffness[0], x[:CONTROLS]
    arm = 0.5 * np.sqrt(p.costs.knee_reach**2 - z[1] ** 2)
    force = front * k * (P.rest_length - z[1])
    moment, by_length, _ = knee_moment(p, x, 0, 3)
    assert moment == pytest.approx(force * arm)
    p.lengths[0, 3] += 1e-6
    assert knee_moment(p, x, 0, 3)[0] - moment == pytest.approx(1e-6 * by_length, rel=1e-4)
    assert p.lengths[0, 4] == pytest.approx(p.ends[0, 1])


def test_what_cannot_be_done_is_apart_from_what_is_dear():
    """A change of all controls costs, and exceeds nothing."""
    z = row_at(table(), 0.8)[STATE:CONTROL]
    cost, excess, *_ = plan_from(z, 0.9)
    assert excess < 0.5 * cost
    assert plan_from(z, 0.9, knee_moment=0.3 * KNEES)[1] > OPTIONS.cheap


@pytest.fixture(scope="module")
def governed():
    """Without a table of changes: a large change of the speed is reduced."""
    return AheadPlanner(P, AheadOptions(changes=0))


def test_a_small_change_is_taken_and_a_large_one_reduced(governed):
    z = row_at(table(), 0.9)[STATE:CONTROL]
    taken = governed.decide(Context(z, z + [0.05, 0.0, 0.0]))
    assert taken.accepted is None
    reduced = governed.decide(Context(z, z + [0.5, 0.0, 0.0]))
    assert 0.9 < reduced.accepted <= 0.9 + OPTIONS.pace
    assert 0.9 < reduced.predicted[0] < reduced.accepted
    assert governed.gait.vlo[0] == pytest.approx(reduced.accepted)


@pytest.mark.parametrize("wanted", [0.22, 0.5, 1.37])
def test_slower_and_faster_gaits_than_the_table_s_are_reached(planner, wanted):
    step, z = ReturnMap(P, "wp"), row_at(table(), 0.9)[STATE:CONTROL]
    for _ in range(12):
        z, _ = step.step(z, planner.decide(Context(z, np.array([wanted, 0.0, 0.0]))).controls)
    assert planner.gait.vlo[0] == pytest.approx(wanted)
    assert np.all(np.abs(z - planner.gait.vlo) < [0.02, 0.003, 0.02])


@pytest.mark.parametrize(("speed", "wanted"), [(0.35, 1.25), (1.25, 0.35), (0.7, 1.1)])
def test_any_speed_is_reached_in_a_few_steps(planner, speed, wanted):
    step, z = ReturnMap(P, "wp"), row_at(table(), speed)[STATE:CONTROL]
    for _ in range(8):
        decision = planner.decide(Context(z, np.array([wanted, 0.0, 0.0])))
        assert decision.nominal
        assert planner.gait.vlo[0] == pytest.approx(wanted)
        z, _ = step.step(z, decision.controls)
        np.testing.assert_allclose(z, decision.predicted, atol=1e-9)
        assert decision.accepted in (None, z[0])
    assert decision.accepted is None
    assert np.all(np.abs(z - planner.gait.vlo) < [0.02, 0.003, 0.02])


def test_a_robot_s_limits_count():
    """Of its knees, and of its range: the nearest speed in it is aimed at."""
    z = row_at(table(), 0.8)[STATE:CONTROL]
    held = AheadPlanner(P, limits=WalkLimits(KNEES, (0.6, 0.9), 0.155))
    for wanted, aim in [(0.3, 0.6), (1.2, 0.9), (0.7, 0.7)]:
        held.decide(Context(z, np.array([wanted, 0.0, 0.0])))
        assert held.gait.vlo[0] == pytest.approx(aim)
    robots = {name: walk_limits(tc.load_robot(name)) for name in ("five-link", "human", "rabbit")}
    assert robots["five-link"].knee_moment == pytest.approx(KNEES)
    limit = tc.load_robot("human").torque_limit[1]
    assert 0.9 * limit < robots["human"].knee_moment < limit
    template = tc.template_for(tc.load_robot("rabbit"))
    slowest, fastest = walking_by_speed().range(template)
    assert slowest < robots["rabbit"].speeds[0] < robots["rabbit"].speeds[1] < fastest


@pytest.mark.parametrize("cause", [Cause.TOUCHDOWN, Cause.DEVIATION])
def test_a_step_goes_on_to_where_it_went(governed, cause):
    z = row_at(table(), 0.9)[STATE:CONTROL]
    wanted, seems = z - [0.5, 0.0, 0.0], z + [0.04, 0.0, 0.0]
    began = governed.decide(Context(z, wanted))
    governed.decide(Context(began.predicted, wanted, cause=Cause.FUTURE))
    goes_on = governed.decide(Context(seems, wanted, cause=cause, decision=began))
    assert goes_on.accepted == began.accepted
    assert governed.decide(Context(seems, wanted)).accepted > began.accepted


def test_a_decision_has_an_end(monkeypatch):
    """Few linearisations, also where no change of the table leads on."""
    planner, counts = AheadPlanner(P, AheadOptions(steps=4)), []
    look = planner._look

    def counted(*question):
        plan = look(*question)
        counts[-1].append((question[2] is not None, plan.effort))
        return plan

    monkeypatch.setattr(planner, "_look", counted)
    rng = np.random.default_rng(0)
    for _ in range(60):
        z = row_at(table(), rng.uniform(0.5, 1.2))[STATE:CONTROL]
        target = z + [rng.choice([-0.3, 0.3]), 0.0, 0.0]
        counts.append([])
        planner.decide(Context(z + rng.uniform(-1, 1, 3) * [0.02, 0.001, 0.02], target))
    near = [[count for changes, count in tried if changes] for tried in counts]
    assert max(len(tried) for tried in near) > 1
    assert max(sum(tried[:-1]) for tried in near) < 16
    assert max(count for tried in counts for _, count in tried) <= SEARCH.rounds + 1


@pytest.mark.parametrize(("wanted", "end"), [(0.02, 0), (3.0, 1)])
def test_beyond_the_family_its_end_is_accepted(planner, wanted, end):
    there = planner.speeds[end]
    z = row_at(table(), there)[STATE:CONTROL]
    decision = planner.decide(Context(z, np.array([wanted, z[1], 0.0])))
    assert decision.accepted == pytest.approx(there)


@pytest.mark.slow(seconds=2)
@pytest.mark.parametrize("first", [None, 0.15])
def test_a_plan_that_is_not_cheap_gives_way_to_a_search(first):
    """It leads to a gait near the present speed, however slow the first gait was."""
    hasty = AheadPlanner(P, AheadOptions(cheap=1e-9), first)
    z = row_at(table(), 0.9)[STATE:CONTROL] + [0.1, 0.0, 0.0]
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
    *before, line = capsys.readouterr().err.splitlines()
    assert "segment 1 wants" in line
    assert set(before) <= {ANNOUNCEMENT}
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
