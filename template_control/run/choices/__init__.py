"""What a run is made of, as data: which robot, which gait, which planner."""
