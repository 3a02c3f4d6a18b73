"""`python -m receptance.cli`."""

from receptance.cli import main

main()
