"""Options know the dimension of every number, and one function scales any of them."""

from dataclasses import dataclass, fields, is_dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.planners.modified import ModifiedOptions
from template_control.robot.library import load_robot
from template_control.robot.template import template_for
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import (
    ACCELERATION,
    LENGTH,
    NUMBER,
    PER_ACCELERATION_SQUARED,
    RATE,
    SPEED,
    TIME,
    Scale,
    scaled,
    tuned,
)

TUNINGS = (EmbeddingOptions(), LqrOptions(), ModifiedOptions())


def dimensions_of(options):
    """By field; those without any are left out."""
    return {f.name: f.metadata["dimension"] for f in fields(options) if "dimension" in f.metadata}


def numbers(value):
    """The numbers in a field's value."""
    if isinstance(value, tuple):
        return [n for entry in value for n in numbers(entry)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []


def parts(options):
    """The options, and all options inside them."""
    yield options
    for f in fields(options):
        value = getattr(options, f.name)
        inside = value.values() if isinstance(value, dict) else (value,)
        for one in [
            x for entry in inside for x in (entry if isinstance(entry, tuple) else (entry,))
        ]:
            if is_dataclass(one):
                yield from parts(one)


@pytest.mark.parametrize("options", TUNINGS, ids=lambda o: type(o).__name__)
def test_every_tuned_number_has_a_dimension(options):
    named = {
        "leg",
        "map_kind",
        "swings",
        "unload_legs",
        "momentum_speed",
        "estimate_load",
        "trim_momentum",
        "clock",
    }
    for part in parts(options):
        known = dimensions_of(part)
        for f in fields(part):
            value = getattr(part, f.name)
            if numbers(value) and f.name not in named:
                assert f.name in known, f"{type(part).__name__}.{f.name}"
                count = len(known[f.name])
                rows = (
                    value if isinstance(value, tuple) and isinstance(value[0], tuple) else [value]
                )
                assert all(count in (1, len(numbers(row))) for row in rows)


@dataclass(frozen=True)
class Inner:
    delay: float = tuned(0.1, TIME)
    share: float = tuned(0.5)


@dataclass(frozen=True)
class Outer:
    height: float = tuned(0.05, LENGTH)
    gains: tuple[float, float] = tuned((60.0, 16.0), RATE, SPEED)
    table: tuple[tuple[float, float], ...] = tuned(((1.0, 2.0), (3.0, 4.0)), NUMBER, LENGTH)
    absent: float | None = tuned(None, LENGTH)
    inner: Inner = Inner()
    several: tuple[Inner, ...] = (Inner(), Inner(1.0))
    name: str = "as it is"


def test_each_number_is_scaled_by_its_dimension():
    small = scaled(Outer(), Scale(length=0.25, time=0.5))
    assert small.height == 0.0125
    assert small.gains == (120.0, 8.0)
    assert small.table == ((1.0, 0.5), (3.0, 1.0))
    assert small.absent is None
    assert small.inner == Inner(0.05, 0.5)
    assert small.several == (Inner(0.05, 0.5), Inner(0.5, 0.5))
    assert small.name == "as it is"


def test_the_tasks_in_the_table_of_phases_are_scaled_too():
    scale = Scale(length=0.25, time=0.5)
    table = EmbeddingOptions().phase_table()
    options = scaled(EmbeddingOptions(phases=table), scale)
    for phase, control in table.items():
        for task, other in zip(control.tasks, options.phases[phase].tasks, strict=True):
            if hasattr(task, "gains"):
                assert other.gains == (task.gains[0] * 4.0, task.gains[1] * 2.0)
            ratio = np.divide(other.weights, task.weights)
            known = dimensions_of(task)["weight"][0]
            np.testing.assert_allclose(ratio, scale.factor(known))


@given(length=st.floats(0.05, 20.0), gravity=st.floats(1.0, 30.0))
def test_units_follow_from_length_and_gravity(length, gravity):
    p = SlipParameters(80.0, gravity, length, 16.5e3)
    scale = Scale.of(p)
    assert scale.factor(NUMBER) == 1.0
    assert scale.factor(LENGTH) == pytest.approx(length)
    # The unit of accelerations is g, that of speeds sqrt(g l0).
    assert scale.factor(ACCELERATION) == pytest.approx(gravity / 9.81)
    assert scale.speed == pytest.approx(np.sqrt(gravity * length / 9.81))
    assert scale.factor(PER_ACCELERATION_SQUARED) == pytest.approx((9.81 / gravity) ** 2)
    there = scaled(LqrOptions(), scale)
    back = scaled(there, Scale(1.0 / scale.length, 1.0 / scale.time))
    np.testing.assert_allclose(back.state_cost, LqrOptions().state_cost)
    np.testing.assert_allclose(back.tolerance, LqrOptions().tolerance)
    # A cost is the same for states that are alike.
    cost = np.dot(there.state_cost, np.square(there.tolerance))
    assert cost == pytest.approx(np.dot(LqrOptions().state_cost, np.square(LqrOptions().tolerance)))


def test_the_reference_template_is_tuned_as_written():
    assert scaled(EmbeddingOptions(), Scale.of(SlipParameters())) == EmbeddingOptions()


def test_the_reference_template_is_five_link_s():
    """The stretch of the leg at touchdown is chosen so."""
    found, reference = template_for(load_robot("five-link")), SlipParameters()
    for f in fields(reference):
        assert getattr(found, f.name) == pytest.approx(getattr(reference, f.name), rel=1e-12)
