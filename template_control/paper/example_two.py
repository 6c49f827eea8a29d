"""Figs. 12 and 13: Example II, the five-link robot from z_0 to the equilibrium (Section V-B)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.arrays import Array
from template_control.embedding.modes import GuardOptions
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.modified import ModifiedOptions, ModifiedPlanner
from template_control.embedding.planners.planner import Context, Planner
from template_control.paper.reproduction import MAPS, Reproduction
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.robot.library import load_robot
from template_control.robot.template import paper_gait, template_for
from template_control.run.experiment import Experiment
from template_control.run.record import Record
from template_control.run.simulation import simulate
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.gaits.basin import velocity_angle, vlo_state
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.sweep.executor import workers
from template_control.terminal import counted
from template_control.view.figures import stick_diagram
from template_control.view.style import COM, LEFT, RIGHT, TEMPLATE, TRUNK, Look, panelled, shade
from template_control.whole_body.solver import QpOptions

_COLORS = (TEMPLATE, RIGHT, LEFT, COM)


@dataclass(frozen=True)
class Liftoff:
    """The first liftoff of a run: its direction from the foot to the CoM [rad].

    ``load`` is the vertical force on that foot in the last tick before [N]; of lifting hip and
    knee, standing hip and knee ``jump`` (4,) is the difference of the |torque| across the liftoff's
    tick, ``peak`` (4,) the largest from the touchdown before to the one after [N m].
    """

    beta: float
    load: float
    jump: Array
    peak: Array


def _entries(record: Record, node: str) -> NDArray[np.intp]:
    """Samples at which the run enters ``node`` of the automaton."""
    inside = record.node == record.nodes.index(node)
    return np.flatnonzero(inside[1:] & ~inside[:-1]) + 1


def _step(record: Record, first: int = 0) -> tuple[int, int, int]:
    """Samples of the ``first`` touchdown, the liftoff after it, and the next touchdown."""
    begin, end = _entries(record, "DS_sc^w")[first:][:2]
    lifts = _entries(record, "SS_bv^w")
    return int(begin), int(lifts[lifts > begin][0]), int(end)


def _joints(record: Record, lifted: int) -> list[int]:
    """Joints of the leg that lifts off, then those of the one that stands."""
    standing = int(record.rear[lifted])
    legs = record.legs
    return [*legs[1 - standing], *legs[standing]]


def liftoff(record: Record) -> Liftoff:
    """Measure the first liftoff of a run that has two touchdowns and every sample."""
    begin, lifted, end = _step(record)
    joints = _joints(record, lifted)
    foot = 1 - int(record.rear[lifted])
    x, y = record.com[lifted] - [record.foot[lifted, foot, 0], 0.0]
    torque = record.torque[:, joints]
    return Liftoff(
        beta=float(np.arctan2(y, x)),
        load=float(record.contact_force[lifted, foot, 1]),
        jump=np.abs(torque[lifted] - torque[lifted - 1]),
        peak=np.abs(torque[begin:end]).max(axis=0),
    )


def states_figure(
    states: dict[tuple[str, str], Array],
    planners: tuple[str, ...],
    plants: tuple[str, ...],
    target: Array,
) -> Figure:
    """y, phi and E at VLO (steps + 1, 3) over the steps: a row a plant, a line a planner."""
    height = 1.7 * len(plants) + 0.6
    figure, panels = panelled(height, len(plants), 3, 9.5, sharex=True, sharey="col")
    panels = panels.reshape(-1, 3)
    unit = np.array([1.0, 180.0 / np.pi, 1.0])
    spans = np.array(((0.96, 1.005), (-12.0, 6.0), (819.0, 832.0)))
    for row, plant in zip(panels, plants, strict=True):
        for j, axes in enumerate(row):
            axes.axhline(target[j] * unit[j], color="0.75", linewidth=2.5, zorder=0)
            for planner, color in zip(planners, _COLORS, strict=False):
                if (planner, plant) not in states:
                    continue
                z = states[planner, plant] * unit
                # A fall is drawn as far as it is on the picture.
                off = np.flatnonzero(np.any((z < spans[:, 0]) | (z > spans[:, 1]), axis=1))
                end = int(off[0]) if off.size else len(z)
                axes.plot(z[:end, j], color=color, linewidth=1.0, label=planner)
                if off.size:
                    axes.plot(end - 1, z[end - 1, j], "x", color=color, markersize=6)
            axes.set_ylim(*spans[j])
        row[0].set_ylabel(f"{plant}\n")
    for axes, name in zip(panels[0], ("y [m]", "phi [deg], downward", "E [J]"), strict=True):
        axes.set_title(name, fontsize=10)
    for axes in panels[-1]:
        axes.set_xlabel("step")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(planners), frameon=False)
    return figure


def liftoff_figure(settled: Record, records: dict[str, Record]) -> Figure:
    """CoM in a step of a settled walk, and torques of a first step with each liftoff rule."""
    figure, panels = panelled(2.2 * (len(records) + 1), len(records) + 1)
    begin, _, end = _step(settled, len(settled.section_time) - 3)
    w = slice(begin, end)
    com, template = settled.com[w], settled.template_com[w]
    panels[0].plot(*com.T, color=COM, linewidth=2.0, label="robot")
    panels[0].plot(*template.T, color=TEMPLATE, linestyle="--", linewidth=1.0, label="template")
    panels[0].set(xlabel="CoM x [m]", ylabel="CoM y [m]", title="(a) settled walk")
    panels[0].legend(loc="upper left", frameon=False)
    for axes, (rule, record), letter in zip(panels[1:], records.items(), "bcdef", strict=False):
        begin, lifted, end = _step(record)
        w = slice(begin, end)
        joints = zip(_joints(record, lifted), _JOINTS, (LEFT, COM, RIGHT, TRUNK), strict=True)
        for joint, name, color in joints:
            values = record.torque[w, joint]
            axes.plot(record.time[w], values, color=color, linewidth=1.2, label=name)
        shade(axes, record, w)
        axes.set(ylabel="torque [N m]", ylim=(-360, 360), title=f"({letter}) liftoff: {rule}")
    panels[1].legend(loc="upper right", ncols=4, frameon=False, fontsize=8)
    panels[-1].set_xlabel("time [s], single stance shaded")
    return figure


START = (0.9695, np.radians(1.9), 821.55)  # y, phi (positive downward), E of z_0
STEPS, LAST = 60, 20
_LIFTOFF_STEPS = 30  # with an early liftoff the robot has fallen by then
GRIP = 5.0  # a friction coefficient that never binds
EARLIER, LATER = np.radians(72.0), np.radians(67.0)  # predefined liftoffs about beta_l = 70 deg

PLANNERS: dict[str, Callable[[WalkingGait], Planner]] = {
    "LQR": LqrPlanner,
    **{
        f"modified, {kind.name.lower()} map": partial(
            ModifiedPlanner, options=ModifiedOptions(map_kind=kind)
        )
        for kind in MAPS
    },
}
ALONE, FULL_GRIP = "template alone", "ideal, full grip"
PLANTS: dict[str, tuple[PlantOptions | IdealOptions, EmbeddingOptions]] = {
    FULL_GRIP: (IdealOptions(), EmbeddingOptions(qp=QpOptions(friction=GRIP, friction_margin=1.0))),
    "ideal": (IdealOptions(), EmbeddingOptions()),
    "PyBullet": (PlantOptions(), EmbeddingOptions()),
}
_LIFTOFFS = {"template's": None, "later": LATER, "earlier": EARLIER}
_JOINTS = ("lifting hip", "lifting knee", "standing hip", "standing knee")


@dataclass(frozen=True)
class Walk:
    """VLO states (steps + 1, 3) y [m], phi [rad], E [J] of a walk from z_0; why it fell, or ""."""

    states: Array
    fall: str

    @property
    def settled(self) -> tuple[Array, Array] | None:
        """Mean and standard deviation (3,) over the last steps; None after a fall."""
        if self.fall:
            return None
        last = self.states[-LAST:]
        return last.mean(axis=0), last.std(axis=0)


def _gait() -> WalkingGait:
    return paper_gait(template_for(load_robot("five-link")))


def start_state(gait: WalkingGait) -> tuple[float, float, float]:
    """z_0 as dx/dt, y, dy/dt."""
    dx, y, dy = vlo_state(gait.parameters, *START)
    return float(dx), float(y), float(dy)


def sections(gait: WalkingGait, z: Array) -> Array:
    """(n, 3) y [m], phi [rad, positive downward], E [J] of VLO states (n, 3) dx/dt, y, dy/dt."""
    energy = np.asarray(VLO.energy(gait.parameters, z))
    return np.column_stack((z[:, 1], velocity_angle(z), energy))


def robot_walk(
    planner: str, plant: str, steps: int = STEPS, beta: float | None = None, settled: bool = False
) -> tuple[Walk, Record]:
    """Walk and record from z_0, or ``settled`` on the gait.

    ``beta`` [rad] is a predefined liftoff direction, or None.
    """
    gait = _gait()
    world, tuning = PLANTS[plant]
    record = simulate(
        Experiment(
            load_robot("five-link"),
            planner=PLANNERS[planner](gait),
            steps=steps,
            world=world,
            controller=replace(tuning, guards=GuardOptions(liftoff_angle=beta)),
            start=None if settled else start_state(gait),
        )
    )
    return Walk(sections(gait, record.section_state), record.fall_reason), record


def template_walk(planner: str, steps: int = STEPS) -> Walk:
    """As :func:`robot_walk`, of the template itself, integrated exactly."""
    gait = _gait()
    chooses, step = PLANNERS[planner](gait), ReturnMap(gait.parameters)
    states, fall = [np.array(start_state(gait))], ""
    for k in range(steps):
        decision = chooses.decide(Context(states[-1]))
        z, outcome = step.step(states[-1], decision.controls)
        if outcome is not Outcome.SECTION:
            fall = f"{outcome.reason}, in step {k + 1}"
            break
        chooses.observe(decision, z)
        states.append(z)
    return Walk(sections(gait, np.array(states)), fall)


def _walk(case: tuple[str, str], steps: int) -> Walk:
    planner, plant = case
    return template_walk(planner, steps) if plant == ALONE else robot_walk(planner, plant, steps)[0]


def _texts(walk: Walk) -> tuple[str, ...]:
    settled = walk.settled
    if settled is None:
        return "", "", "", f"step {len(walk.states)}"
    (y, phi, energy), (dy, dphi, de) = settled
    angle = f"{np.degrees(phi):+.2f} ± {np.degrees(dphi):.2f}"
    return f"{y:.4f} ± {dy:.4f}", angle, f"{energy:.2f} ± {de:.2f}", ""


def _numbers(walk: Walk) -> dict[str, Any]:
    mean, spread = (x.tolist() for x in walk.settled) if walk.settled else (None, None)
    steps, fall = len(walk.states) - 1, walk.fall or None
    return {"steps": steps, "fall": fall, "mean": mean, "spread": spread}


def fig12(planners: Sequence[str] = tuple(PLANNERS), steps: int = STEPS) -> Reproduction:
    """States on which the robot settles in the last 20 steps from z_0, by planner and by plant."""
    plants, first = (ALONE, *PLANTS), planners[0]
    # What full grip changes is the robot's, whatever its planner.
    cases = [
        (planner, plant)
        for planner in planners
        for plant in plants
        if plant != FULL_GRIP or planner == first
    ]
    with workers() as pool:
        done = counted(pool.map(partial(_walk, steps=steps), cases), len(cases), "walks")
        walks = dict(zip(cases, done, strict=True))
    _, record = robot_walk("LQR", "PyBullet", steps=6)
    sticks = stick_diagram(record, Look(0.0, 2.199, titled=False))  # the samples before 2.2 s
    sticks.axes[0].set_title("five-link from z_0: LQR, PyBullet")
    gait = _gait()
    target = sections(gait, gait.vlo[None])[0]
    return Reproduction(
        title=(
            f"Fig. 12: Example II, last {LAST} of {steps} steps from"
            " z_0 = [0.9695 m, 1.9 deg, 821.55 J]"
        ),
        columns=("planner", "plant", "y_v [m]", "phi_v [deg]", "E [J]", "falls in"),
        rows=[
            ("paper", "its robot", "0.9818", "0", "826", ""),
            *((*case, *_texts(walk)) for case, walk in walks.items()),
        ],
        data={
            "target": target.tolist(),
            "walks": {
                planner: {plant: _numbers(w) for (by, plant), w in walks.items() if by == planner}
                for planner in planners
            },
        },
        notes=(
            "Mean ± standard deviation of the VLO states, the robot's in the template's formula"
            " (dx/dt from the angular momentum about the foot, E with the stance spring); phi_v"
            " is positive downward. The paper gives no numbers for its robot, only that it"
            " stabilizes the same equilibrium.",
            "Template alone is the exact SLIP: its error is the planner's map. On the ideal plant"
            " (rigid contacts that stick) the error of a robot that is no SLIP is added, in"
            " PyBullet that of its contacts.",
            f"Full grip: the controller's friction cone ({QpOptions().cone:g} otherwise)"
            f" never binds; asked of the {first} only. It makes no difference to speak of: where"
            " the template is light on its foot near VLO, the swing foot gives way and not the"
            " CoM's height.",
        ),
        figures={
            "fig12": sticks,
            "fig12_states": states_figure(
                {key: walk.states for key, walk in walks.items()}, tuple(planners), plants, target
            ),
        },
    )


def _liftoffs(case: tuple[str, str], steps: int) -> tuple[Liftoff, Record, Walk, Record]:
    """One step from the equilibrium with a liftoff rule on a plant; and the walk from z_0."""
    rule, plant = case
    beta = _LIFTOFFS[rule]
    _, record = robot_walk("LQR", plant, 2, beta, settled=True)
    return liftoff(record), record, *robot_walk("LQR", plant, steps, beta)


def fig13(steps: int = _LIFTOFF_STEPS) -> Reproduction:
    """Torques with the template's liftoff and with predefined ones, in walks from z_0."""
    cases = [(rule, plant) for plant in ("PyBullet", "ideal") for rule in _LIFTOFFS]
    with workers() as pool:
        done = counted(pool.map(partial(_liftoffs, steps=steps), cases), len(cases), "walks")
        results = dict(zip(cases, done, strict=True))
    rows = [
        (
            *case,
            f"{np.degrees(event.beta):.1f}",
            f"{event.load:.0f}",
            *("  ".join(f"{x:.0f}" for x in of) for of in (event.jump, event.peak)),
            f"falls in step {len(walk.states)}" if walk.fall else f"{steps} steps",
        )
        for case, (event, _, walk, _) in results.items()
    ]
    return Reproduction(
        title="Fig. 13: torques about liftoff, one step from the equilibrium",
        columns=(
            "liftoff",
            "plant",
            "beta [deg]",
            "load [N]",
            "jump [N m]",
            "peak [N m]",
            "from z_0",
        ),
        rows=rows,
        data={
            "joints": list(_JOINTS),
            "cases": [
                {
                    "liftoff": rule,
                    "plant": plant,
                    "beta": event.beta,
                    "load": event.load,
                    "jump": event.jump.tolist(),
                    "peak": event.peak.tolist(),
                    **_numbers(walk),
                }
                for (rule, plant), (event, _, walk, _) in results.items()
            ],
        },
        notes=(
            f"Joints: {', '.join(_JOINTS)}. Jump: |torque| difference between the last tick of"
            " double stance and the first of single stance, 1 ms apart. Peak: largest |torque|"
            " from the first touchdown to the second. Load: vertical force on the rear foot in"
            " the last tick before. All cases of a plant share their history up to liftoff.",
            f"Predefined directions: {np.degrees(EARLIER):.0f} deg (earlier than the template)"
            f" and {np.degrees(LATER):.0f} deg (later; the rear leg is let go sooner where it is"
            " 3 % longer than l0). The paper does not say which it used; what it reports, smaller"
            " amplitudes and a rougher liftoff than with the template's, is the earlier one.",
            "With the template's liftoff the rear leg has faded when it lifts off, so all jumps"
            " are small; a later one is as smooth but leaves the swing less time.",
        ),
        figures={
            "fig13": liftoff_figure(
                results["template's", "PyBullet"][3],
                {rule: results[rule, "PyBullet"][1] for rule in _LIFTOFFS},
            )
        },
    )
