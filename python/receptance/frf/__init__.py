"""Measured frequency response functions."""

from receptance.frf.frf import FRF, form_factor

__all__ = ["FRF", "form_factor"]
