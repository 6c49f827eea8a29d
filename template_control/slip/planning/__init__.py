"""Plans of several walking steps, of the centre of pressure, and of a step that catches."""
