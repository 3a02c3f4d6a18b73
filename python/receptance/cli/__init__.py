"""The command line `receptance`."""

from receptance.cli.app import main

__all__ = ["main"]
