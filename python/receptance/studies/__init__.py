"""Published studies with their data, done again from the numbers that were printed."""
