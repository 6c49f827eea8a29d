"""What the pictures of all films have in common: their size, colours, forces, legend and titles."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from matplotlib.text import Text

from template_control.view.style import LEFT, RIGHT, as_text

LEGS = (LEFT, RIGHT)
"""Colours of the legs."""

WIDTH = 2.6
"""Of the picture, in rest lengths."""


def empty_picture() -> tuple[Figure, Axes]:
    """A figure that is drawn without a display, and its axes."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Axes = figure.subplots()
    return figure, axes


def force_artist(axes: Axes, zorder: int) -> Quiver:
    """The arrows of the ground's forces on both feet.

    Args:
        axes: to draw in.
        zorder: what is drawn before and behind them.
    """
    return axes.quiver(
        [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], color=LEGS, angles="xy",
        scale_units="xy", scale=1.0, width=0.007, zorder=zorder,
    )  # fmt: skip


def named(axes: Axes, robot: str) -> Text:
    """Draw the legend and the robot's name; the title that tells the time comes back.

    Args:
        axes: with all that the legend names.
        robot: its name.
    """
    for color, name in zip(LEGS, ("left", "right"), strict=True):
        axes.plot([], [], color=color, linewidth=4, label=f"{name} leg, its ground force")
    axes.legend(loc="upper left", fontsize=7, frameon=False)
    time = axes.set_title(" ", fontsize=9, loc="right")
    axes.set_title(as_text(robot), fontsize=9, loc="left")
    return time


def keep_layout(figure: Figure) -> None:
    """Once: a layout that follows the tick labels would make the picture tremble.

    Args:
        figure: with its first frame.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
