"""A record as a table, as a figure and as a short text."""

import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import template_control as tc
from template_control.errors import MissingPackageError
from template_control.run.tables import columns
from template_control.view.figures import figures_of


def test_every_quantity_of_a_sample_has_named_columns_with_units(short_walk):
    table = columns(short_walk)
    samples = len(short_walk.time)
    assert {len(column.values) for column in table.values()} == {samples}
    sampled = {
        name: np.size(value) // samples
        for name, value in vars(short_walk).items()
        if isinstance(value, np.ndarray) and len(value) == samples and "_seconds" not in name
    }
    for name, width in sampled.items():
        own = [c for c in table if c == name or c.startswith(name + "_")]
        others = [o for o in sampled if o.startswith(name + "_")]
        own = [c for c in own if not any(c == o or c.startswith(o + "_") for o in others)]
        assert len(own) == width, name
    assert len(table) == sum(sampled.values())
    unitless = {name for name, column in table.items() if not column.unit}
    assert unitless == {"node", "rear", "solved"}


def test_a_column_is_the_quantity_that_its_name_says(short_walk):
    table, r = columns(short_walk), short_walk
    knee, foot = r.joints.index("left_knee"), r.feet.index("right_foot")
    for name, values, unit in (
        ("q_pitch", r.q[:, 2], "rad"),
        ("v_x", r.v[:, 0], "m/s"),
        ("v_left_knee", r.v[:, 3 + knee], "rad/s"),
        ("torque_left_knee", r.torque[:, knee], "N m"),
        ("com_y", r.com[:, 1], "m"),
        ("contact_force_right_foot_y", r.contact_force[:, foot, 1], "N"),
        ("template_force_front_x", r.template_force[:, 1, 0], "N"),
        ("joint_left_knee_y", r.joint[:, knee, 1], "m"),
    ):
        np.testing.assert_array_equal(table[name].values, values, err_msg=name)
        assert table[name].unit == unit
    names = table["node"].values
    assert all(r.nodes[i] == name for i, name in zip(r.node, names, strict=True))


def test_a_data_frame_has_a_row_a_sample(short_walk):
    pytest.importorskip("pandas")
    frame = short_walk.to_dataframe()
    table = columns(short_walk)
    assert list(frame.columns) == list(table)
    assert frame.shape == (len(short_walk.time), len(table))
    assert frame.attrs["units"]["com_x"] == "m"
    np.testing.assert_array_equal(frame["com_x"], short_walk.com[:, 0])
    assert frame["solved"].dtype == bool


def test_without_pandas_one_line_says_what_to_install(short_walk, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingPackageError, match="pip install pandas") as caught:
        short_walk.to_dataframe()
    assert isinstance(caught.value, ImportError)


def test_an_xarray_set_names_dimensions_labels_and_units(short_walk):
    pytest.importorskip("xarray")
    found, r = short_walk.to_xarray(), short_walk
    knee = r.torque[:, r.joints.index("left_knee")]
    np.testing.assert_array_equal(found.torque.sel(joint="left_knee"), knee)
    np.testing.assert_array_equal(found.com.sel(axis="y"), r.com[:, 1])
    assert found.torque.attrs["units"] == "N m"
    assert str(found.coordinate_unit.sel(coordinate="pitch").item()) == "rad"
    np.testing.assert_array_equal(found.section_state.sel(state="dx"), r.section_state[:, 0])
    assert found.attrs["robot"] == "five-link"
    arrays = {name for name, value in vars(r).items() if isinstance(value, np.ndarray)}
    renamed = {"joint_position": "joint", "foot_position": "foot", "section_kind": "section"}
    kept = {renamed.get(str(name), str(name)) for name in found.variables}
    assert arrays <= kept


def test_without_xarray_one_line_says_what_to_install(short_walk, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(MissingPackageError, match="pip install xarray"):
        short_walk.to_xarray()


def test_a_record_draws_each_of_its_figures(short_walk):
    for name in figures_of(short_walk):
        assert isinstance(short_walk.plot(name), Figure)
    with pytest.raises(
        tc.TemplateControlError, match=r"no figure 'speed' of this run: give one of stick_"
    ):
        tc.plot(short_walk, "speed")
    with pytest.raises(tc.TemplateControlError, match="no figure 'apex_return' of this run"):
        tc.plot(short_walk, "apex_return")


def test_texts_are_short_and_say_what_it_is(short_walk, robot, default_gait):
    for thing, words in (
        (short_walk, ("Record", "five-link", "walk", "4 steps", "samples")),
        (robot, ("PlanarBiped", "80 kg", "left_knee")),
        (default_gait, ("WalkingGait", "66.00 deg", "1.100 m/s")),
        (tc.LqrPlanner(default_gait), ("LqrPlanner", "WalkingGait")),
        (tc.ModifiedPlanner(default_gait), ("ModifiedPlanner", "WalkingGait")),
        (tc.simulate_scenario(tc.example_one()), ("ScenarioRecord", "Example I", "completed")),
    ):
        text = repr(thing)
        assert len(text) < 160
        for word in words:
            assert word in text
