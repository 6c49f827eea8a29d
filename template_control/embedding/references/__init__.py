"""What the robot is to follow: the template's path and forces, and its own swinging feet."""
