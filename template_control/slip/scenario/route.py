from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from typing import Protocol
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.maps.section import section_of
@dataclass(frozen=True)
class StrideGoal:
    stride: str
    target: object
    wanted_speed: float
    segment: int = 0
class Route(Protocol):
    endless: bool
class SteadyRoute:
    endless=True
    def __init__(self, parameters, stride, target, start=None, automaton=AUTOMATON):
        self.parameters=parameters; self.goal=StrideGoal(stride,np.array(target),float(target[0]))
        self.start=np.array(target if start is None else start)
        self.section=section_of(automaton.sections(automaton.starts[stride])[0])
    def reset(self): pass
    def next(self, section, z, now): return self.goal
    def ahead(self, section, z, now): return self.goal
