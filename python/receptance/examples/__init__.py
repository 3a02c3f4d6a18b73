"""Complete campaigns that are part of the package."""

from receptance.examples.catalogue import EXAMPLES, Example, write

__all__ = ["EXAMPLES", "Example", "write"]
