"""Figs. 8 and 9: the self-stable basin and what a map's errors cost the deadbeat controller."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from template_control.paper.deadbeat import backward_set, controlled_end, inside_share, settles
from template_control.paper.reproduction import Reproduction
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.gaits.basin import steps_to_fall, velocity_angle, vlo_state
from template_control.slip.gaits.branch import BranchPoint, Special
from template_control.slip.gaits.gait import WalkingGait, gait_from_energy
from template_control.slip.gaits.gait_branch import Family
from template_control.slip.gaits.stability import Kind
from template_control.slip.parameters import SlipParameters
from template_control.sweep.executor import workers
from template_control.view.stability_figures import basin_figure, deadbeat_figure

Array = NDArray[np.float64]

P = SlipParameters()
HEIGHT, ENERGY = 0.9818, 826.0
PUBLISHED = (822.06, 827.62)
PUBLISHED_ANGLE = 70.8
_ENERGIES = np.linspace(822.06, 827.62, 12)
_HEIGHTS = np.linspace(0.945, 1.0, 129)
_ANGLES = np.linspace(-8.0, 8.0, 130)
_DISC = (5e-4, np.radians(0.05))  # radius in y [m] and phi [rad] around an equilibrium
_DIRECTIONS = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
_LEAST_ANGLES = np.linspace(60.0, 74.0, 141)
_COARSE, _FINE = 0.004, 0.0005


@cache
def equilibrium() -> WalkingGait:
    """The paper's: 0.9818 m, 826 J."""
    return gait_from_energy(P, HEIGHT, ENERGY)


def branch(step: float = _COARSE) -> list[BranchPoint]:
    """Equilibria with VLO height 0.9818 m, over energy."""
    gait = equilibrium()
    family = Family(P, "w", {"height": HEIGHT, "stiffness": P.leg_stiffness})
    start = np.array([*gait.vlo, gait.controls[0], P.leg_stiffness])
    return family.trace(start, "energy", (815.0, 830.0), step=step, points=800)


def disc_converges(energy: float) -> bool:
    """Whether 16 states around the equilibrium at an energy [J] come back to it in 50 steps."""
    gait = gait_from_energy(P, HEIGHT, energy)
    y = HEIGHT + _DISC[0] * np.cos(_DIRECTIONS)
    z = vlo_state(P, y, _DISC[1] * np.sin(_DIRECTIONS), energy)
    return bool(steps_to_fall(P, z, gait.controls, np.array([HEIGHT, 0.0])).converges.all())


def lower_limit() -> float:
    """Least energy [J] from which the disc converges, to 1e-3 J."""
    low, high = 821.0, 824.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if disc_converges(middle) else (middle, high)
    return high


def basin_slice(energy: float) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Steps to fall and convergence (angles, heights) at an energy [J]."""
    gait = gait_from_energy(P, HEIGHT, energy)
    y, phi = np.meshgrid(_HEIGHTS, np.radians(_ANGLES))
    z = vlo_state(P, y.ravel(), phi.ravel(), energy)
    result = steps_to_fall(P, z, gait.controls, np.array([HEIGHT, 0.0]))
    return result.steps.reshape(y.shape), result.converges.reshape(y.shape)


def fig8() -> Reproduction:
    """The self-stable basin of the equilibria at 0.9818 m."""
    points = branch()
    fold = next(p for p in points if p.special is Special.FOLD)
    lost = next(p for p in points if p.special is Special.SADDLE_NODE)
    torus = next(p for p in points if p.special is Special.NEIMARK_SACKER)
    low = lower_limit()
    with workers() as pool:
        slices = list(pool.map(basin_slice, _ENERGIES))
    steps, converges = (np.array([s[i] for s in slices]) for i in range(2))
    rows: list[tuple[str, ...]] = [
        (
            "upper energy limit [J]",
            f"{PUBLISHED[1]:.2f}",
            f"{fold.energy:.4f}",
            f"fold of the branch; pair of eigenvalues through the unit circle at"
            f" {torus.energy:.4f}",
        ),
        (
            "lower energy limit [J]",
            f"{PUBLISHED[0]:.2f}",
            f"{low:.3f}",
            f"steps to fall; eigenvalue through +1 at {lost.energy:.4f}",
        ),
    ]
    for energy, good in zip(_ENERGIES, converges, strict=True):
        rows.append((f"share of the slice at {energy:.2f} J", "", f"{good.mean():.3f}", ""))
    return Reproduction(
        title="Fig. 8: self-stable basin of the equilibria at y = 0.9818 m",
        columns=("", "paper", "ours", "how"),
        rows=rows,
        data={
            "fold": fold.energy,
            "fold_angle": fold.angle,
            "neimark_sacker": torus.energy,
            "eigenvalue_one": lost.energy,
            "lower_by_steps_to_fall": low,
            "energies": _ENERGIES.tolist(),
            "shares": converges.mean(axis=(1, 2)).tolist(),
            "states": int(converges.size),
        },
        notes=(
            f"{converges.size} states, up to 50 steps each: y from {_HEIGHTS[0]:g} to"
            f" {_HEIGHTS[-1]:g} m, velocity angle from {_ANGLES[0]:g} to {_ANGLES[-1]:g} degrees,"
            " at the touchdown angle of the equilibrium of the same energy.",
            "The lower limit by steps to fall asks 16 states 0.5 mm and 0.05 degrees around the"
            " equilibrium to come back; the closer one starts, the closer it is to the"
            " eigenvalue's.",
        ),
        figures={"fig8": basin_figure(_ENERGIES, _HEIGHTS, _ANGLES, steps, converges)},
    )


def fig9() -> Reproduction:
    """The one-step deadbeat set, and the share of it that each map's controller saves."""
    gait = equilibrium()
    stable = [p for p in branch(_FINE) if p.kind is Kind.STABLE]
    found = backward_set(gait, counts=(100, 400))
    settled, shares, full = {}, {}, {}
    for kind in (MapKind.PAPER, MapKind.IMPROVED, MapKind.EXACT):
        name = f"{kind.name.lower()} map"
        settled[name] = settles(controlled_end(found, gait, kind), stable, gait)
        shares[name], full[name] = inside_share(found, settled[name], np.radians(_LEAST_ANGLES))
    at = int(np.argmin(np.abs(_LEAST_ANGLES - PUBLISHED_ANGLE)))

    def row(name: str, published: str, values: list[str]) -> tuple[str, ...]:
        return (name, published, *values)

    rows = [
        row("Pz_in, whole set", "", [f"{100 * v[0]:.1f} %" for v in shares.values()]),
        row(
            f"Pz_in at alpha_min {PUBLISHED_ANGLE:g} deg",
            "100 %",
            [f"{100 * v[at]:.2f} %" for v in shares.values()],
        ),
        row(
            "alpha_min from which Pz_in >= 99.9 %",
            "",
            [f"{_least(v, 0.999):.1f} deg" for v in shares.values()],
        ),
        row(
            "alpha_min from which Pz_in = 100 %",
            f"{PUBLISHED_ANGLE:g} deg",
            [f"{np.degrees(v):.2f} deg" for v in full.values()],
        ),
        row("states that fail", "", [f"{int(np.sum(~v))}" for v in settled.values()]),
    ]
    phi = np.degrees(velocity_angle(found.state))
    return Reproduction(
        title="Fig. 9: one-step deadbeat control onto 0.9818 m, 826 J",
        columns=("", "paper", *shares),
        rows=rows,
        data={
            "states": len(found.state),
            "least_angles": np.radians(_LEAST_ANGLES).tolist(),
            **{
                name: {
                    "share": [None if np.isnan(v) else float(v) for v in shares[name]],
                    "full_from": full[name],
                    "failing": int(np.sum(~settled[name])),
                }
                for name in shares
            },
        },
        notes=(
            f"{len(found.state)} states that one exact step (kappa_2 from 0.5 to 1.5 k0, any"
            " alpha) takes onto the equilibrium. Each is stepped on the exact model with the"
            " controls that the map finds, and counts where passive walking then converges.",
            "On the paper's map a few isolated states above the paper's angle still fail; they"
            " decide where exactly 100 % is reached.",
        ),
        figures={
            "fig9": deadbeat_figure(
                found.state[:, 1], phi, settled, _LEAST_ANGLES, shares, PUBLISHED_ANGLE
            )
        },
    )


def _least(shares: Array, level: float) -> float:
    """Least alpha_min [deg] from which the share stays at or above ``level``."""
    below = np.flatnonzero(shares < level)
    return float(_LEAST_ANGLES[below[-1] + 1] if below.size else _LEAST_ANGLES[0])
