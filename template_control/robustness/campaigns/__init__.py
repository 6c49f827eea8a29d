"""Many trials with everything disturbed at once: how sure a gait is."""
