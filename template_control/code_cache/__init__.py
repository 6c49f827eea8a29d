"""What is kept of compiled functions: for which content of the sources, and in which form."""
