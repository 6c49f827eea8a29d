"""Tuning of the LQR on the VLO state, of its search and of its push-off."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from template_control.checks.checked import Checked
from template_control.checks.ranges import (
    Count,
    Index,
    Interval,
    NotNegative,
    Positive,
    Range,
    Share,
)
from template_control.slip.similarity import (
    LENGTH,
    PER_LENGTH_SQUARED,
    PER_SPEED_SQUARED,
    SPEED,
    TIME,
    tuned,
)

_Several = Annotated[int, Range(2)]
_Three = tuple[NotNegative, NotNegative, NotNegative]


@dataclass(frozen=True)
class SearchOptions(Checked):
    """How a step is searched for where the linear law's own is not good enough.

    Attributes:
        first_weight: weight of the cost-to-go after the first step, relative to that after the
            second. Where two steps end alike, it favours the one nearer the gait half-way.
        effort: weight of the LQR's own cost of the first step's controls. Where two steps end
            alike, it favours the gait's: no robot follows a step well whose legs are much softer.
        flight: a VLO state that would fly on to this far above l0 [m] is in flight: no walking step
            begins there. The template's leg would pull. A robot is a few millimetres above l0 in
            steady walks too.
        coarse: numbers of points in alpha, kappa_1 and kappa_2 over all of their ranges. Most are
            in alpha, which decides where the foot lands.
        fine: numbers of points in alpha and kappa_2 of each finer grid about the best so far, at
            least 2. kappa_1, which matters least there, gets two points beside their plane.
        rounds: number of finer grids; with two, alphas end 0.03 rad apart.
        narrowing: half-widths of a finer grid over those of the one before. It is at most half,
            the spacing of that one's alphas: what lies beyond has its neighbour's price.
    """

    first_weight: NotNegative = tuned(0.3)
    effort: NotNegative = tuned(0.1)
    flight: NotNegative = tuned(0.005, LENGTH)
    coarse: tuple[Count, Count, Count] = tuned((5, 3, 3))
    fine: tuple[_Several, _Several] = tuned((5, 3))
    rounds: Index = tuned(2)
    narrowing: Annotated[float, Range(0.0, 0.5, above=True)] = tuned(0.4)


_Four = tuple[float, NotNegative, NotNegative, NotNegative]


@dataclass(frozen=True)
class PushOffOptions(Checked):
    """Tuning of the fourth control, kappa_p: the rear leg's own stiffness in double stance.

    It counts in steps with push-off, stride "wp". There kappa_p has the bounds of the other
    stiffnesses.

    Attributes:
        cost: of the LQR on kappa_p, as a share of k0.
        points: of kappa_p in the coarse grid of the search.
        settled_price: cost-to-go up to which a step of the linear law may lead further away. Above
            it such a step is searched for: near some gaits the law alone settles beside them, in
            states in which the map is no longer linear.
        straight: bend of the leg at VLO, 1 - y/l0, at which :attr:`LqrOptions.control_weight`
            counts twice, and more the straighter the leg is. The fastest gaits bear no large change
            of their controls: with less weight the walk sways more and more.
        second_steps: what :attr:`LqrOptions.second_steps` are in other steps: alpha relative to
            the gait's [rad], kappa_1, kappa_2 and kappa_p over k0. A stiff push-off puts energy in.
    """

    cost: Positive = tuned(2.0)
    points: Count = tuned(3)
    settled_price: NotNegative = tuned(0.01)
    straight: NotNegative = tuned(0.004)
    second_steps: tuple[_Four, ...] = tuned(
        (
            (0.0, 1.5, 1.0, 0.75),
            (-0.058, 1.0, 0.75, 0.75),
            (0.025, 1.5, 1.0, 1.0),
            (-0.058, 1.25, 0.75, 1.0),
            (-0.03, 0.75, 1.0, 1.0),
            (0.0, 1.0, 1.25, 1.25),
            (0.045, 0.75, 0.75, 1.25),
        )
    )


@dataclass(frozen=True)
class StrainOptions(Checked):
    """What a searched step costs whose leg forces are more than a robot's knees carry.

    The numbers are five-link's: its knees have 350 N m, and its walks need some of them for the
    other leg's swing.

    Attributes:
        reach: length of the template's leg at which the knee is straight: it ends above the hip.
        moment: of the leg force about the knee, over the weight, from which on a step costs more
            [m].
        price: of twice that moment; the LQR's cost-to-go is the unit.
    """

    reach: Positive = tuned(1.095, LENGTH)
    moment: Positive = tuned(0.41, LENGTH)
    price: NotNegative = tuned(100.0)


_VLO_STATE = (SPEED, LENGTH, SPEED)


@dataclass(frozen=True)
class LqrOptions(Checked):
    """Tuning of the LQR; states in m/s, m, m/s, controls in rad and shares of k0.

    States are those of the reference template (80 kg, 1 m, 9.81 m/s^2); the planner scales
    them to its gait's by dynamic similarity.

    Attributes:
        state_cost: on dx/dt, y, dy/dt.
        control_cost: on alpha, kappa_1, kappa_2.
        offset_gain: share of a step's surprise that enters the offset estimate.
        offset_bound: largest offset believed, per state.
        surprise_bound: a larger surprise counts as this much: a push is no offset.
        tolerance: errors of the settled state that count as equally bad; decides which
            part of an offset that the controls cannot cancel shows up where.
        control_weight: of the settled controls' squared changes [rad, share of k0], where
            an error of ``tolerance`` in a state counts as 1.
        stiffness_range: kappa_1 and kappa_2 over k0.
        softest_rest: least of them that is chosen for the rest of a step that has begun and ends
            slow: a loaded leg that gets softer takes energy out, and sinks so low that the knee
            does not lift it again.
        angle_range: touchdown angle relative to the gait's [rad]; steeper ones make steps
            too short in time for the swing leg, flatter ones let the CoM sink lower than the
            knees can carry it.
        top_margin: alpha stays this far [rad] below asin(y / l0), the angle at which the
            foot would touch down at once.
        earliest_touchdown: no foot is to touch down so soon after VLO [s]: the swing leg passes the
            other one about then, and is not in front yet. 0 is no bound.
        earliest_share: of the gait's step duration, which counts in its place where it is less:
            fast gaits swing their legs faster.
        trusted_price: the linear law's step is taken without a search below this price.
        spread: half-widths of the search in alpha [rad] and kappa_2 / k0.
        search: points, rounds and weights of the search.
        second_steps: second steps that the search reckons with beside the law's own: alpha relative
            to the gait's [rad], kappa_1 and kappa_2 over k0. A leg that is stiffer before its
            virtual bottom than after takes energy out, the reverse puts some in.
        push_off: tuning of the fourth control, in steps that have it.
        strain: what bounds the leg forces of steps that are searched for.
    """

    kind: ClassVar[str] = "lqr"

    state_cost: _Three = tuned(
        (10.0, 100.0, 10.0), PER_SPEED_SQUARED, PER_LENGTH_SQUARED, PER_SPEED_SQUARED
    )
    control_cost: tuple[Positive, Positive, Positive] = tuned((5.0, 2.0, 2.0))
    offset_gain: Share = tuned(0.2)
    offset_bound: _Three = tuned((0.06, 0.015, 0.12), *_VLO_STATE)
    surprise_bound: _Three = tuned((0.03, 0.008, 0.06), *_VLO_STATE)
    tolerance: tuple[Positive, Positive, Positive] = tuned((0.011, 0.005, 0.03), *_VLO_STATE)
    control_weight: Positive = tuned(100.0)
    stiffness_range: Interval = tuned((0.5, 1.5))
    softest_rest: NotNegative = tuned(0.75)
    angle_range: Interval = tuned((-0.12, 0.065))
    top_margin: NotNegative = tuned(0.01)
    earliest_touchdown: NotNegative = tuned(0.12, TIME)
    earliest_share: Share = tuned(0.2)
    trusted_price: NotNegative = tuned(1.0)
    spread: tuple[NotNegative, NotNegative] = tuned((0.16, 0.25))
    search: SearchOptions = field(default_factory=SearchOptions)
    second_steps: tuple[tuple[float, NotNegative, NotNegative], ...] = tuned(
        (
            (0.0, 1.5, 1.0),
            (-0.058, 1.0, 0.75),
            (0.025, 1.5, 1.0),
            (-0.058, 1.25, 0.75),
            (-0.03, 0.75, 1.0),
            (0.0, 1.0, 1.5),
            (0.045, 0.5, 0.75),
        )
    )
    push_off: PushOffOptions = field(default_factory=PushOffOptions)
    strain: StrainOptions = field(default_factory=StrainOptions)
