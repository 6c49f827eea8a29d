"""Planners: which step of the template the robot takes next."""
