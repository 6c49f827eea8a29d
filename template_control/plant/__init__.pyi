from .bullet import BulletPlant as BulletPlant
from .bullet import PlantOptions as PlantOptions
from .ground import GroundStep as GroundStep
from .ideal import IdealOptions as IdealOptions
from .ideal import IdealPlant as IdealPlant
from .plant import Plant as Plant
from .plant import open_plant as open_plant
