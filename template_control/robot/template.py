"""The template of a robot, and what of it the robot can follow: gaits, speeds and apexes.

What is found of a robot overwrites the last update of its model.
"""

from __future__ import annotations

from math import radians

import numpy as np

from template_control.checks.checked import checked
from template_control.checks.fitting import inward
from template_control.checks.ranges import Angle, Positive
from template_control.errors import GaitError
from template_control.robot.biped import Biped
from template_control.robot.terms import UP
from template_control.slip.automaton.vocabulary import Event, Slot
from template_control.slip.gaits.family_search import stance_figures
from template_control.slip.gaits.gait import (
    WalkingGait,
    gait_at,
    gait_from_energy,
    gait_stride,
    with_push_off,
)
from template_control.slip.gaits.running_gait import running_gait, suited_height
from template_control.slip.gaits.walking_by_speed import (
    gait_for_speed,
    gaits_by_speed,
    walking_by_speed,
)
from template_control.slip.maps.return_map import REAR_BOTTOM, ReturnMap
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.plan_costs import WalkLimits, usual_knee_moment
from template_control.slip.similarity import REFERENCE, Scale

_TOUCHDOWN = float(np.radians(66.0))
_WALK = (_TOUCHDOWN, 1.1 / float(np.sqrt(REFERENCE.gravity * REFERENCE.rest_length)))
# On flat feet: 0.6 m/s in the mean for G1; at 1.1 m/s for l0 = 1 m it falls in step 5.
_SOLE_WALK = float(np.radians(71.0)), 0.197
# Of the straight leg at touchdown, as five-link with l0 = 1 m; the test
# test_the_reference_template_is_five_link_s holds it.
_STRETCH = 0.903514524055713
# Of legs that end in an ankle: more bent, the rear one comes to the ankle's stop late in double
# stance, as its sole is level.
_SOLE_STRETCH = 0.95
_KNEES = 0.66  # of that torque: leaning forward moves the rest to the hips, in all robots that ran
_BEARABLE = 1.25  # of the limit: with 1.28 the apex was reached, with 1.29 it stayed 12 mm too low
_SHORTEST = 0.8  # of l0, at the bottom: shorter, and the knees come to their stops
_RUN = 0.64  # speed of a moderate run over sqrt(g l0): 2 m/s for l0 = 1 m
_HEAVY = 0.6  # of the mass: rabbit, whose legs have 62 %, runs 14 steps; go2 has 55 %
_HEIGHTS = np.linspace(0.9, 1.3, 161)  # over l0, that are tried
_WALKED = (0.0957, 0.463)  # over sqrt(g l0): 0.30 and 1.45 m/s; bolt fell with 0.08 and 0.48
_SWING_TORQUE = 0.5  # of a hip's limit: rabbit walked with 0.49, and 0.06 m/s too slow with 0.55
# On soles: TALOS kept 0.90 m/s with 0.547 of its hips; G1 0.9 m/s, 0.352, and fell at 0.376.
_SOLES_WALKED, _SOLES_SWING_TORQUE = (_WALKED[0], 0.36), 0.55
_STANCE_TORQUE = 0.73  # of a knee's limit: human walked with 0.72, and fell with 0.79
_BORNE = 0.92  # of a knee's limit: it needs 1.05 of the template leg's moment at most
_UNEVEN = 0.42  # of the speed at VLO: rabbit walked with 0.41, and fell with 0.46
# Slopes that a walk of 30 steps from a stand climbed and descended [rad]: uphill by what the swing
# of the legs makes of the speed at VLO, as a share of it (bolt, human, rabbit), downhill by the
# inertia about the CoM over m l0^2 (five-link, bolt, rabbit). five-link fell at 5 degrees, human at
# 4 and -6, bolt at -5, rabbit at 1 and -1.
_CLIMBED = (0.105, 0.165, 0.39), (radians(4.1), radians(3.3), 0.0)
_DESCENDED = (0.12, 0.197, 0.43), (radians(6.9), radians(4.5), 0.0)
_EVERY = 3  # link of the family's chains is looked at
_ROUNDING = 1e-6  # of a centimetre per second
# Of the quintic that a foot follows, over its length and duration.
_QUINTIC_SPEED, _QUINTIC_ACCELERATION = 1.875, 10.0 / float(np.sqrt(3.0))


@checked
def default_gait(robot: Biped, touchdown_angle: Angle | None = None) -> WalkingGait:
    """The robot's walk: its own if it has one, else 66 degrees and 1.1 m/s for l0 = 1 m.

    On flat feet it is 71 degrees and 0.62 m/s, which G1 and TALOS keep.

    Its steps have push-off, with which a planner can cancel every error that the robot adds.

    Args:
        robot: its last update is overwritten.
        touchdown_angle: another one than the walk's, at the same speed at VLO [rad].

    Raises:
        GaitError: if there is no gait with that angle.
    """
    parameters = template_for(robot)
    angle, speed = robot.walk or (_SOLE_WALK if robot.patches else _WALK)
    angle = angle if touchdown_angle is None else touchdown_angle
    return with_push_off(gait_at(parameters, angle, float(speed * parameters.speed_unit)))


@checked
def paper_gait(parameters: SlipParameters) -> WalkingGait:
    """The equilibrium of Section IV-D: 0.9818 m and 826 J for 80 kg and l0 = 1 m."""
    scale = Scale.of(parameters)
    energy = parameters.mass / REFERENCE.mass * scale.speed**2
    return gait_from_energy(parameters, 0.9818 * scale.length, 826.0 * energy)


@checked
def template_for(robot: Biped) -> SlipParameters:
    """The reference template scaled to a robot's mass and legs by dynamic similarity.

    l0 is such that the leg is stretched as far at the default gait's touchdown as the
    five-link robot's, whose CoM is 1 m from its foot then; the stiffness keeps k l0 / (m g). With
    flat feet the leg is that from hip to ankle, and stretched a little further.

    Args:
        robot: its last update is overwritten.
    """
    above_hip = _above_hips(robot)
    stretch = _SOLE_STRETCH if robot.patches else _STRETCH
    reach = stretch * (robot.leg_length + robot.foot_radius)
    sine, cosine = float(np.sin(_TOUCHDOWN)), float(np.cos(_TOUCHDOWN))
    length = above_hip * sine + float(np.sqrt(reach**2 - (above_hip * cosine) ** 2))
    weight = robot.mass * robot.gravity
    relative = REFERENCE.leg_stiffness * REFERENCE.rest_length
    relative /= REFERENCE.mass * REFERENCE.gravity
    return SlipParameters(robot.mass, robot.gravity, length, relative * weight / length)


def _above_hips(robot: Biped) -> float:
    """Height of the CoM over the hips, and of the ankles over ground, with straight legs [m]."""
    q = robot.neutral()
    robot.update(q, np.zeros(robot.nv))
    return float(robot.com[1] - robot.hip_height(q)) + robot.ankle_height


@checked
def walking_speeds(robot: Biped, torque_scale: Positive = 1.0) -> tuple[float, float]:
    """Slowest and fastest mean speed that a robot walks at [m/s], to a centimetre per second.

    They are those at which a robot with light legs and strong motors walked, without the fast ones
    whose swing takes most of a hip's torque or whose stance most of a knee's, and without the slow
    ones in which the swing of heavy
    legs makes the CoM's speed uneven: the template's legs weigh nothing. The slowest is as far
    above these as that speed varies.

    Args:
        robot: its last update is overwritten.
        torque_scale: share of the URDF's torque limits that may be used.

    Raises:
        GaitError: if no gait of the template is left.
    """
    p = template_for(robot)
    family = walking_by_speed()
    unit = p.speed_unit
    slowest, fastest = (unit * v for v in (_SOLES_WALKED if robot.patches else _WALKED))
    most = _SOLES_SWING_TORQUE if robot.patches else _SWING_TORQUE
    swings = []
    for chain in family.chains:
        for speed in chain.vlo_speed[::_EVERY]:
            gait = chain.gait(p, unit * float(speed))
            uneven, hip = _swing(robot, gait)
            share = max(hip / most, _stance(robot, gait) / _STANCE_TORQUE)
            swings.append((gait.mean_speed, gait.vlo[0], uneven, share))
    mean, vlo, uneven, share = np.array(swings).T
    # A sole bears what the swing of heavy legs adds.
    heavy = (uneven > _UNEVEN * vlo) & (not robot.patches)
    low = float(np.max((mean + uneven)[heavy], initial=slowest))
    hasty = np.flatnonzero(share > torque_scale)
    if len(hasty) and hasty[0] > 0:
        pair = slice(hasty[0] - 1, hasty[0] + 1)
        last = float(np.interp(torque_scale, share[pair], mean[pair]))
        fastest = min(fastest, last)
    if low >= fastest or (len(hasty) and hasty[0] == 0):
        raise GaitError(
            f"{robot.name} walks at no speed: its legs are too heavy or its motors too weak"
        )
    low, high = 100.0 * low - _ROUNDING, 100.0 * fastest + _ROUNDING
    return float(np.ceil(low)) / 100.0, float(np.floor(high)) / 100.0


@checked
def robot_gait_for_speed(
    robot: Biped, mean_speed: float, torque_scale: Positive = 1.0
) -> WalkingGait:
    """The gait of the family by speed with which a robot walks at a mean speed.

    Args:
        robot: its last update is overwritten.
        mean_speed: step length over step duration [m/s].
        torque_scale: share of the URDF's torque limits that may be used.

    Raises:
        GaitError: naming the robot's range, if the speed is out of it.
    """
    slowest, fastest = walking_speeds(robot, torque_scale)
    if not slowest <= round(mean_speed, 9) <= fastest:
        raise GaitError(
            f"{robot.name} does not walk at a mean speed of {mean_speed:g} m/s: give one from"
            f" {slowest:.2f} to {fastest:.2f} m/s"
        )
    return gait_for_speed(template_for(robot), mean_speed)


def startable_slopes(robot: Biped) -> tuple[float, float]:
    """Steepest ground, downhill and uphill, on which a robot sets off from a stand [rad].

    The template's legs weigh nothing, and its body does not turn: the heavier a robot's legs and
    the larger its inertia, the gentler the slope.
    """
    gait = default_gait(robot)
    p = gait.parameters
    uneven, _ = _swing(robot, gait)
    pitch = robot.base_dof - 1
    inertia = abs(float(robot.angular_momentum_jacobian[pitch]))
    descended = np.interp(inertia / (p.mass * p.rest_length**2), *_DESCENDED)
    return -float(descended), float(np.interp(uneven / gait.vlo[0], *_CLIMBED))


def _swing(robot: Biped, gait: WalkingGait) -> tuple[float, float]:
    """Largest difference that the swing makes between the speeds of CoM and template [m/s].

    And the largest hip torque over its limit, estimated with a straight leg that follows the
    quintic. The robot was last updated with straight legs, as :func:`template_for` leaves it.
    """
    p = gait.parameters
    stride = gait_stride(gait)
    double = stride.time_of(Event.REAR_LIFTOFF) - stride.time_of(Event.TOUCHDOWN)
    time = gait.step_duration - double
    # The foot goes two steps while the hips move on.
    angle = (2.0 * gait.step_length - gait.mean_speed * time) / robot.leg_length
    joint = robot.hinges[0][0]
    hip = robot.base_dof + joint
    momentum = abs(float(robot.angular_momentum_jacobian[hip])) * _QUINTIC_SPEED * angle / time
    torque = float(robot.mass_matrix[hip, hip]) * _QUINTIC_ACCELERATION * angle / time**2
    momentum *= len(robot.groups[0])  # legs swing together
    return float(momentum / (p.mass * gait.vlo[1])), float(torque / robot.torque_limit[joint])


def _stance(robot: Biped, gait: WalkingGait) -> float:
    """The largest knee torque over its limit, of a leg without mass that pushes as the spring."""
    p = gait.parameters
    torque = stance_figures(gait)[0] * p.mass * p.gravity * p.rest_length / len(robot.groups[0])
    return torque / min(float(robot.torque_limit[leg[1]]) for leg in robot.hinges)


def walk_limits(robot: Biped) -> WalkLimits:
    """Limits of the walks that are planned several steps ahead for a robot.

    The knees bear a share of their torque limit, and at most what five-link's do for its weight. A
    straight leg swings through a radian along a quintic, with the hip's torque limit. The speeds
    are those of :func:`walking_speeds`, or of the family where the robot has none.

    Args:
        robot: its last update is overwritten.
    """
    p = template_for(robot)
    torque = min(float(robot.torque_limit[leg[1]]) for leg in robot.hinges)
    moment = _BORNE * torque * len(robot.groups[0])  # knees that bend together
    try:
        speeds = walking_speeds(robot)
    except GaitError:
        speeds = gaits_by_speed(p).speeds
    slowest, fastest = (float(gait_for_speed(p, speed).vlo[0]) for speed in speeds)
    template_for(robot)  # straight legs
    joint = robot.hinges[0][0]
    hip = robot.base_dof + joint
    quickest = _QUINTIC_ACCELERATION * float(robot.mass_matrix[hip, hip])
    return WalkLimits(
        min(moment, usual_knee_moment(p)),
        (slowest, fastest),
        float(np.sqrt(quickest / robot.torque_limit[joint])),
        not _heavy(robot),
    )


def can_stand(robot: Biped) -> bool:
    """True if a robot can stand: in its plane, or on feet that are no points."""
    return robot.directions <= UP or bool(robot.half_length)


def can_run(robot: Biped) -> bool:
    """True if a robot runs: on points, with light legs, and knees that bear it."""
    if robot.patches or _heavy(robot):
        return False
    p = template_for(robot)
    return _bears(robot, _RUN * p.speed_unit, suited_height(_RUN) * p.rest_length, 1.0)


def _heavy(robot: Biped) -> bool:
    """True if a robot's legs are most of its mass."""
    return sum(map(len, robot.groups)) * robot.leg_mass >= _HEAVY * robot.mass


def check_apex(robot: Biped, speed: float, height: Positive, torque_scale: Positive = 1.0) -> None:
    """Check that a robot can run with an apex of dx/dt ``speed`` [m/s] and y ``height`` [m].

    A GaitError names the heights that can be had with the share ``torque_scale`` of the URDF's
    torque limits, or says that no gait has this speed.
    """
    if _bears(robot, speed, height, torque_scale):
        return
    p = template_for(robot)
    running_gait(p, speed)  # the speed may be the culprit
    good = [h for h in p.rest_length * _HEIGHTS if _bears(robot, speed, float(h), torque_scale)]
    what = f"{robot.name} cannot run at {speed:g} m/s with its apex at {height:g} m"
    if not good:
        raise GaitError(f"{what}, nor at any other height: its motors are too weak; run slower")
    raise GaitError(f"{what}: give a height from {inward(min(good), max(good))} m")


def _bears(robot: Biped, speed: float, height: float, torque_scale: float) -> bool:
    """True if there is such a gait, and its stance does not ask too much of a knee.

    At the bottom that is a share of the template's leg force times the distance of a knee from the
    line between hip and foot, with a thigh as long as the shank.
    """
    p = template_for(robot)
    try:
        gait = running_gait(p, speed, height)
    except GaitError:
        return False
    result, _ = ReturnMap(gait.parameters, gait.stride).evaluate(gait.apex, gait.controls)
    leg = float(result[REAR_BOTTOM])
    if leg < _SHORTEST * p.rest_length:
        return False
    straight = 0.5 * robot.leg_length
    half = 0.5 * max(leg - _above_hips(robot) - robot.foot_radius, 0.0)
    away = float(np.sqrt(max(straight**2 - half**2, 0.0)))
    torque = _KNEES * float(gait.controls[Slot.K_SC]) * (p.rest_length - leg) * away
    limit = torque_scale * min(float(robot.torque_limit[leg[1]]) for leg in robot.hinges)
    return torque / len(robot.groups[0]) <= _BEARABLE * limit  # knees that bend together
