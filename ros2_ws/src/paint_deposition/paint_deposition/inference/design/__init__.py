"""What to measure and to spray next, so that missing effects are found soonest."""
