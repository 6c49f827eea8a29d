"""Plans of several walking steps, and of the centre of pressure."""
