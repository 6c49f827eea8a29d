"""Controller of a floating-base robot: the sagittal one, and balance to the side and in yaw."""
