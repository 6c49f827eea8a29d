"""Which robot runs, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from template_control.checks.checked import Checked
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.free.free_biped import FreeBiped
from template_control.robot.library import ROBOTS, load_free_robot, load_robot
from template_control.robot.planar_biped import PlanarBiped


@dataclass(frozen=True)
class RobotChoice(Checked):
    """Which robot; what a URDF of one's own may need is as in :meth:`PlanarBiped.from_urdf`.

    Attributes:
        model: a shipped robot, or the path of a URDF.
        feet: its foot links; None: left_foot and right_foot.
        sagittal_joints: of a 3D URDF, hips and knees.
        foot_radius: of the spheres put into the feet of a 3D URDF [m].
        locked: angle of each locked joint of a 3D URDF that is not at 0 [rad].
        lossless: whether damping and friction of a URDF's joints are left out.
        free: whether nothing holds the robot; its URDF is a 3D one, and all its joints move.
    """

    model: str = "five-link"
    feet: tuple[str, str] | None = None
    sagittal_joints: tuple[str, ...] = ()
    foot_radius: float | None = None
    locked: Mapping[str, float] = field(default_factory=dict)
    free: bool = False
    lossless: bool = False

    def load(self) -> Biped:
        """The robot.

        Raises:
            RobotError: if there is none, or it is no such biped.
            ParameterError: if a shipped robot comes with what only a URDF needs.
        """
        own = {
            "feet": self.feet,
            "sagittal_joints": self.sagittal_joints,
            "foot_radius": self.foot_radius,
            "locked": self.locked,
            "lossless": self.lossless,
        }
        given = {name: value for name, value in own.items() if value not in (None, (), {}, False)}
        if not given:
            return load_free_robot(self.model) if self.free else load_robot(self.model)
        if self.model in ROBOTS:
            names = ", ".join(name.replace("_", " ") for name in given)
            raise ParameterError(f"{names} go with a URDF, not with {self.model}: leave them out")
        if self.free:
            idle = [
                name.replace("_", " ") for name in ("sagittal_joints", "locked") if name in given
            ]
            if idle:
                raise ParameterError(f"{', '.join(idle)} hold a robot in its plane: leave them out")
            return FreeBiped.from_urdf(self.model, **given)  # type: ignore[arg-type]
        return PlanarBiped.from_urdf(self.model, **given)  # type: ignore[arg-type]
