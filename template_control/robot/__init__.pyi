from .five_link import FiveLink as FiveLink
from .five_link import Link as Link
from .library import ROBOTS as ROBOTS
from .library import load_robot as load_robot
from .library import robot_path as robot_path
from .planar_biped import PlanarBiped as PlanarBiped
from .start import state_at_vlo as state_at_vlo
