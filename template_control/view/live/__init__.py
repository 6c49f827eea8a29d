"""Page on which a robot is driven while it walks."""
