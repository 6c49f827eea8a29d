"""What is learnt from step to step: the load, and the drift that no control cancels."""
