"""Figures of many trials: robustness level by level, and campaigns."""
