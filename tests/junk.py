"""Random junk, and what it is thrown at: every public constructor and function, every command."""

import inspect
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

import template_control as tc
from template_control import embedding, estimation, run, slip, sweep, whole_body
from template_control.plant import BulletPlant, IdealPlant, MujocoPlant
from template_control.robot import (
    HipBlock,
    JointLimits,
    state_at_vlo,
)
from template_control.robustness import measure, trial
from template_control.slip import APEX, VLO, Leg, Phase, Slot
from template_control.view import save_scenario_figures

P = tc.SlipParameters()
ROBOT = tc.load_robot("five-link")
GAIT = tc.default_gait(ROBOT)
Z = GAIT.vlo
U = GAIT.controls
LINK = tc.Link(0.4, 3.0, 0.2, 0.1)
SEGMENT = slip.Segment("walk", speed=1.1, steps=1)
SCENARIO = slip.Scenario((SEGMENT,))
MAP = tc.ReturnMap(P)
PLANNER = tc.LqrPlanner(GAIT)
RUN = slip.running_gait(P, 3.0)
ROUTE = slip.SteadyRoute.of(GAIT)
RECORD = tc.simulate(tc.Experiment(ROBOT, planner=PLANNER, steps=1, record_every=20))
NAMES = ("", "[/nope]", "$x^{", ":bus:", "walk", "w", "r", "a\nb", "nul\0", "five-link", "ü" * 80)


class Stranger:
    """Nothing that the library knows, and not even its text can be had."""

    def __repr__(self):
        raise RuntimeError("no")

    def _repr_pretty_(self, printer, cycle):
        """As Hypothesis tells it, so that an example that fails can be told at all."""
        printer.text("Stranger()")


numbers = st.one_of(
    st.integers(-3, 3),
    st.sampled_from([10**400, -(10**18), 10**9, np.int8(3), np.float32(0.5), 0.5, 1e-320]),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([1e300, -1e300, 1e-9, 0.98, 1.1, 1.15, 16.5e3]),
)
simple = st.one_of(
    numbers,
    st.none(),
    st.booleans(),
    st.sampled_from(NAMES),
    st.text(max_size=5),
    st.binary(max_size=3),
)
arrays = npst.arrays(np.float64, npst.array_shapes(max_dims=3, max_side=5))
things = st.sampled_from(
    [
        Stranger(),
        Stranger,
        object(),
        lambda *_: None,
        3j,
        np.array(3.0),
        np.array([]),
        np.array(["a"]),
        np.array([None, 3.0], dtype=object),
        range(3),
        {1, 2},
        Path("nowhere"),
        tc.MapKind.PAPER,
        Phase.SS,
        Leg.REAR,
        Slot.K_SC,
        P,
        ROBOT,
        GAIT,
        PLANNER,
        ROUTE,
        SCENARIO,
        SEGMENT,
        RECORD,
        VLO,
        APEX,
        MAP,
        Z,
        U,
        tc.Push(1.0),
        tc.PlantOptions(),
        tc.Experiment(steps=1),
    ]
)
junk = st.one_of(
    simple,
    arrays,
    things,
    st.lists(simple, max_size=4),
    st.tuples(numbers, numbers),
    st.tuples(numbers, numbers, numbers),
    st.dictionaries(st.one_of(st.sampled_from(NAMES), numbers), simple, max_size=2),
)


def targets(folder):
    """By name, what is called and arguments that are good."""
    held = {"height": 0.98, "stiffness": 16.5e3}
    options = (
        tc.EmbeddingOptions, tc.IdealOptions, tc.LqrOptions, tc.MujocoOptions, tc.PlantOptions,
        tc.SensorOptions, tc.Terrain,
        tc.Experiment, tc.SlipParameters, embedding.GuardOptions, embedding.LeanOptions,
        estimation.FrictionOptions,
        embedding.AheadOptions,
        embedding.ModifiedOptions, embedding.ReplanOptions,
        embedding.RunningOptions, embedding.StandingOptions,
        embedding.SwingOptions, run.FallOptions,
        estimation.ImuOptions, sweep.SweepOptions, whole_body.ComTask, whole_body.FootTask,
        whole_body.MomentumTask, whole_body.PostureTask, whole_body.QpOptions,
    )  # fmt: skip
    calls = {kind: {} for kind in options}
    calls |= {
        tc.Push: {"impulse": 1.0},
        tc.Link: {"length": 0.4, "mass": 3.0, "com": 0.2, "inertia": 0.1},
        tc.FiveLink: {
            "name": "mine", "trunk": LINK, "thigh": LINK, "shank": LINK, "torque_limit": (9.0, 9.0)
        },
        HipBlock: {"mass": 1.0, "radius": 0.05, "torque_limit": 9.0},
        JointLimits: {"torque": 9.0, "velocity": 9.0},
        embedding.PhaseControl: {"tasks": (whole_body.PostureTask(),)},
        embedding.Decision: {
            "controls": U, "predicted": Z, "feasible": True, "lasting": True, "nominal": True
        },
        slip.Scale: {"length": 1.0, "time": 1.0},
        slip.Segment: {"gait": "walk", "speed": 1.1, "steps": 1},
        slip.Scenario: {"segments": (SEGMENT,)},
        slip.WalkingGait: {
            "name": "mine", "parameters": P, "state": Z, "controls": U, "step_length": 0.5,
            "step_duration": 0.5,
        },
        tc.slip.ActiveRunning: {"parameters": P},
        slip.ActiveWalking: {"parameters": P},
        slip.ModifiedWalking: {"parameters": P},
        slip.RunToWalk: {"parameters": P},
        slip.WalkToRun: {"parameters": P},
        tc.ReturnMap: {"parameters": P},
        slip.SteadyRoute: {"parameters": P, "stride": "w", "target": Z},
        tc.ScenarioRoute: {"scenario": SCENARIO},
        slip.Family: {"parameters": P, "stride": "w", "fixed": held},
        tc.RunningPlanner: {"gait": RUN},
        embedding.Lean: {"speeds": (2.0, 3.0), "pitches": (0.3, 0.4)},
        run.GaitSpec: {"name": "run"},
        tc.LqrPlanner: {"gait": GAIT},
        tc.ModifiedPlanner: {"gait": GAIT},
        tc.EmbeddingController: {"robot": ROBOT, "planners": PLANNER},
        whole_body.WholeBodyQp: {"robot": ROBOT},
        BulletPlant: {"robot": ROBOT, "options": tc.PlantOptions()},
        IdealPlant: {"robot": ROBOT, "options": tc.IdealOptions()},
        MujocoPlant: {"robot": ROBOT, "options": tc.MujocoOptions()},
        tc.gait_at: {"parameters": P, "touchdown_angle": 1.15, "vlo_speed": 1.1},
        tc.gait_for_speed: {"parameters": P, "mean_speed": 1.2},
        tc.gait_from_energy: {"parameters": P, "height": 0.9818, "energy": 826.0},
        slip.running_gait: {"parameters": P, "speed": 3.0},
        slip.running_speeds: {"parameters": P},
        slip.walking_gait: {"parameters": P, "vlo_speed": 1.1},
        slip.controls: {"touchdown_angle": 1.15, "k_sc": 16e3, "k_sd": 16e3},
        slip.margin: {"parameters": P, "controls": U, "goal": (0.98, 0.0), "energy": 820.0},
        slip.steps_to_fall: {"parameters": P, "z": Z, "controls": U, "goal": Z, "limit": 2},
        slip.velocity_angle: {"z": Z},
        slip.vlo_state: {"parameters": P, "y": 0.98, "phi": 0.0, "energy": 820.0},
        slip.section_target: {"parameters": P, "section": VLO,
                              "quantities": {"height": 0.98, "energy": 820.0}},
        slip.controlled_fixed_point: {"step": MAP, "policy": lambda z: U, "start": Z},
        tc.simulate_stride: {"parameters": P, "start": "SS_av^w",
                             "state": [0.0, Z[1], Z[0], 0.0], "u": U},
        tc.example_one: {},
        tc.load_scenario: {"path": "examples/example_one.toml"},
        tc.simulate_scenario: {"scenario": SCENARIO},
        tc.load_robot: {"name": "five-link"},
        tc.PlanarBiped.from_urdf: {"path": ROBOT.path},
        state_at_vlo: {"robot": ROBOT, "z": Z, "stance": 0, "swing_position": [0.0, 0.05],
                       "swing_velocity": [2.0, 0.0]},
        tc.template_for: {"robot": ROBOT},
        tc.default_gait: {"robot": ROBOT},
        tc.robot.paper_gait: {"parameters": P},
        embedding.default_planners: {"route": ROUTE},
        embedding.standing_planners: {"parameters": P},
        embedding.standing_pose: {"parameters": P},
        run.robot_route: {"robot": ROBOT, "scenario": SCENARIO},
        run.perturbed_start: {"gait": GAIT, "seed": 1},
        run.summarise: {"record": RECORD, "path": "x"},
        tc.simulate: {"experiment": tc.Experiment(ROBOT, planner=PLANNER, steps=1)},
        sweep.grid: {"a": [1, 2]},
        sweep.sample: {"count": 2, "seed": 1, "a": (0.0, 1.0)},
        sweep.item_seed: {"seed": 1, "index": 1},
        measure: {"experiment": "no robot"},
        trial: {"experiment": {"robot": {}}, "disturbance": "noise", "level": 1.0, "number": 1},
        tc.Record.load: {"path": "nowhere"},
        tc.save_figures: {"record": "no record", "folder": folder},
        tc.save_html: {"record": "no record", "path": folder / "a.html"},
        tc.save_film: {"record": "no record", "path": folder / "a.gif"},
        tc.replay: {"record": "no record"},
        save_scenario_figures: {"record": "no record", "folder": folder},
    }  # fmt: skip
    return calls


def parameters(function, good):
    """Names of a function's parameters; of ``**names`` those that are given."""
    found = inspect.signature(function).parameters.values()
    names = [p.name for p in found if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    return [*names, *(name for name in good if name not in names)]


def files(folder):
    """Paths that a command may be given, good and bad ones; those it must not change."""
    kept = {}
    for name, content in {
        "empty.npz": b"",
        "half.npz": None,
        "text.npz": b"junk",
        "empty.toml": b"",
        "bad.toml": b'name = "\xff"',
        "list.toml": b"segment = 3",
        "short.toml": b'name = "[/x]"\n[[segment]]\ngait = "walk"\nspeed = 1.1\nsteps = 1\n',
        "bad.urdf": b"<robot/>",
        "robot.urdf": ROBOT.path.read_bytes(),
    }.items():
        kept[folder / name] = content
    good = RECORD.save(folder / "good.npz").read_bytes()
    kept[folder / "good.npz"] = good
    kept[folder / "half.npz"] = good[: len(good) // 2]
    for path, content in kept.items():
        path.write_bytes(content)
    return kept


FLAGS = {
    "walk": ("--robot", "--feet", "--sagittal-joints", "--foot-radius", "--scenario", "--gait",
             "--speed", "--planner", "--map", "--plant", "--friction", "--mass-scale",
             "--torque-scale", "--seed", "--record-every", "--json", "--push", "--noise", "--delay",
             "--touchdown-angle", "--config", "--locked"),
    "run": ("--robot", "--speed", "--apex", "--plant", "--friction", "--mass-scale",
            "--torque-scale", "--seed", "--record-every", "--json", "--push", "--noise", "--delay",
            "--config"),
    "go": ("--robot", "--plant", "--friction", "--record-every", "--json", "--push", "--config"),
    "robots": ("--json",),
    "replay": ("--speed", "--fps", "--start", "--end"),
    "plots": ("--output",),
    "robustness": ("--robot", "--disturbance", "--quick", "--json"),
    "campaign": ("--robot", "--gait", "--speed", "--plant", "--trials", "--mix", "--severity",
                 "--seed", "--json"),
    "slip": ("--map", "--json", "--no-figures"),
    "gaits": ("--gait", "--fix", "--controlled", "--start", "--over", "--limits", "--step",
              "--json"),
    "automaton": ("--json",),
    "reproduce": ("--json", "--output"),
}  # fmt: skip
"""Commands, and options that junk follows."""

ALWAYS = {
    # One step is enough to see what a command makes of its options.
    "walk": ["--steps", "1", "--no-figures"],
    "run": ["--steps", "1", "--no-figures"],
    "go": ["--steps", "1", "--no-figures"],
    "replay": ["--html", "page.html", "--no-browser"],
    # It refuses: a campaign takes minutes.
    "robustness": ["--workers", "0"],
    "campaign": ["--workers", "0"],
    "slip": ["--no-figures"],
    "gaits": ["--no-figures"],
    "automaton": ["--no-figure"],
    "reproduce": ["--no-figures"],
}
POSITIONAL = ("go", "replay", "plots", "slip", "reproduce")
WORDS = (
    "", "1", "-1", "0.5", "1.05", "nan", "inf", "1e300", "-0", "10000000000000000000000", "x",
    "[/nope]", "$x^{", "walk", "run", "paper", "modified", "exact", "ideal", "height=0.98",
    "energy=820", "speed=nan", "height=", "=", "energy", "height", "0.97", "five-link", "bolt",
    "left_foot", "left_hip", "10@0", "nan@0", "1@1:x", "os:path", "left_hip=0",
    "a\nb", "\u00fc", "/", "/dev/null", "/proc/x", ".", "--", "-h",
)  # fmt: skip


@st.composite
def command_lines(draw, folder):
    """Words of a command, most of them junk."""
    command = draw(st.sampled_from([*FLAGS, "nonsense"]))
    places = st.sampled_from([str(folder / name) for name in NAMES_OF_FILES])
    word = st.one_of(st.sampled_from(WORDS), places, st.text(max_size=4))
    line = [command]
    if command in POSITIONAL:
        line.append(draw(st.one_of(places, word)))
    flags = st.sampled_from(FLAGS.get(command, ("--x",)))
    for flag in draw(st.lists(flags, max_size=2, unique=True)):
        line += [flag, *draw(st.lists(word, max_size=4 if flag == "--sagittal-joints" else 2))]
    return [*line, *ALWAYS.get(command, ())]


NAMES_OF_FILES = (
    "empty.npz", "half.npz", "text.npz", "good.npz", "empty.toml", "bad.toml", "list.toml",
    "short.toml", "bad.urdf", "robot.urdf", "none.npz", "folder",
)  # fmt: skip
