"""A run that goes on is pushed and commanded by hand, and repeated bit by bit."""

from threading import Thread

import numpy as np
import pytest

import template_control as tc
from template_control.errors import ParameterError
from template_control.robot.spec import RobotSpec
from template_control.run.hand import Hand
from template_control.run.live import LiveRun

DT = 1e-3
PLANTS = {"pybullet": tc.PlantOptions(), "mujoco": tc.MujocoOptions()}


def by_hand(experiment, deeds, ticks, keep=None):
    """Record of a run with something done at some ticks, and the experiment that repeats it."""
    with LiveRun(experiment, keep=keep) as run:
        for tick in run:
            if tick.number in deeds:
                # The page's buttons are in another thread than the loop.
                thread = Thread(target=deeds[tick.number], args=(run.hand,))
                thread.start()
                thread.join()
            if tick.number == ticks:
                break
        return run.record(), run.experiment(), run.recorder


def repeats(record, experiment, tmp_path):
    """The experiment, written and read, gives the record's bits."""
    again = tc.simulate(tc.Experiment.load(experiment.save(tmp_path / "run.toml")))
    assert not again.fell
    first = np.searchsorted(again.time, record.time[0])
    for name in ("time", "q", "v", "torque", "push", "contact_force"):
        values = getattr(record, name)
        np.testing.assert_array_equal(getattr(again, name)[first : first + len(values)], values)


@pytest.mark.slow(seconds=1)
@pytest.mark.parametrize("plant", PLANTS)
def test_what_is_done_by_hand_is_repeated_to_the_last_bit(plant, tmp_path):
    experiment = tc.Experiment("five-link", tc.run.VelocityCommand(0.6), world=PLANTS[plant])
    deeds = {
        300: lambda hand: hand.push(8.0),
        500: lambda hand: hand.set_velocity(0.8),
        700: lambda hand: hand.set_friction(0.5),
        1200: lambda hand: hand.set_friction(0.6),
    }
    record, again, _ = by_hand(experiment, deeds, ticks=1600)
    assert again.pushes == (tc.Push(8.0, time=301 * DT),)
    assert again.frictions == ((701 * DT, 0.5), (1201 * DT, 0.6))
    assert again.motion.velocities == ((0.0, 0.6, 0.0, 0.0), (501 * DT, 0.8, 0.0, 0.0))
    pushed = record.time[record.push > 0.0]
    assert (pushed[0], len(pushed)) == (pytest.approx(0.301), 100)
    assert record.section_target[-1, 0] > record.section_target[0, 0]
    repeats(record, again, tmp_path)


@pytest.mark.slow(seconds=2)
def test_a_robot_stands_and_walks_again(tmp_path):
    command = tc.run.VelocityCommand(0.8, gaits=("stand", "walk"))
    deeds = {
        500: lambda hand: hand.set_velocity(0.0),
        8000: lambda hand: hand.set_velocity(0.6),
    }
    record, again, _ = by_hand(tc.Experiment("five-link", command), deeds, ticks=10500)
    assert not record.fell
    stands = (record.time > 7.0) & (record.time < 8.0)
    assert np.abs(record.com_velocity[stands, 0]).max() < 0.02
    assert record.com_velocity[-1000:, 0].mean() > 0.3
    repeats(record, again, tmp_path)


@pytest.mark.slow(seconds=4)
def test_a_floating_base_is_driven_too(tmp_path):
    robot = RobotSpec("five-link-3d", free=True)
    deeds = {
        400: lambda hand: hand.push(4.0, 0.2, direction=1.5),
        600: lambda hand: hand.set_velocity(0.9, 0.05, 0.2),
    }
    experiment = tc.Experiment(robot, tc.run.VelocityCommand(0.8))
    record, again, _ = by_hand(experiment, deeds, ticks=2500)
    assert record.heading[-1] > 0.1
    repeats(record, again, tmp_path)


def test_friction_changes_while_a_run_goes_on():
    """On ice the push of a stance foot is cut, and the walk ends."""
    for world in PLANTS.values():
        experiment = tc.Experiment(steps=4, world=world, frictions=((0.5, 0.02),))
        record = tc.simulate(experiment)
        assert record.fell
        assert record.time[-1] > 0.5
        vertical, along = record.contact_force[..., 1], np.abs(record.contact_force[..., 0])
        slides = (record.time[:, None] > 0.55) & (vertical > 50.0)
        assert np.all(along[slides] < 0.021 * vertical[slides])
        assert np.any(along[~slides] > 0.05 * vertical[~slides])


@pytest.mark.slow(seconds=1)
def test_only_the_end_is_kept_of_a_long_run():
    command = tc.run.VelocityCommand(0.6)
    record, _, recorder = by_hand(tc.Experiment("five-link", command), {}, 3999, keep=1.0)
    assert len(record.time) == record.metadata["ticks"] == 4000 - 2 * 1024
    assert record.time[0] == pytest.approx(2.048)
    assert record.duration == pytest.approx(4.0 - 2.048)
    assert record.section_time[0] >= record.time[0]
    whole, _, _ = by_hand(tc.Experiment("five-link", command), {}, 3999)
    np.testing.assert_array_equal(record.q, whole.q[2048:])
    latest = recorder.latest(5)["q"]
    np.testing.assert_array_equal(latest, whole.q[-5:])


def test_a_run_without_an_end_goes_on_and_gives_its_parts_back():
    robot = tc.load_robot("five-link")
    experiment = tc.Experiment(robot)
    with LiveRun(experiment) as run:
        assert next(run).number == 0
        with pytest.raises(ParameterError, match="in use by another run"):
            LiveRun(experiment)
        steps = [tick.steps for tick, _ in zip(run, range(700), strict=False)]
        assert steps[-1] == 1
    assert run.ended
    assert list(run) == []
    assert tc.simulate(run.experiment()).steps == 2


def test_a_fall_ends_a_live_run_and_says_why():
    world = tc.PlantOptions(friction=0.02)
    with LiveRun(tc.Experiment(world=world)) as run:
        assert sum(1 for _ in run) > 100
    assert run.ended
    assert "in step" in run.reason
    assert run.record().fell


@pytest.mark.parametrize(
    ("deed", "why"),
    [
        (lambda hand: hand.push(5.0, direction=1.0), "push it forward or backward"),
        (lambda hand: hand.push(5.0, -1.0), "duration"),
        (lambda hand: hand.set_friction(0.0), "the friction"),
        (lambda hand: hand.set_velocity(0.5, 0.1), "command it only forward"),
        (lambda hand: hand.set_velocity(-1.0), "five-link stands before it goes backward"),
        (lambda hand: hand.set_velocity(100.0), "the commanded forward speed"),
    ],
)
def test_what_cannot_be_done_by_hand_is_refused(deed, why):
    with LiveRun(tc.Experiment("five-link", tc.run.VelocityCommand(0.6))) as run:
        with pytest.raises(ParameterError, match=why):
            deed(run.hand)
        assert next(run).push == (0.0, 0.0)


def test_a_run_that_is_not_commanded_takes_no_velocity_and_rigid_ground_no_friction():
    with LiveRun(tc.Experiment(world=tc.IdealOptions())) as run:
        with pytest.raises(ParameterError, match="give its experiment a VelocityCommand"):
            run.hand.set_velocity(0.7)
        with pytest.raises(ParameterError, match="IdealPlant cannot change its friction"):
            run.hand.set_friction(0.5)
    with pytest.raises(ParameterError, match="IdealPlant cannot change its friction"):
        tc.simulate(tc.Experiment(world=tc.IdealOptions(), frictions=((0.5, 0.4),)))
    with pytest.raises(ParameterError, match="give rising ones"):
        tc.Experiment(frictions=((1.0, 0.5), (0.5, 0.4)))


def test_pushes_of_both_kinds_come_in_time():
    pushes = (tc.Push(10.0, step=1), tc.Push(-4.0, time=0.2, duration=0.05))
    prepared = tc.Experiment(steps=3, pushes=pushes).prepare()
    hand, begun = Hand(prepared, None), [(0.0, 0.5)]
    assert hand.force(0.199, begun) == (0.0, 0.0)
    assert hand.force(0.2, begun) == (pytest.approx(-80.0), 0.0)
    assert hand.force(0.25, begun) == (0.0, 0.0)
    begun.append((0.6, 0.5))
    assert hand.force(0.65, begun) == (pytest.approx(100.0), 0.0)
    assert hand.force(0.71, begun) == (0.0, 0.0)
