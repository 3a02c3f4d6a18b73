"""Blind tests: effects are hidden in data from an independent simulation, and the diagnosis is scored."""
