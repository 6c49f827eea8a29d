"""Walking whose speed may change at any time: a planner that looks several steps ahead."""
