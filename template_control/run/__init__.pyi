from .options import FallOptions as FallOptions
from .options import Push as Push
from .options import SimulationOptions as SimulationOptions
from .record import Record as Record
from .sensing import SensorOptions as SensorOptions
from .simulation import perturbed_start as perturbed_start
from .simulation import simulate as simulate
from .summary import summarise as summarise
