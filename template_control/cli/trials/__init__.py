"""Commands that make many trials of a robot: robustness level by level, and campaigns."""
