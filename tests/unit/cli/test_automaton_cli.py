"""``template-control automaton``: table, JSON and figure are the data, whatever it is."""

import dataclasses
import itertools
import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.patches import Circle, FancyArrowPatch
from places import ROOT

from template_control.cli.automaton import describe
from template_control.cli.main import main
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Event, Outcome, Phase, Reset, Slot
from template_control.view.automaton_figure import (
    automaton_figure,
    choices,
    edge_label,
    gaits,
    mathtext,
    successions,
)
from template_control.view.style import save_figure


def node(name, *edges, phase=Phase.SS):
    return Node(name, phase, Slot.K_SC, None, edges)


HOPPER = Automaton(
    (
        node("F_x^h", Edge(Event.TOUCHDOWN, "SS_x^h", Reset.PLACE_REAR, "G_t^h"), phase=Phase.F),
        node(
            "SS_x^h",
            Edge(Event.APEX, "F_x^h", guard="G_a^h", section=True),
            Edge(Event.FALL, Outcome.FALL),
        ),
        node("SS_y^s", Edge(Event.VLO, "SS_y^s", guard="G_v^s", section=True)),
    ),
    starts={"h": "F_x^h", "s": "SS_y^s"},
)


def read(description):
    """The automaton a JSON description tells of."""
    return Automaton(
        tuple(
            Node(
                n["name"],
                Phase[n["phase"]],
                n["rear"] and Slot[n["rear"]],
                n["front"] and Slot[n["front"]],
                tuple(
                    Edge(
                        Event[e["event"]],
                        e["target"] if "target" in e else Outcome[e["failure"]],
                        Reset[e["reset"]],
                        e["guard"],
                        e["section"],
                    )
                    for e in n["edges"]
                ),
            )
            for n in description["nodes"]
        ),
        description["starts"],
    )


def with_edge(name, event, **changes):
    """The library's automaton with one edge changed."""
    return Automaton(
        tuple(
            dataclasses.replace(
                n,
                edges=tuple(
                    dataclasses.replace(e, **changes) if e.event is event else e for e in n.edges
                ),
            )
            if n.name == name
            else n
            for n in AUTOMATON.nodes
        ),
        STRIDE_START,
    )


@cache
def drawn(automaton):
    """Its figure, drawn once for all who only look at it."""
    return automaton_figure(automaton)


def labels(figure):
    return sorted(text.get_text() for text in figure.axes[0].texts)


def arrows(figure):
    return [patch for patch in figure.axes[0].patches if isinstance(patch, FancyArrowPatch)]


def circles(figure):
    return [patch for patch in figure.axes[0].patches if isinstance(patch, Circle)]


def label_of(automaton, edge, name):
    """What stands next to an edge of the node ``name``: where it leads to, if not in its gait."""
    inside = automaton.node(edge.target).gait == automaton.node(name).gait
    leaves = edge.target == name or not inside
    return edge_label(edge) + (f"\nto {mathtext(edge.target)}" if leaves else "")


@pytest.mark.slow(seconds=1)
def test_json_is_all_there_is_on_stdout_and_equals_the_data(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "template_control.cli.main", "automaton", "--json", "--no-figure"],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=tmp_path,
        env={"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr
    assert read(json.loads(done.stdout)) == AUTOMATON
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("automaton", [AUTOMATON, HOPPER], ids=["library", "hopper"])
def test_description_survives_json(automaton):
    description = json.loads(json.dumps(describe(automaton)))
    assert read(description) == automaton
    reasons = {e["reason"] for n in description["nodes"] for e in n["edges"] if "failure" in e}
    ends = {e.target for n in automaton.nodes for e in n.edges if isinstance(e.target, Outcome)}
    assert reasons == {outcome.reason for outcome in ends}


@pytest.mark.slow(seconds=5)
def test_table_names_every_node_guard_and_failure(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)  # pytest's workers have one: names would wrap
    assert main(["automaton"]) == 0
    assert (tmp_path / "runs" / "automaton.png").read_bytes().startswith(b"\x89PNG")
    out = capsys.readouterr().out
    rows = {line.split("│")[1].strip() for line in out.splitlines() if line.startswith("│")}
    assert rows - {""} == {n.name for n in AUTOMATON.nodes}
    for _, target, edge in successions(AUTOMATON):
        assert f"-> {target}" in out
        assert f" {edge.guard} " in out
    assert "no leg touched down in time" in out
    assert "k_sd_wr" in out
    assert str(Path("runs/automaton.png")) in out


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["PNG", "svg", "pdf"])
def test_figure_is_written_into_a_new_folder(suffix, tmp_path, capsys):
    path = tmp_path / "new" / "deep" / f"fig.{suffix}"
    assert main(["automaton", "--json", "--output", str(path)]) == 0
    json.loads(capsys.readouterr().out)
    magic = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix.lower()]
    assert path.read_bytes().startswith(magic)


@pytest.mark.parametrize(
    "automaton",
    [pytest.param(AUTOMATON, marks=pytest.mark.slow), HOPPER],
    ids=["library", "hopper"],
)
def test_file_holds_every_node_guard_and_no_more_arrows(automaton, tmp_path):
    save_figure(automaton_figure(automaton), tmp_path / "fig.svg")
    svg = (tmp_path / "fig.svg").read_text()  # texts are outlines with their source beside
    edges = list(successions(automaton))
    for name in [n.name for n in automaton.nodes] + [e.guard for _, _, e in edges]:
        assert f"<!-- {mathtext(name)} -->" in svg
    figure = drawn(automaton)
    wanted = [label_of(automaton, edge, name) for name, _, edge in edges]
    assert [text for text in labels(figure) if text.split("\n")[0] in
            {label.split("\n")[0] for label in wanted}] == sorted(wanted)  # fmt: skip
    assert len(arrows(figure)) == len(edges)
    for first, second in choices(automaton):
        assert any("instead of" in text and mathtext(first) in text for text in labels(figure)), (
            second
        )


def test_names_are_the_papers():
    assert mathtext("SS_sc^w") == "$SS_{sc}^{w}$"
    assert edge_label(Edge(Event.VLO, "SS_av^w", guard="G_v^w", section=True)) == (
        "$G_{v}^{w}$\nVLO"
    )
    assert edge_label(Edge(Event.TOUCHDOWN, "DS_sc^w", Reset.PLACE_FRONT, "G_t^w")) == (
        "$G_{t}^{w}$\nplace front"
    )


def test_gaits_begin_where_their_strides_do():
    found = gaits(AUTOMATON)
    assert {gait: names[0] for gait, names in found.items()} == STRIDE_START
    assert sorted(itertools.chain(*found.values())) == sorted(n.name for n in AUTOMATON.nodes)
    assert found["w"] == tuple(n.name for n in AUTOMATON.stride(STRIDE_START["w"]))


def test_transitions_are_chosen_at_their_own_section():
    starts = STRIDE_START
    assert set(choices(AUTOMATON)) == {
        (starts["w"], starts["wr"]),
        (starts["w"], starts["wr*"]),
        (starts["wp"], starts["wr"]),
        (starts["wp"], starts["wr*"]),
        (starts["wp"], starts["ws"]),
        (starts["wp"], starts["ww"]),
        (starts["r"], starts["rw"]),
        (starts["hr"], starts["rw"]),
        (starts["w"], starts["ws"]),
        (starts["w"], starts["ww"]),
        (starts["s"], starts["sw"]),
        (starts["s"], starts["sf"]),
        (starts["s"], starts["sb"]),
    }


@pytest.mark.parametrize(
    "automaton",
    [pytest.param(AUTOMATON, marks=pytest.mark.slow(seconds=2)), HOPPER],
    ids=["library", "hopper"],
)
def test_nothing_hides_anything(automaton):
    figure = drawn(automaton)
    axes = figure.axes[0]
    boxes = [(text.get_text(), text.get_window_extent()) for text in axes.texts]
    boxes.append(("legend", axes.get_legend().get_window_extent()))
    for (one, a), (other, b) in itertools.combinations(boxes, 2):
        assert not a.overlaps(b), (one, other)
    nodes = {mathtext(n.name) for n in automaton.nodes}
    centre = axes.transData.transform([circle.center for circle in circles(figure)])
    radius = np.ptp(circles(figure)[0].get_window_extent().intervalx) / 2.0
    for text, box in boxes:
        assert figure.bbox.contains(*box.min), text
        assert figure.bbox.contains(*box.max), text
        gap = np.linalg.norm(np.clip(centre, box.min, box.max) - centre, axis=1)
        assert (gap < radius).sum() == (text in nodes), text
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(centre, 2)]
    assert min(apart) > 2 * radius
    places = np.array([circle.center for circle in circles(figure)])
    for arrow in arrows(figure):
        begin = arrow.get_path().vertices[0]
        away = np.linalg.norm(places - begin, axis=1)
        assert away.min() == pytest.approx(circles(figure)[0].radius), "it begins at a rim"


@pytest.mark.slow
def test_section_edges_stand_out():
    section, others = (
        [a for a in arrows(drawn(AUTOMATON)) if (a.get_linewidth() > 2.0) is wide]
        for wide in (True, False)
    )
    edges = [edge for _, _, edge in successions(AUTOMATON)]
    assert len(section) == sum(edge.section for edge in edges)
    assert not same_color(section[0].get_edgecolor(), others[0].get_edgecolor())


@pytest.mark.slow
def test_the_data_make_the_figure():
    before = drawn(AUTOMATON)
    renamed = automaton_figure(with_edge("SS_sd^r", Event.REAR_LIFTOFF, guard="G_q^r"))
    assert mathtext("G_q^r") + "\nswap" in labels(renamed)
    assert not any(text.startswith(mathtext("G_l^r")) for text in labels(renamed))
    sent = automaton_figure(with_edge("SS_sd^hr", Event.REAR_LIFTOFF, target="F_ba^r"))
    new, old = set(labels(sent)) - set(labels(before)), set(labels(before)) - set(labels(sent))
    assert {text.partition("\nto ")[0] for text in new} >= old
    assert any(text.endswith(f"to {mathtext('F_ba^r')}") for text in new)
    without = automaton_figure(with_edge("DS_sc^w", Event.REAR_LIFTOFF, target=Outcome.FALL))
    assert len(arrows(without)) == len(arrows(before)) - 1


@pytest.mark.parametrize(
    ("output", "culprit"),
    [
        ("fig.jpg", "fig.jpg"),
        ("fig", "fig"),
        ("/proc/none/fig.png", "/proc/none/fig.png"),
        ("file/fig.png", "file/fig.png"),
        pytest.param("folder.png", "folder.png", marks=pytest.mark.slow),
    ],
)
def test_a_bad_output_is_one_line(output, culprit, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    (tmp_path / "folder.png").mkdir()
    line = refused(["automaton", "--output", output])
    assert culprit in line
    assert "give a" in line


def test_a_name_that_is_too_long_is_one_line(tmp_path, refused):
    path = tmp_path / ("x" * 300 + ".png")
    assert "give another --output" in refused(["automaton", "--output", str(path)])
