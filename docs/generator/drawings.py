"""Drawings of the page on basics, as SVG: `python docs/generator/drawings.py` writes them to docs/images.

They are kept in the repository, because the page shows them wherever it is read. A test draws them again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Segment

__all__ = ["DRAWINGS", "FOLDER"]

FOLDER = Path(__file__).resolve().parents[1] / "images"
TOOL, HOLDER, SPINDLE = "#9CC7E4", "#D9D9D9", "#F0E4C8"
LINE, ACCENT, SECOND = "#222222", "#D55E00", "#0072B2"


def _svg(width: int, height: int, title: str, *shapes: str) -> str:
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
            'font-family="DejaVu Sans, Arial, sans-serif" font-size="14">',
            f"<title>{title}</title>",
            '<defs><marker id="a" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
            'orient="auto-start-reverse"><path d="M0 0 8 4 0 8z" fill="context-stroke"/></marker></defs>',
            f'<rect width="{width}" height="{height}" fill="white"/>',
            *shapes,
            "</svg>\n",
        ]
    )


def _box(x: float, y: float, width: float, height: float, fill: str) -> str:
    return f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" fill="{fill}" stroke="{LINE}"/>'


def _shape(points: str, fill: str) -> str:
    return f'<polygon points="{points}" fill="{fill}" stroke="{LINE}"/>'


def _path(d: str, colour: str = LINE, width: float = 1.5, more: str = "") -> str:
    return f'<path d="{d}" fill="none" stroke="{colour}" stroke-width="{width:g}" {more}/>'.replace(" />", "/>")


def _text(x: float, y: float, words: str, anchor: str = "middle", colour: str = LINE, more: str = "") -> str:
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" fill="{colour}" {more}>{words}</text>'.replace(" >", ">")


def _arrow(x1: float, y1: float, x2: float, y2: float, colour: str = ACCENT) -> str:
    return _path(f"M{x1:g} {y1:g} L{x2:g} {y2:g}", colour, 2.5, 'marker-end="url(#a)"')


def _span(x1: float, x2: float, y: float, words: str) -> str:
    """Return a dimension line with its name below."""
    ends = "".join(_path(f"M{x:g} {y - 8:g} V{y + 8:g}", width=1) for x in (x1, x2))
    both = 'marker-start="url(#a)" marker-end="url(#a)"'
    return ends + _path(f"M{x1:g} {y:g} H{x2:g}", width=1, more=both) + _text((x1 + x2) / 2, y + 20, words)


def _spring(x: float, y1: float, y2: float, colour: str = SECOND) -> str:
    """Return a vertical spring."""
    turns, lead = 6, 8.0
    step = (y2 - y1 - 2 * lead) / turns
    zigzag = " ".join(f"L{x + (9 if i % 2 else -9):g} {y1 + lead + (i + 0.5) * step:g}" for i in range(turns))
    return _path(f"M{x:g} {y1:g} V{y1 + lead:g} {zigzag} L{x:g} {y2 - lead:g} V{y2:g}", colour, 2)


def _dashpot(x: float, y1: float, y2: float) -> str:
    """Return a vertical dashpot."""
    middle = (y1 + y2) / 2
    cup = _path(f"M{x:g} {y2:g} V{middle + 10:g} M{x - 9:g} {middle - 8:g} V{middle + 10:g} H{x + 9:g} V{middle - 8:g}")
    return cup + _path(f"M{x:g} {y1:g} V{middle:g} M{x - 6:g} {middle:g} H{x + 6:g}", LINE, 2)


def assembly() -> str:
    """Return the tool in its holder in the spindle, with the names of places and lengths."""
    return _svg(
        760,
        300,
        "A tool in a holder in a spindle",
        _box(520, 60, 200, 150, SPINDLE),
        *(_box(x, y, 34, 16, "white") for x in (560, 650) for y in (44, 210)),
        _shape("330,92 470,82 470,70 500,70 500,82 620,112 620,158 500,188 500,200 470,200 470,188 330,178", HOLDER),
        _path("M500 82 L620 112 M500 188 L620 158", ACCENT, 3),
        _box(120, 124, 330, 22, TOOL),
        _path("M330 124 H450 M330 146 H450", ACCENT, 3),
        _path("M90 135 H735", LINE, 0.8, 'stroke-dasharray="12 4 2 4"'),
        _arrow(120, 80, 120, 120),
        _text(120, 72, "force F"),
        _path("M120 152 V178", SECOND, 2.5, 'marker-end="url(#a)"'),
        _text(106, 172, "motion y", "end", SECOND),
        _text(62, 140, "tip"),
        _text(225, 117, "tool"),
        _text(400, 108, "holder"),
        _text(672, 85, "spindle"),
        _text(332, 60, "nose", "middle"),
        _path("M332 64 V88", width=1),
        _text(640, 34, "bearings"),
        _span(120, 330, 235, "overhang"),
        _span(330, 450, 235, "insertion"),
        _text(426, 285, "joint between tool and holder", "middle", ACCENT),
        _path("M436 270 V150", ACCENT, 1, 'stroke-dasharray="3 3"'),
        _text(640, 262, "joint between holder and spindle", "middle", ACCENT),
        _path("M590 248 L570 174", ACCENT, 1, 'stroke-dasharray="3 3"'),
    )


def joint() -> str:
    """Return a joint as springs and dashpots between two facing ends."""
    return _svg(
        760,
        290,
        "A joint: a spring and a dashpot for translation, and both for rotation",
        _text(190, 28, "translation: tool moves across the holder"),
        _box(30, 62, 160, 34, TOOL),
        _text(80, 84, "tool"),
        _box(190, 180, 160, 60, HOLDER),
        _text(300, 215, "holder"),
        _path("M190 79 H300", LINE, 2),
        _spring(225, 79, 180),
        _dashpot(275, 79, 180),
        _text(208, 135, "k_y", "end", SECOND),
        _text(292, 135, "c_y", "start"),
        _path("M30 120 V150", SECOND, 2.5, 'marker-start="url(#a)" marker-end="url(#a)"'),
        _text(44, 140, "y", "start", SECOND),
        _text(570, 28, "rotation: tool tilts against the holder"),
        '<g transform="rotate(-9 560 150)">',
        _box(400, 133, 160, 34, TOOL),
        _text(450, 155, "tool"),
        "</g>",
        _box(570, 120, 160, 60, HOLDER),
        _text(670, 155, "holder"),
        '<circle cx="565" cy="150" r="5" fill="white" stroke="#222222"/>',
        _path("M530 120 A46 46 0 0 1 600 118", SECOND, 2, 'stroke-dasharray="5 3"'),
        _text(565, 94, "k_θ and c_θ", "middle", SECOND),
        _path("M392 150 A170 170 0 0 1 398 192", SECOND, 2.5, 'marker-start="url(#a)" marker-end="url(#a)"'),
        _text(412, 210, "θ", "middle", SECOND),
        _text(380, 275, "The spring resists the relative motion, the dashpot resists its velocity."),
    )


def coupling() -> str:
    """Return two parts alone, and the assembly that is calculated from them."""
    return _svg(
        760,
        270,
        "Receptance coupling",
        _text(170, 28, "calculated: each part alone"),
        _box(20, 70, 130, 22, TOOL),
        _text(85, 62, "tool"),
        _box(195, 55, 150, 52, HOLDER),
        _text(270, 85, "holder"),
        _text(85, 128, "receptances A"),
        _text(270, 128, "receptances B"),
        _text(170, 170, "identified from measurements:", "middle", ACCENT),
        _spring(140, 182, 232, ACCENT),
        _dashpot(190, 182, 232),
        _text(210, 212, "joint", "start", ACCENT),
        _path("M365 120 H425", LINE, 4, 'marker-end="url(#a)"'),
        _text(595, 28, "predicted: the assembly"),
        _box(450, 110, 140, 22, TOOL),
        _box(600, 95, 140, 52, HOLDER),
        _path("M590 112 H600 M590 130 H600", ACCENT, 3),
        _arrow(450, 66, 450, 106),
        _text(462, 78, "F", "start"),
        _path("M450 138 V166", SECOND, 2.5, 'marker-end="url(#a)"'),
        _text(462, 164, "y", "start", SECOND),
        _text(595, 195, "receptance at the tip, H = y / F"),
        _text(595, 217, "for any tool and any overhang"),
    )


def frf() -> str:
    """Return the magnitude of a tip receptance with its features, calculated by the library."""
    tool = Part([Segment(length=0.07, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    lines = np.linspace(150.0, 9000.0, 400)
    left, right, top, bottom = 80.0, 730.0, 30.0, 250.0
    curves = []
    for k_theta, colour, dash in ((1e5, SECOND, ""), (5e4, ACCENT, 'stroke-dasharray="6 4"')):
        own = PointJoint(k_y=6e8, k_theta=k_theta, c_y=300.0, c_theta=1.0, name="joint")
        level = np.log10(1e6 * abs(Assembly([tool, own, holder]).receptance(lines)))
        x = left + (right - left) * lines / 9000.0
        y = bottom - (bottom - top) * (level + 3.0) / 4.0
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        more = f" {dash}" if dash else ""
        curves.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"{more}/>')
    grid = []
    for decade, label in zip(range(-3, 2), ("0.001", "0.01", "0.1", "1", "10"), strict=True):
        y = bottom - (bottom - top) * (decade + 3.0) / 4.0
        grid += [_path(f"M{left:g} {y:g} H{right:g}", "#DDDDDD", 1), _text(left - 8, y + 5, label, "end")]
    for thousand in range(0, 10, 1):
        x = left + (right - left) * thousand / 9.0
        grid.append(_text(x, bottom + 20, f"{thousand}"))
    return _svg(
        760,
        300,
        "Receptance at the tip of a tool over frequency",
        *grid,
        _path(f"M{left:g} {top:g} V{bottom:g} H{right:g}"),
        *curves,
        _text(left + 4, 20, "displacement over force [µm/N]", "start"),
        _text((left + right) / 2, 290, "frequency [kHz]"),
        _text(272, 52, "resonance", "start"),
        _path("M268 48 L240 58", width=1),
        _text(172, 232, "antiresonance", "start"),
        _path("M168 228 L146 216", width=1),
        _text(712, 52, "stiff joint", "end", SECOND),
        _text(712, 74, "dashed: half of k_θ", "end", ACCENT),
    )


DRAWINGS = {"assembly": assembly, "joint": joint, "coupling": coupling, "frf": frf}
"""Functions that return a drawing, by the name of its file."""

if __name__ == "__main__":
    for name, draw in DRAWINGS.items():
        (FOLDER / f"{name}.svg").write_text(draw(), encoding="utf-8")
