"""`python -m receptance.cli`."""

from receptance.cli.app import main

main()
