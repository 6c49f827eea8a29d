from .record import Record as Record
from .sensing import SensorOptions as SensorOptions
from .simulation import FallOptions as FallOptions
from .simulation import Push as Push
from .simulation import SimulationOptions as SimulationOptions
from .simulation import perturbed_start as perturbed_start
from .simulation import simulate as simulate
from .summary import summarise as summarise
