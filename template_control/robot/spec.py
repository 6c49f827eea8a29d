"""Specification of a robot, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from template_control.checks.checked import Checked
from template_control.checks.ranges import Index, Positive
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import (
    FLAT_FEET,
    QUADRUPEDS,
    ROBOTS,
    SHIPPED,
    load_floating_robot,
    load_robot,
)
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.terms import LEGS

_OF_A_URDF = [
    "feet",
    "sagittal_joints",
    "foot_radius",
    "foot_offset",
    "locked",
    "lossless",
    "flat_feet",
]


@dataclass(frozen=True)
class RobotSpec(Checked):
    """Robot and its changes; a URDF of one's own may need those of :meth:`PlanarBiped.from_urdf`.

    Attributes:
        model: a shipped robot, or the path of a URDF.
        feet: its foot links, four of a quadruped; None: left_foot and right_foot.
        sagittal_joints: of a 3D URDF, hips and knees.
        foot_radius: of the spheres put into the feet of a 3D URDF [m].
        foot_offset: of their centres from the foot links' origins, in the links' axes [m].
        locked: angle of each locked joint of a 3D URDF [rad]; in its plane a robot's other joints
            are locked at 0.
        lossless: whether damping and friction of a URDF's joints are left out.
        free: whether nothing holds the robot; its URDF is a 3D one, and all joints that are not
            locked move. Shipped robots without a planar model are always free.
        gravity: that its model and its template have [m/s^2]; None: 9.81.
        masses: of links by name, instead of the URDF's [kg]; their inertias grow alike.
        flat_feet: whether a free robot stands on soles, as its feet's collision shapes have them;
            joints that are in no leg are then locked.
        upper_body: whether those of them that ``locked`` does not name move instead, about where
            they would be locked.
        groups: the feet of each of the template's two legs, by their places in the robot's
            ``feet``: those of a quadruped are its diagonal pairs, with which it trots, if not
            given; with the pairs of its sides it paces.
    """

    model: str = "five-link"
    feet: tuple[str, ...] | None = None
    sagittal_joints: tuple[str, ...] = ()
    foot_radius: float | None = None
    locked: Mapping[str, float] = field(default_factory=dict)
    free: bool = False
    lossless: bool = False
    foot_offset: tuple[float, float, float] | None = None
    gravity: Positive | None = None
    masses: Mapping[str, Positive] = field(default_factory=dict)
    flat_feet: bool = False
    upper_body: bool = False
    groups: tuple[tuple[Index, ...], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.model in SHIPPED and self.model not in ROBOTS:
            object.__setattr__(self, "free", True)

    @property
    def trots(self) -> bool:
        """True if the robot is a quadruped, whose pairs of legs are the template's legs."""
        return self.model in QUADRUPEDS or (self.feet is not None and len(self.feet) > LEGS)

    @property
    def stands_flat(self) -> bool:
        """True if the robot stands on soles."""
        return self.model in FLAT_FEET or self.flat_feet

    def load(self) -> Biped:
        """The robot.

        Raises:
            RobotError: if there is none, it is no such biped, it lacks a link that has a mass, or
                groups are not each foot once.
            ParameterError: if a shipped robot comes with what only a URDF needs.
        """
        robot = self._load()
        if self.gravity is None and not self.masses and not self.groups:
            return robot
        return robot.changed(self.gravity, self.masses, self.groups)

    def _load(self) -> Biped:
        """The robot as its URDF has it; see :meth:`load`."""
        own = {name: getattr(self, name) for name in _OF_A_URDF}
        given = {name: value for name, value in own.items() if value not in (None, (), {}, False)}
        if self.upper_body and not (self.free and self.stands_flat):
            raise ParameterError(
                f"{self.model} has no upper body that moves: give a floating base on flat feet, or"
                " leave upper_body out"
            )
        if not given and self.free:
            return load_floating_robot(self.model, upper_body=self.upper_body)
        if not given:
            return load_robot(self.model)
        if self.model in SHIPPED:
            names = ", ".join(name.replace("_", " ") for name in given)
            raise ParameterError(f"{names} go with a URDF, not with {self.model}: leave them out")
        if self.free:
            if self.sagittal_joints:
                raise ParameterError("sagittal joints hold a robot in its plane: leave them out")
            return FloatingBaseBiped.from_urdf(self.model, upper_body=self.upper_body, **given)
        if self.stands_flat:
            raise ParameterError("a robot in its plane has point feet: run one on flat feet free")
        return PlanarBiped.from_urdf(self.model, **given)
