from .solver import Solution as Solution
from .solver import WholeBodyQp as WholeBodyQp
from .tasks import Gains as Gains
from .tasks import TaskStack as TaskStack
from .tasks import Weights as Weights
