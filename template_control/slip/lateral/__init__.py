"""The lateral half of a walk in space: the template's sideways motion along its planned path."""
