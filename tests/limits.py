"""The limit of time of the tests."""

LIMIT_S = 1800.0
"""Longest wait for what takes seconds on an idle machine: on a slow or busy one, only what never ends takes longer."""
