"""Learners from step to step: load, momentum, lean of the trunk, friction."""
