"""The ground's height along x: what it is, its text, and its pieces for the engines."""
