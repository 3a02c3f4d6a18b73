"""Property names of ISO 13399 as heads of the columns of tool lists.

ISO 13399 (cutting tool data representation and exchange; the properties are those of ISO/TS 13399-3) gives every
property of a tool a symbol, with lengths in mm and angles in degrees. Makers publish their catalogues with these heads.
"""

from __future__ import annotations

from receptance.campaign.csv_rows import Symbol

TOOL_SYMBOLS = {
    "DC": Symbol("cutting diameter", "mm", "cutting diameter; the effective diameter in % is a share of it"),
    "DCX": Symbol("largest cutting diameter", "mm", "largest cutting diameter; checked, at least DC"),
    "DCON": Symbol("diameter", "mm", "connection diameter, of the shank"),
    "DCONMS": Symbol("diameter", "mm", "connection diameter on the side of the machine, of the shank"),
    "DMM": Symbol("diameter", "mm", "diameter of the shank"),
    "OAL": Symbol("overall length", "mm", "overall length; without LPR the overhang is OAL - LSC"),
    "LF": Symbol("functional length", "mm", "functional length; checked, at most OAL"),
    "LPR": Symbol("overhang", "mm", "protruding length, from the holder's face to the tip: the overhang"),
    "LSC": Symbol("clamping length", "mm", "clamping length, of the shank in the holder"),
    "LCF": Symbol("flute length", "mm", "length of the chip flutes"),
    "APMX": Symbol("depth of cut", "mm", "largest depth of cut; without LCF the length of the flutes"),
    "DN": Symbol("neck diameter", "mm", "diameter of the neck between flutes and shank"),
    "LU": Symbol("usable length", "mm", "usable length; a neck ends there"),
    "LH": Symbol("head length", "mm", "head length; without LU a neck ends there"),
    "NOF": Symbol("teeth", "", "number of flutes, for their section, and copied to the results as teeth"),
    "FHA": Symbol("helix angle", "deg", "helix angle; two flutes without a helix bend differently in x and y"),
}
"""Properties of a tool that a catalogue needs or checks, by symbol."""
HOLDER_SYMBOLS = {
    "LB": Symbol("length", "mm", "length of a cylinder of the body"),
    "BD": Symbol("outer diameter", "mm", "diameter of the body"),
    "DCB": Symbol("inner diameter", "mm", "diameter of the bore"),
}
"""Properties of a segment of a holder, by symbol."""


def symbol_table() -> str:
    """Return the table of the documentation: symbols, columns, units and meaning.

    Examples
    --------
    >>> from receptance.catalogue.iso13399 import symbol_table
    >>> print(symbol_table().splitlines()[2])
    | `DC` | `cutting diameter` | mm | cutting diameter; the effective diameter in % is a share of it |
    """
    rows = [
        f"| `{name}` | `{symbol.column}` | {symbol.unit} | {symbol.meaning} |"
        for symbols in (TOOL_SYMBOLS, HOLDER_SYMBOLS)
        for name, symbol in symbols.items()
    ]
    return "\n".join(["| symbol | column | unit | meaning |", "|---|---|---|---|", *rows])
