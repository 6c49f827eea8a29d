"""Bipeds that nothing holds: six degrees of freedom in the base."""
