"""Scenarios: a speed profile with gait switches that the template goes through."""
