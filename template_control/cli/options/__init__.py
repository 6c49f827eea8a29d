"""Groups of options that commands share, and the run that they describe."""
