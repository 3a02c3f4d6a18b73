"""Published studies, reproduced from their printed data."""
