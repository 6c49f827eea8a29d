from .executor import workers as workers
from .many import simulate_many as simulate_many
from .sweep import SweepOptions as SweepOptions
from .sweep import SweepResult as SweepResult
from .sweep import grid as grid
from .sweep import item_seed as item_seed
from .sweep import sample as sample
from .sweep import sweep as sweep
