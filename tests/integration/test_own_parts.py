"""Planners, routes and tasks of the user's own that fail: the run ends, and it is no fall."""

import re
from dataclasses import fields, replace

import numpy as np
import pytest
from places import DOCS

import template_control as tc
from template_control.cli.main import main
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import PHASES
from template_control.embedding.planners.planner import Context, Decision, Planner
from template_control.errors import DivergedError, GaitError, ParameterError
from template_control.plant.ideal import IdealOptions, IdealPlant
from template_control.run.record import Record, recorded
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Phase
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.scenario.route import SteadyRoute, StrideGoal
from template_control.whole_body.tasks import ComTask

OPTIONS = tc.Experiment(steps=4, record_every=10)


class Mine(Planner):
    """The library's planner behind a class of the user's own, which fails from a stride on."""

    def __init__(self, gait, fail=None, member="decide", after=2):
        self._inner = tc.LqrPlanner(gait)
        self._fail, self._member, self._after = fail, member, after
        self.gait, self.strides = gait, 0

    def _answer(self, member, *args):
        answer = getattr(self._inner, member)(*args)
        due = self.strides >= self._after and self._member == member
        return self._fail(answer) if due else answer

    @property
    def offset(self):
        due = self.strides >= self._after and self._member == "offset"
        return self._fail(self._inner.offset) if due else self._inner.offset

    def reset(self):
        self.strides = 0
        self._inner.reset()

    def decide(self, context):
        return self._answer("decide", context)

    def decide_rest(self, context):
        return self._answer("decide_rest", context)

    def observe(self, decision, z):
        self.strides += 1
        return self._answer("observe", decision, z)


def _bug(answer):
    return 1 / 0


def _diverges(answer):
    tc.load_robot("five-link").update(np.full(7, np.nan), np.zeros(7))


def _no_gait(answer):
    raise GaitError("no gait here")


def _five(decision):
    return Decision(decision.controls[:5], decision.predicted, True, True, True)


def _in_degrees(decision):
    angle, *stiffnesses = decision.controls
    return replace(decision, controls=np.array([np.degrees(angle), *stiffnesses]))


def _nan(decision):
    return replace(decision, controls=decision.controls * np.nan)


FAILURES = [
    ("decide", _bug, ZeroDivisionError, "division by zero"),
    ("observe", _bug, ZeroDivisionError, "division by zero"),
    ("decide_rest", _bug, ZeroDivisionError, "division by zero"),
    ("decide", _no_gait, GaitError, r"^Mine\.decide: no gait here"),
    ("decide", _diverges, ParameterError, r"^Mine\.decide: the state of five-link is not finite"),
    ("decide", lambda _: None, ParameterError, r"^Mine\.decide returned None: return a Decision"),
    (
        "decide_rest",
        lambda _: 3.0,
        ParameterError,
        r"^Mine\.decide_rest returned 3: return a Decision",
    ),
    ("decide", _five, ParameterError, r"^Mine\.decide: .*an array of 6 numbers; it has 5"),
    ("decide", _in_degrees, ParameterError, r"returned the touchdown angle 66.*: .*to pi, in rad"),
    ("decide", _nan, ParameterError, r"^Mine\.decide returned the controls \[nan, .*: return fin"),
    ("offset", lambda _: np.zeros(2), ParameterError, r"^Mine\.offset is .*: give an array of 3"),
]


@pytest.mark.parametrize(("member", "fail", "kind", "text"), FAILURES)
def test_a_planner_that_fails_ends_the_run_and_is_no_fall(
    robot, default_gait, member, fail, kind, text
):
    # Pushed in double stance, the walk chooses its stiffnesses again.
    options = replace(OPTIONS, pushes=(tc.Push(40.0, 2, 0.45),))
    with pytest.raises(kind, match=text) as caught:
        tc.simulate(replace(options, robot=robot, planner=Mine(default_gait, fail, member)))
    assert not isinstance(caught.value, DivergedError)
    if kind is ZeroDivisionError:
        assert f"It came up in Mine.{member}." in caught.value.__notes__
    record = recorded(caught.value)
    assert record.steps >= 1
    assert not record.fell
    assert not record.interrupted
    assert "Mine." in record.error
    assert "\n" not in record.error
    assert len(record.time) > 50


def test_an_error_before_the_first_tick_has_no_record(robot, default_gait):
    with pytest.raises(ZeroDivisionError) as caught:
        tc.simulate(replace(OPTIONS, robot=robot, planner=Mine(default_gait, _bug, after=0)))
    assert recorded(caught.value) is None


class Route(SteadyRoute):
    """A route that asks for something else after some strides."""

    goal = None

    def next(self, section, z, now):
        return super().next(section, z, now) if now < 0.7 else self.goal


GOALS = [
    ("wp", r"^Route\.next returned 'wp': return a StrideGoal, or None at the end"),
    (StrideGoal("trot", np.zeros(3), 0.0), r"^Route\.next asks for a stride 'trot': give one of w"),
    (StrideGoal("wp", np.zeros(2), 0.0), r"^Route\.next: the target is .* of 3 finite .* has 2"),
    (StrideGoal("wp", np.full(3, np.nan), 0.0), r"^Route\.next: the target is .* 3 finite numbers"),
    (StrideGoal("wr", np.array([2.0, 1.0]), 2.0), r"the route asks for a stride 'wr', and there"),
]


@pytest.mark.parametrize(("goal", "text"), GOALS)
def test_a_route_that_asks_for_nonsense_ends_the_run_and_is_no_fall(
    robot, default_gait, goal, text
):
    route = Route.of(default_gait)
    route.goal = goal
    planners = {"wp": tc.LqrPlanner(default_gait)}
    with pytest.raises(ParameterError, match=text) as caught:
        tc.simulate(replace(OPTIONS, robot=robot, motion=route, planner=planners))
    assert recorded(caught.value).steps == 1


class Task(ComTask):
    """The library's task, which writes another number in double stance from some time on."""

    number = 0.0

    def write(self, robot, references, rows):
        super().write(robot, references, rows)
        if robot.com[0] > 0.8:
            rows.desired[0] = self.number() if callable(self.number) else self.number


@pytest.mark.parametrize(
    ("number", "kind", "text"),
    [
        (np.nan, ParameterError, r"^Task\.write wrote a number that is not finite"),
        (np.inf, ParameterError, r"^Task\.write wrote a number that is not finite"),
        (lambda _: 1 / 0, ZeroDivisionError, "division by zero"),
        (_no_gait, GaitError, r"^Task\.write: no gait here"),
    ],
)
def test_a_task_that_fails_ends_the_run_and_is_no_fall(
    robot, default_gait, monkeypatch, number, kind, text
):
    monkeypatch.setattr(Task, "number", number)
    stance = PHASES[Phase.DS]
    tasks = (Task((1.0, 3.0)), *stance.tasks[1:])
    phases = {**PHASES, "DS_sd^wp": replace(PHASES["DS_sd^wp"], tasks=tasks)}
    options = replace(OPTIONS, controller=EmbeddingOptions(phases=phases))
    with pytest.raises(kind, match=text) as caught:
        tc.simulate(replace(options, robot=robot, planner=tc.LqrPlanner(default_gait)))
    assert recorded(caught.value).steps >= 1


class Nowhere:
    """A plant that loses its state."""

    time_step = 1e-3

    def __init__(self, inner, ticks, error=None):
        self._inner, self._left, self._error = inner, ticks, error

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def step(self, torque, push=0.0):
        self._left -= 1
        if self._error is not None and self._left < 0:
            raise self._error
        self._inner.step(torque, push)

    def read(self, q, v):
        self._inner.read(q, v)
        if self._error is None and self._left < 0:
            q[1] = np.nan


@pytest.mark.parametrize("error", [None, DivergedError("lost it")])
def test_a_state_that_is_not_finite_is_a_fall(robot, default_gait, error):
    plant = Nowhere(IdealPlant(tc.load_robot("five-link"), IdealOptions()), 40, error)
    record = tc.simulate(
        replace(replace(OPTIONS, world=plant), robot=robot, planner=tc.LqrPlanner(default_gait))
    )
    assert record.fell
    assert re.match("the simulation diverged at 0.0", record.fall_reason)


def test_another_error_of_a_plant_is_no_fall(robot, default_gait):
    plant = Nowhere(
        IdealPlant(tc.load_robot("five-link"), IdealOptions()), 40, ParameterError("no licence")
    )
    with pytest.raises(ParameterError, match="no licence") as caught:
        tc.simulate(
            replace(replace(OPTIONS, world=plant), robot=robot, planner=tc.LqrPlanner(default_gait))
        )
    assert recorded(caught.value).error == "no licence"


def test_what_a_planner_lacks_is_named(robot):
    class Lame(Planner):
        def decide(self, context):
            raise AssertionError("it is not asked")

    with pytest.raises(ParameterError, match=r"or a Planner \(this one lacks gait\)"):
        tc.simulate(tc.Experiment(robot, planner=Lame()))
    with pytest.raises(TypeError, match="decide"):
        type("Idle", (Planner,), {})()


def test_a_planner_without_the_base_class_is_told_to_derive_from_it(robot, default_gait):
    members = {name: lambda *_: None for name in ("offset", "reset", "decide", "observe", "cost")}
    bare = type("Bare", (), {"gait": default_gait, **members})()
    text = r"a Planner \(this one lacks .*forget.*: derive it from Planner\)"
    with pytest.raises(ParameterError, match=text):
        tc.simulate(tc.Experiment(robot, planner=bare))


@pytest.mark.parametrize("run", [False, True])
@pytest.mark.parametrize("name", ["bolt", "rabbit"])
def test_a_gait_of_another_robot_names_both_templates(default_gait, name, run):
    other = tc.load_robot(name)
    gait = running_gait(tc.SlipParameters(), 3.0) if run else default_gait
    planner = tc.RunningPlanner(gait) if run else tc.LqrPlanner(gait)
    own = tc.template_for(other)
    text = rf"a template of 80 kg, l0 = 1 m .* {name} has {own.mass:.4g} kg, l0 = "
    with pytest.raises(ParameterError, match=text):
        tc.simulate(tc.Experiment(other, planner=planner))


MODULE = """
import numpy as np
import template_control as tc

class Bad(tc.LqrPlanner):
    calls = 0
    def decide(self, *args, **named):
        type(self).calls += 1
        found = super().decide(*args, **named)
        return found if type(self).calls < 12 else {answer}
"""


@pytest.mark.parametrize(
    ("answer", "line", "traced"),
    [
        ("None", "Bad.decide returned None: return a Decision", False),
        ("1 / 0", "ZeroDivisionError: division by zero. It came up in Bad.decide.", True),
    ],
)
def test_the_command_line_tells_one_line_and_keeps_the_run(
    tmp_path, monkeypatch, capsys, answer, line, traced
):
    name = f"bad_planner_{traced}".lower()
    (tmp_path / f"{name}.py").write_text(MODULE.replace("{answer}", answer), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    words = ["walk", "--planner", f"{name}:Bad", "--steps", "9", "--output", "out"]
    assert main(words) == 2
    told = capsys.readouterr().err
    last = told.splitlines()[-1]
    assert last == f"template-control: {line}; the run up to here is in out/run.npz"
    assert ("Traceback" in told) is traced
    assert (f'{name}.py", line' in told) is traced, "leads into the user's own code"
    record = Record.load(tmp_path / "out" / "run.npz")
    assert record.error == line
    assert record.steps >= 1
    assert (tmp_path / "out" / "run.toml").exists()


# ---- what the page says


def _table(page, heading):
    """First column of the table in a page whose head has a word."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    start = lines.index(heading) + 2
    rows = []
    for line in lines[start:]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def test_the_pages_tables_have_every_field_and_number():
    members, context, decision = [
        _table("guides/your_planner.md", "| member | what it is |"),
        _table("guides/your_planner.md", "| in a context | what it is |"),
        _table("guides/your_planner.md", "| field | what it is |"),
    ]
    public = {name for name in (*vars(Planner), *Planner.__annotations__) if name[0] != "_"}
    assert {re.sub(r"\(.*", "", row[0].strip("`")) for row in members} == public
    assert [row[0].strip("`") for row in context] == list(Context._fields)
    assert [row[0].strip("`") for row in decision] == [f.name for f in fields(Decision)]
    words = {5: "five", 6: "six", 7: "seven"}
    assert decision[0][1].startswith(f"{words[NUM_SLOTS]} numbers by `Slot`")


def test_no_docstring_tells_another_number_of_controls():
    library = DOCS.parent / "template_control"
    wrong = re.compile(r"\b(?:controls|u): \((\d+),\)")
    found = [
        f"{path}: {match.group()}"
        for path in library.rglob("*.py")
        for match in wrong.finditer(path.read_text(encoding="utf-8"))
    ]
    assert not found
