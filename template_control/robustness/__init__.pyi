from .campaign import Finding as Finding
from .campaign import Level as Level
from .campaign import Robustness as Robustness
from .campaign import measure as measure
from .campaign import trial as trial
from .disturbances import DISTURBANCES as DISTURBANCES
from .disturbances import Disturbance as Disturbance
from .disturbances import Situation as Situation
