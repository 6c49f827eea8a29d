"""What a run of a planar robot and one of a free robot do not share."""
