"""Worlds in which nothing holds a robot."""
