"""The hybrid automaton of all gaits, as data."""
