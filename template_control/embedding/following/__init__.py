"""What a tick follows the plan with: the place on the path, the feet in the air, the ground."""
