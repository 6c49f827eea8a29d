"""Tasks of a robot that nothing holds: what its sagittal tasks leave open."""
