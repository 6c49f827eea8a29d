"""Planners of walking steps, from VLO to VLO."""
