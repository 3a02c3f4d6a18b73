"""Colours of figures and of the page; this module loads no matplotlib."""

from __future__ import annotations

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
"""Those of Okabe and Ito, which readers with colour deficiencies can distinguish."""
INK = "#222222"
PALE = "#9A9A9A"
BAD = "#B2182B"
BAND = "#BBD9EC"
