"""The laboratory: it hides effects in data from its own physics, and scores who finds them."""
