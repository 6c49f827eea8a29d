"""Periodic gaits: found, followed along a branch, their stability and basins."""
