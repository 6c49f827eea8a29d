"""One tick of whole-body control of the same robot in this library, TSID and placo, by turns.

Run: python benchmarks/against_peers.py [--folder FOLDER] [--json]

Bolt on a floating base walks in PyBullet. TSID and placo then solve, at states of that walk, the
tasks of a walk on point feet: CoM, posture, the trunk's attitude and the swing foot, with one
contact and its friction cone, each with its own QP solver. Their packages need other versions of
Pinocchio than this library; each gets an environment of its own below ``folder``, made by pip at
the first run. All take turns in batches of ticks, and medians of a batch's ticks are compared.

What the ticks hold differs:

template_control: reads the state, follows the automaton, the template's path and the feet's, and
    solves for torques within limits of torque, speed and friction. Plans are in it, rarely.
tsid: model, tasks with their references set anew, HQP with limits of the torques, in C++.
placo: the same tasks; torque limits; every matrix is allocated anew, in C++.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

PEERS = {
    # TSID 1.10 aborts with Pinocchio 4; older ones ask for no version of these libraries.
    "tsid": ("tsid==1.7.1", "pin==3.4.0", "cmeel-urdfdom==4.0.1", "cmeel-tinyxml2==10.0.0"),
    "placo": ("placo",),
}
_ROUNDS, _BATCH = 20, 100
_STATES = 400
_FRICTION = 0.6
_WEIGHTS = {"com": 1.0, "trunk": 0.5, "posture": 0.05, "foot": 1.0}

Tick = Callable[[int], object]


def main() -> None:
    """Measure all by turns, and print microseconds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "tc-peers")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--peer", choices=PEERS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.peer:
        _answer(_PEER_TICKS[options.peer](options.folder))
        return
    found = measure(options.folder)
    if options.json:
        print(json.dumps(found, indent=1))
        return
    for name, microseconds in found.items():
        print(
            f"{name:24} {microseconds:8.1f} us {microseconds / found['pybullet step']:6.2f} steps"
        )


def measure(folder: Path) -> dict[str, float]:
    """Median microseconds of a tick of each, and of PyBullet's step.

    Args:
        folder: for the peers' environments, and for the walk whose states they get.
    """
    from control_tick import start, ticks_of  # which only this library's environment can import

    folder.mkdir(parents=True, exist_ok=True)
    run = start("free")
    robot = run.controller.robot
    ticks: list[float] = []
    steps: list[float] = []
    under_way = ticks_of(run, ticks, steps)
    _prepare(robot, under_way, folder)
    peers = {name: _start(name, packages, folder) for name, packages in PEERS.items()}
    times: dict[str, list[float]] = {name: [] for name in peers}
    ticks.clear()
    steps.clear()
    for _ in range(_ROUNDS):
        for _ in range(_BATCH):
            next(under_way)
        for name, peer in peers.items():
            assert peer.stdin is not None
            assert peer.stdout is not None
            peer.stdin.write("go\n")
            peer.stdin.flush()
            times[name].append(float(peer.stdout.readline()))
    for peer in peers.values():
        peer.communicate()
    whole = {"pybullet step": steps, "template_control": ticks, **times}
    return {name: 1e6 * float(np.median(values)) for name, values in whole.items()}


def _prepare(robot: Any, under_way: Iterator[int], folder: Path) -> None:
    """Write robot, and states of its walk, for the peers."""
    tree = ElementTree.fromstring(robot.urdf)
    for link in tree.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    (folder / "robot.urdf").write_bytes(ElementTree.tostring(tree))
    while next(under_way) <= 0:
        pass
    q: list[Any] = []
    v: list[Any] = []
    feet: list[int] = []
    controller = under_way.gi_frame.f_locals["controller"]  # type: ignore[attr-defined]
    while len(q) < _STATES:
        next(under_way)
        stance = controller.node.stance
        if len(stance) == 1:
            state = controller.frame.raw_state
            q.append(state[0].copy())
            v.append(state[1].copy())
            feet.append(controller.feet.foot_of_leg[stance[0]])
    limits = {"torque": robot.torque_limit, "names": robot.feet}
    np.savez(folder / "walk.npz", q=q, v=v, stance=feet, **limits)


def _batch(tick: Tick) -> float:
    """Median seconds of a batch of ticks."""
    times = []
    for i in range(_BATCH):
        begin = time.perf_counter()
        tick(i * (_STATES // _BATCH))
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def _start(name: str, packages: tuple[str, ...], folder: Path) -> subprocess.Popen[str]:
    """A peer's process, in its environment, which is made if it is not there."""
    home = folder / name
    python = home / "bin" / "python"
    if not (home / "ready").exists():
        print(f"making an environment with {', '.join(packages)}", file=sys.stderr)
        venv.create(home, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True)
        (home / "ready").touch()
    command = [str(python), __file__, "--peer", name, "--folder", str(folder)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _answer(tick: Tick) -> None:
    """Measure a batch whenever asked, in a peer's process."""
    _batch(tick)
    for _ in sys.stdin:
        print(_batch(tick), flush=True)


def _tsid(folder: Path) -> Tick:
    """TSID at the walk's states."""
    import pinocchio as pin
    from tsid import tsid_pywrap as tsid  # type: ignore[import-not-found]

    walk = np.load(folder / "walk.npz")
    robot = tsid.RobotWrapper(str(folder / "robot.urdf"), [], pin.JointModelFreeFlyer(), False)
    model, solver = robot.model(), tsid.SolverHQuadProgFast("qp")
    q, v, names = walk["q"], walk["v"], [str(name) for name in walk["names"]]
    problems = {}
    for stance in range(2):
        problem = tsid.InverseDynamicsFormulationAccForce("walk", robot, False)
        problem.computeProblemData(0.0, q[0], v[0])
        contact = tsid.ContactPoint(
            "contact", robot, names[stance], np.array([0.0, 0.0, 1.0]), _FRICTION, 0.1, 1e3
        )
        contact.setKp(np.zeros(3))
        contact.setKd(40.0 * np.ones(3))
        problem.addRigidContact(contact, 1e-5)
        com = tsid.TaskComEquality("com", robot)
        com.setKp(50.0 * np.ones(3))
        com.setKd(14.0 * np.ones(3))
        problem.addMotionTask(com, _WEIGHTS["com"], 1, 0.0)
        posture = tsid.TaskJointPosture("posture", robot)
        posture.setKp(50.0 * np.ones(robot.nv - 6))
        posture.setKd(14.0 * np.ones(robot.nv - 6))
        problem.addMotionTask(posture, _WEIGHTS["posture"], 1, 0.0)
        trunk = tsid.TaskSE3Equality("trunk", robot, "root_joint")
        trunk.setKp(100.0 * np.ones(6))
        trunk.setKd(20.0 * np.ones(6))
        trunk.setMask(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
        problem.addMotionTask(trunk, _WEIGHTS["trunk"], 1, 0.0)
        foot = tsid.TaskSE3Equality("foot", robot, names[1 - stance])
        foot.setKp(400.0 * np.ones(6))
        foot.setKd(40.0 * np.ones(6))
        foot.setMask(np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
        problem.addMotionTask(foot, _WEIGHTS["foot"], 1, 0.0)
        motors = tsid.TaskActuationBounds("motors", robot)
        motors.setBounds(-walk["torque"], walk["torque"])
        problem.addActuationTask(motors, 1.0, 0, 0.0)
        references = [
            (com, tsid.TrajectorySample(3), robot.com(problem.data())),
            (posture, tsid.TrajectorySample(robot.nv - 6), q[0, 7:]),
        ]
        frames = [(trunk, tsid.TrajectorySample(12, 6)), (foot, tsid.TrajectorySample(12, 6))]
        # A problem only points at its tasks: somebody has to keep them.
        problems[stance] = problem, contact, references, frames, motors
    stances, feet = walk["stance"], [model.getFrameId(name) for name in names]
    upright = pin.SE3.Identity()

    def tick(i: int) -> object:
        stance = int(stances[i])
        problem, contact, references, frames, _ = problems[stance]
        contact.setReference(robot.framePosition(problem.data(), feet[stance]))
        for task, sample, value in references:
            sample.value(value)
            task.setReference(sample)
        for task, sample in frames:
            sample.value(np.concatenate((upright.translation, upright.rotation.T.ravel())))
            task.setReference(sample)
        found = solver.solve(problem.computeProblemData(0.0, q[i], v[i]))
        assert found.status == 0, f"TSID finds no solution: {found.status}"
        return problem.getActuatorForces(found)

    return tick


def _placo(folder: Path) -> Tick:
    """Placo at the walk's states."""
    import placo  # type: ignore[import-not-found]

    walk = np.load(folder / "walk.npz")
    q, v, names = walk["q"], walk["v"], [str(name) for name in walk["names"]]
    problems = {}
    for stance in range(2):
        robot = placo.RobotWrapper(str(folder / "robot.urdf"), 1)
        robot.state.q, robot.state.qd = q[0], v[0]
        robot.update_kinematics()
        solver = placo.DynamicsSolver(robot)
        solver.dt = 1e-3
        place = robot.get_T_world_frame(names[stance])[:3, 3]
        held = solver.add_position_task(names[stance], place)
        held.configure("stance", "hard", 1.0)
        contact = solver.add_unilateral_point_contact(held)
        contact.mu = _FRICTION
        com = solver.add_com_task(robot.com_world())
        com.configure("com", "soft", _WEIGHTS["com"])
        trunk = solver.add_orientation_task("base_link", np.eye(3))
        trunk.configure("trunk", "soft", _WEIGHTS["trunk"])
        posture = solver.add_joints_task()
        joints = dict(zip(robot.joint_names(), q[0, 7:].tolist(), strict=True))
        posture.set_joints(joints)
        posture.configure("posture", "soft", _WEIGHTS["posture"])
        other = names[1 - stance]
        foot = solver.add_position_task(other, robot.get_T_world_frame(other)[:3, 3])
        foot.configure("foot", "soft", _WEIGHTS["foot"])
        solver.enable_torque_limits(True)
        problems[stance] = robot, solver, com, foot, robot.com_world(), foot.target_world
    stances = walk["stance"]

    def tick(i: int) -> object:
        robot, solver, com, foot, place, foothold = problems[int(stances[i])]
        robot.state.q, robot.state.qd = q[i], v[i]
        robot.update_kinematics()
        com.target_world, foot.target_world = place, foothold
        found = solver.solve(True)
        assert found.success, "placo finds no solution"
        return found.tau

    return tick


_PEER_TICKS: dict[str, Callable[[Path], Tick]] = {"tsid": _tsid, "placo": _placo}

if __name__ == "__main__":
    main()
