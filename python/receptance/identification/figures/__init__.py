"""Figures of identifications, profiles, samples, predictions, transfers, inverse couplings and next measurements."""
