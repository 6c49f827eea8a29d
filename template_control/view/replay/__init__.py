"""Replays of a recorded run: in the browser, as a page, as a film."""
