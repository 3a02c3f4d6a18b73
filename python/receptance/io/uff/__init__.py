"""Universal files with data set 58 and 58b."""
