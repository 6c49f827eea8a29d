"""What commands that make a run do with it: keep it, and tell it."""
