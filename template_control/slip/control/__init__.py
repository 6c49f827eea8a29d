"""Controllers that choose the step which reaches a target at the next section."""
