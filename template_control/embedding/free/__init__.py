"""The controller of a robot that nothing holds: the sagittal one, and what keeps it from falling
sideways and from turning.
"""
