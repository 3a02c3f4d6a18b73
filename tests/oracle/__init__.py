"""Independent references for the numerical core: 50-digit receptances, finite elements, random models."""
