"""Return maps from section to section, and their derivatives."""
