"""Walking gaits that vary continuously with speed, and how they were made."""
