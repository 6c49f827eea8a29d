"""What differs from one kind of robot to another: controller, start, plant and recorder."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.planner import Planner, Planners
from template_control.plant.plant import Plant, World
from template_control.run.options import SimulationOptions
from template_control.run.recorder import Recorder
from template_control.run.sensing import Senses
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.scenario.route import Route

Array = NDArray[np.float64]


class Kind(ABC):
    """How robots of one kind are run; a robot comes with it."""

    @abstractmethod
    def controller(
        self,
        planners: Planners | Planner,
        options: EmbeddingOptions,
        route: Route,
        automaton: Automaton,
    ) -> EmbeddingController:
        """The robot's controller.

        Args:
            planners: one for each kind of stride of the route, or one.
            options: tuning.
            route: which stride comes next.
            automaton: of the route's strides.
        """

    @abstractmethod
    def start(self, controller: EmbeddingController, o: SimulationOptions) -> tuple[Array, Array]:
        """Start the controller where the run begins, and tell (q, v) there.

        Args:
            controller: of the robot.
            o: how the run goes.

        Raises:
            ParameterError: if it is not clear where the feet are.
        """

    @abstractmethod
    def plant(self, world: World) -> AbstractContextManager[Plant]:
        """The robot in a world.

        Args:
            world: options of a plant, or a plant.
        """

    @abstractmethod
    def senses(self, controller: EmbeddingController, o: SimulationOptions) -> Senses:
        """What tells the controller the state.

        Args:
            controller: of the robot.
            o: how the run goes.
        """

    @abstractmethod
    def force(self, along: float, aside: float) -> tuple[float, ...]:
        """A push as the robot's plant takes it, after the torques.

        Args:
            along, aside: forward, and to the left [N].
        """

    @abstractmethod
    def recorder(self, controller: EmbeddingController, every: int) -> Recorder:
        """What records the run.

        Args:
            controller: of the robot.
            every: keeps every n-th tick.
        """
