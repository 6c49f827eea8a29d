"""Checks of what a user gives, by the types and ranges that fields and parameters declare."""
