"""The bodies of a PyBullet world: the robot's, as its URDF has it, and the ground's."""

from __future__ import annotations

import tempfile
from pathlib import Path
from xml.etree import ElementTree

from template_control.errors import RobotError
from template_control.plant.c_locale import decimal_points
from template_control.plant.quiet import silenced
from template_control.plant.terrain.pieces import pieces
from template_control.plant.terrain.terrain import Terrain
from template_control.robot.biped import Biped

with silenced():  # PyBullet announces its build time on standard output or stderr
    import pybullet

# By default Bullet recomputes inertias from shapes; pictures it does not draw it need not read.
_FLAGS = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_IGNORE_VISUAL_SHAPES


def load_body(robot: Biped, client: int, held: bool = True) -> int:
    """Body of a robot's URDF; PyBullet only reads files.

    Args:
        robot: whose URDF.
        client: PyBullet's handle of the world.
        held: whether the root link is fixed to the world.

    Raises:
        RobotError: if PyBullet does not read it.
    """
    tree = ElementTree.fromstring(robot.urdf)
    for link in tree.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)  # which PyBullet would read all the same
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_bytes(ElementTree.tostring(tree, encoding="utf-8"))
        try:
            with decimal_points():
                body = pybullet.loadURDF(
                    str(path), useFixedBase=held, flags=_FLAGS, physicsClientId=client
                )
        except pybullet.error as error:
            raise RobotError(f"PyBullet does not read {robot.path} ({error}): change it") from None
    return int(body)


def ground_bodies(terrain: Terrain, client: int) -> dict[int, float | None]:
    """Make the ground's bodies.

    Args:
        terrain: the ground.
        client: PyBullet's handle of the world.

    Returns:
        The friction of each body; None: that of the plant's options.
    """
    p = pybullet

    def body(shape: int, position: tuple[float, float, float], pitch: float = 0.0) -> int:
        turn = p.getQuaternionFromEuler((0.0, pitch, 0.0))
        made = p.createMultiBody(
            0, shape, basePosition=position, baseOrientation=turn, physicsClientId=client
        )
        return int(made)

    height, stand_out = pieces(terrain)
    plane = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client)
    found: dict[int, float | None] = {body(plane, (0.0, 0.0, height)): None}
    for piece in stand_out:
        sides = piece.half_sides
        box = p.createCollisionShape(p.GEOM_BOX, halfExtents=sides, physicsClientId=client)
        found[body(box, piece.centre, piece.pitch)] = piece.friction
    return found
