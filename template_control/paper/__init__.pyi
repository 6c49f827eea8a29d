from .reproduction import REPRODUCTIONS as REPRODUCTIONS
from .reproduction import Reproduction as Reproduction
