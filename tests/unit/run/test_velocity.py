"""Velocity commands of a floating base: profiles by time, and commands that change."""

import numpy as np
import pytest

import template_control as tc
from template_control.cli.experiment_options import experiment_from
from template_control.embedding.planners.ahead import BIPED_AHEAD, FREE_AHEAD
from template_control.errors import ParameterError
from template_control.run.options import HeadingCommand
from template_control.run.velocity import VelocityRange, course_at, velocity_route
from template_control.slip.maps.section import APEX, VLO
from template_control.slip.similarity import Scale, scaled

ROWS = ((0.0, 0.5, 0.0, 0.0), (2.0, 0.6, 0.05, 0.2))
PROFILE = tc.run.VelocityProfile(ROWS, duration=5.0)


def test_a_velocity_holds_until_the_next():
    assert [PROFILE.at(t) for t in (0.0, 1.9, 2.0, 9.0)] == [ROWS[0][1:]] * 2 + [ROWS[1][1:]] * 2


@pytest.mark.parametrize("times", [(), (1.0,), (0.0, 2.0, 2.0), (0.0, 3.0, 1.0)])
def test_times_rise_from_zero(times):
    with pytest.raises(ParameterError, match="give rising ones, the first 0"):
        tc.run.VelocityProfile(tuple((t, 0.5, 0.0, 0.0) for t in times), duration=5.0)


def test_a_command_stays_as_it_was_where_it_is_set_to_none():
    command = tc.run.VelocityCommand(0.5)
    command.set(0.6, 0.1, -0.2)
    for wrong in ((-30.0, 0.0, 0.0), (0.5, np.nan, 0.0), (0.5, 0.0, 7.0)):
        with pytest.raises(ParameterError, match="commanded"):
            command.set(*wrong)
    assert command.at(3.0) == (0.6, 0.1, -0.2)


def test_a_profile_is_in_the_experiments_file(tmp_path):
    experiment = tc.Experiment("bolt", motion=PROFILE).with_({"robot.free": True})
    path = experiment.save(tmp_path / "run.toml")
    assert 'kind = "velocity"' in path.read_text()
    prepared = tc.Experiment.load(path).prepare()
    assert prepared.velocity == PROFILE
    assert prepared.heading(3.0)[:2] == (0.05, 0.2)
    goal = prepared.motion.next(prepared.motion.section, prepared.motion.start, 3.0)
    assert goal.wanted_speed == 0.6


def test_the_command_line_says_velocities(understood):
    rows = "[[0, 0.5, 0, 0], [2, 0.6, 0.05, 0.2]]"
    words = f"--motion.kind velocity --motion.velocities '{rows}' --motion.duration 5"
    line = understood(f"template-control walk --robot bolt --floating-base {words}")
    assert experiment_from(line, tc.Experiment()).motion == PROFILE


def test_what_does_not_go_with_velocities_is_refused():
    for motion in (PROFILE, tc.run.VelocityCommand(0.5, 0.1)):
        with pytest.raises(ParameterError, match="is held in its plane"):
            tc.Experiment("five-link", motion=motion).prepare()
    bolt = tc.load_floating_robot("bolt")
    for course in (HeadingCommand(turning_rate=0.1), HeadingCommand(side_speed=0.1)):
        with pytest.raises(ParameterError, match="a course does not go with velocities"):
            tc.Experiment(bolt, motion=PROFILE, course=course).prepare()


def test_a_robot_is_commanded_what_it_can():
    five_link = tc.load_robot("five-link")
    planar = VelocityRange.of(five_link)
    low, high = tc.walking_speeds(five_link)
    assert low <= planar.speeds[0] <= planar.first <= planar.speeds[1] <= high
    assert (planar.left, planar.turning) == (0.0, 0.0)
    free = VelocityRange.of(tc.load_floating_robot("bolt"))
    assert (free.left, free.turning) == (0.06, 0.52)
    slow = tc.run.VelocityProfile(((0.0, 0.3, 0.0, 0.0),), 1.0)
    route = velocity_route(tc.load_floating_robot("bolt"), slow, HeadingCommand())[1]
    assert free.speeds[0] == pytest.approx(route.next(VLO, route.start, 0.0).wanted_speed, abs=0.01)
    assert (planar.gaits, planar.run) == (("stand", "walk", "run"), 3.01)
    assert (free.gaits, free.run) == (("walk", "run"), 1.8)
    assert (planar.backward, free.backward) == (0.6, 0.36)
    assert VelocityRange.of(tc.load_robot("rabbit")).gaits == ("stand", "walk")


def test_a_robot_on_two_points_hops_below_its_slowest_walk():
    bolt = tc.load_floating_robot("bolt")
    for forward in (-0.3, 0.0, 0.2):
        command = tc.run.VelocityCommand(forward, 0.02, 0.1, gaits=("walk", "run"))
        route = velocity_route(bolt, command, HeadingCommand())[1]
        z = np.array([forward, 0.36])
        goal = route.next(APEX, z, 0.0)
        assert goal.stride == "hr"
        assert course_at(command, 0.0, bolt)[:2] == (0.02, 0.1)
        assert not course_at(command, 0.0, bolt).turns_round(bolt)


@pytest.mark.parametrize(
    ("wanted", "goes"), [((0.4, 0.0), 0.4), ((0.2, 0.1), 0.35), ((0.1, -0.1), 0.0)]
)
def test_a_quadruped_goes_no_slower_than_its_slowest_walk(wanted, goes):
    go2 = tc.load_floating_robot("go2")
    command = tc.run.VelocityCommand(*wanted, gaits=("stand", "walk"))
    route = velocity_route(go2, command, HeadingCommand())[1]
    assert route.next(VLO, route.start, 0.0).wanted_speed == pytest.approx(goes, abs=0.01)


@pytest.mark.slow(seconds=4)
def test_five_link_3d_follows_its_velocities():
    velocities = ((0.0, 0.9, 0.0, 0.0), (3.0, 1.1, 0.1, 0.2), (10.0, 0.9, -0.1, -0.2))
    robot = tc.load_floating_robot("five-link-3d")
    record = tc.simulate(tc.Experiment(robot, motion=tc.run.VelocityProfile(velocities, 20.0)))
    assert not record.fell, record.fall_reason
    for begin, end, wanted in ((6.0, 10.0, velocities[1][1:]), (15.0, 20.0, velocities[2][1:])):
        # Whole pairs of steps, in which sway and yaw come back.
        at = np.flatnonzero((record.section_time > begin) & (record.section_time < end))
        at = at[: len(at) - (len(at) - 1) % 2]
        first, last = np.searchsorted(record.time, record.section_time[at[[0, -1]]])
        heading = record.heading[first:last, None]
        moved = np.diff(record.space_com[first : last + 1, :2], axis=0)
        ahead = np.hstack((np.cos(heading), np.sin(heading)))
        left = np.hstack((-np.sin(heading), np.cos(heading)))
        turned = record.heading[last] - record.heading[first]
        found = np.array([np.sum(moved * ahead), np.sum(moved * left), turned])
        found /= record.time[last] - record.time[first]
        np.testing.assert_allclose(found, wanted, atol=0.03)


@pytest.mark.slow(seconds=3)
def test_a_walk_moves_to_the_side():
    robot = tc.load_floating_robot("bolt")
    course = HeadingCommand(side_speed=0.05)
    record = tc.simulate(tc.Experiment(robot, steps=16, course=course))
    assert not record.fell, record.fall_reason
    assert record.space_com[-1, 1] == pytest.approx(0.05 * record.time[-1], abs=0.05)


@pytest.mark.parametrize(("robot", "tuning"), [("g1", BIPED_AHEAD), ("go2", FREE_AHEAD)])
def test_robots_that_bear_a_moment_start_to_a_walk_of_any_speed(robot, tuning):
    """In steps with push-off, as by a velocity; slower too than any gait without."""
    spec = tc.robot.RobotSpec(robot, free=True)
    slow = tc.run.GaitSpec(speed=0.4, from_stand=True, to_stand=True)
    prepared = tc.Experiment(spec, motion=slow, steps=3).prepare()
    kinds = [segment.gait for segment in prepared.motion.scenario.segments]
    assert (kinds, prepared.motion.walks) == (["stand", "walk", "stand"], "wp")
    assert prepared.planner["wp"].options == scaled(tuning, Scale.of(prepared.motion.parameters))


def test_the_planner_of_a_robots_own_walk_looks_ahead_on_soles():
    """A walk of another touchdown angle is that of its own gait."""

    def planner(robot, **gait):
        spec = tc.robot.RobotSpec(robot, free=True)
        return tc.Experiment(spec, motion=tc.run.GaitSpec(speed=0.6, **gait)).resolved().planner

    assert planner("g1") == BIPED_AHEAD
    assert planner("g1", touchdown_angle=70.0).kind == planner("bolt").kind == "lqr"


def test_a_planner_that_is_named_has_the_tuning_of_the_robots_kind(understood):
    line = understood("template-control walk --robot g1 --floating-base --planner ahead")
    assert experiment_from(line, tc.Experiment()).planner == BIPED_AHEAD
