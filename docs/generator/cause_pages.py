"""Directives of the pages of the causes: facts of the catalogue, computed figures, look-alikes, measurements."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import cause_effects
import receptance
from receptance.diagnosis import CATALOGUE, Parameter
from receptance.diagnosis.advice import MENU, MenuItem
from receptance.diagnosis.boundary_causes import BOUNDARY_CAUSES
from receptance.diagnosis.joint_causes import JOINT_CAUSES
from receptance.diagnosis.measurement_causes import MEASUREMENT_CAUSES
from receptance.diagnosis.part_causes import PART_CAUSES
from receptance.diagnosis.thresholds import LOOK_ALIKE

__all__ = ["setup"]

FIGURES = "generated"
"""Folder of the computed figures beside the pages; git ignores it."""
LISTED = 6
"""Number of look-alikes on a page."""
LEAST = 0.5
"""Similarity below which effects are not listed."""
SMALL_UNITS = {"kg": (1e3, "g"), "m": (1e3, "mm"), "s": (1e6, "µs")}
"""Units of numbers below one, and how many of them the SI unit has."""
GROUPS = {
    "In the joint": JOINT_CAUSES,
    "In the tool and the holder": PART_CAUSES,
    "Beyond the holder": BOUNDARY_CAUSES,
    "In the measurement": MEASUREMENT_CAUSES,
}


class _AboutCause(SphinxDirective, ABC):
    """A directive with the id of a cause, which is replaced by Markdown."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        id = self.arguments[0]
        if id not in CATALOGUE:
            raise self.error(f"there is no cause {id!r}; the catalogue has {', '.join(CATALOGUE)}")
        return self.parse_text_to_nodes(self.text(id))

    @abstractmethod
    def text(self, id: str) -> str:
        """Return the Markdown about a cause."""


class Facts(_AboutCause):
    """What the catalogue states about a cause."""

    def text(self, id: str) -> str:
        """Return a table of the facts and one of the parameters."""
        cause = CATALOGUE[id]
        belongs = {
            "structure": "the structure; predictions of other assemblies contain it",
            "measurement": "the measurement; predictions of other assemblies do not contain it",
        }[cause.group]
        rows = [
            "| | |",
            "|---|---|",
            f"| name in results | `{id}` |",
            f"| in words | {cause.meaning} |",
            f"| what to do | {cause.remedy} |",
            *([f"| in a spindle | {cause.remedy_in_spindle} |"] if cause.remedy_in_spindle else []),
            f"| belongs to | {belongs} |",
        ]
        if cause.unspecific:
            rows.append("| reported | not beside a discrepancy, because other errors of a structure look the same |")
        if not cause.parameters:
            return "\n".join([*rows, "", "The cause has no parameters: it is there or not."])
        rows += ["", "| parameter | no effect at | plausible | fitted within |", "|---|---|---|---|"]
        return "\n".join([*rows, *(_row(one) for one in cause.parameters)])


def _row(one: Parameter) -> str:
    low, high = one.plausible
    null = "" if one.secondary else _shown(one, [one.null])
    return f"| `{one.name}` | {null} | {_shown(one, [low, high])} | {_shown(one, [one.lower, one.upper])} |"


def _shown(parameter: Parameter, numbers: Sequence[float]) -> str:
    largest = max(map(abs, numbers))
    if parameter.name.startswith("log_"):
        # Half and twice are -50 % and +100 %; beyond these a factor is easier to read.
        if largest > 0.7:
            texts, unit = [f"× {math.exp(x):.2g}" for x in numbers], ""
        else:
            texts, unit = [f"{100.0 * math.expm1(x):+.3g}" if x else "0" for x in numbers], "%"
    else:
        scale, unit = SMALL_UNITS.get(parameter.unit, (1.0, parameter.unit)) if largest < 1.0 else (1.0, parameter.unit)
        texts = [_number(scale * x) for x in numbers]
    return f"{' to '.join(texts)} {unit}".strip()


def _number(x: float) -> str:
    if 1e3 <= abs(x) < 1e5:
        return f"{float(f'{x:.3g}'):.0f}"
    mantissa, _, exponent = f"{x:.3g}".partition("e")
    return mantissa if not exponent else f"{'' if mantissa == '1' else mantissa + ' × '}10{_raised(int(exponent))}"


def _raised(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


class EffectFigure(_AboutCause):
    """The computed figure of a cause, and the results of the fit in it."""

    def text(self, id: str) -> str:
        """Return the picture, its caption, and the identified values."""
        effect = cause_effects.effect(id)
        declared = {one.name: one for one in CATALOGUE[id].parameters}
        sizes = ", ".join(f"`{name}` {_shown(declared[name], [x])}" for name, x in effect.sizes.items())
        caption = f"Simulated{' with ' + sizes if sizes else ''} (variant: {effect.variant})."
        lines = [f"![FRF with and without the cause](/{FIGURES}/{id}.svg)", "", f"*{caption}*", ""]
        lines += ["The fit without the cause identifies:", "", "| | in the data | identified |", "|---|---|---|"]
        for name, (true, fitted) in effect.joint.items():
            lines.append(f"| `{name}` | {_number(true)} | {_identified(true, fitted)} |")
        strained = {name: x for name, x in effect.strain.items() if abs(x) > 3.0}
        if strained:
            words = ", ".join(f"{name} {_deviations(abs(x))}" for name, x in strained.items())
            lines += ["", f"It strains tolerances, here in standard deviations: {words}."]
        return "\n".join(lines)


def _deviations(x: float) -> str:
    return "at the bound of 8" if x > 7.99 else f"{x:.1f}"


def _identified(true: float, fitted: float) -> str:
    """Return an identified value and its error, or the bound at which the fit has ended."""
    if fitted > 0.99 * cause_effects.RANGE * true:
        return "at the upper bound of the fit"
    if fitted < 1.01 / cause_effects.RANGE * true:
        return "at the lower bound of the fit"
    change = f"× {fitted / true:.2g}" if fitted > 3.0 * true else f"{100.0 * (fitted / true - 1.0):+.2g} %"
    return f"{_number(fitted)} ({change})"


class LookAlikes(_AboutCause):
    """The causes with similar effects."""

    def text(self, id: str) -> str:
        """Return a table of the similarities."""
        found = {name: x for name, x in cause_effects.look_alikes(id).items() if x >= LEAST}
        if not found:
            return "In the simulated FRFs of the figure no other cause has a similar effect."
        rows = [
            "In the simulated FRFs of the figure, after a fit of the joint (1: the same effect, 0: nothing in common; "
            f"`diagnose` lists look-alikes from {LOOK_ALIKE:g} on):",
            "",
            "| cause | similarity | in words |",
            "|---|---|---|",
        ]
        for name, x in list(found.items())[:LISTED]:
            # A number that rounds to 1 would claim identity.
            shown = "0.999" if 0.999 < x < 1.0 - 1e-6 else f"{x:.3g}"
            rows.append(f"| [{name}]({name}.md) | {shown} | {CATALOGUE[name].meaning} |")
        return "\n".join(rows)


class Measurements(_AboutCause):
    """The measurements of the menu that are made for a cause."""

    def text(self, id: str) -> str:
        """Return a list of them."""
        own = [one for one in MENU if _is_for(one, id)]
        if not own:
            return (
                "The menu of `diagnose` has no measurement for this cause alone. It simulates FRFs at another place, "
                "overhang or force, the parts alone, and a blank in the spindle, and advises the one that separates "
                "the explanations."
            )
        rows = ["In the menu of `diagnose`, with its effort in hits on the machine:", ""]
        only = {None: "", True: "; for a holder in a spindle", False: "; not for a holder in a spindle"}
        return "\n".join([*rows, *(f"- {one.action} ({one.cost:g}{only[one.in_spindle]})" for one in own)])


def _is_for(measurement: MenuItem, id: str) -> bool:
    causes = {name.partition(".")[0] for name in measurement.accuracy}
    return id in measurement.without | causes


class CauseList(SphinxDirective):
    """A table of all causes by group."""

    def run(self) -> list[nodes.Node]:
        rows: list[str] = []
        for title, causes in GROUPS.items():
            rows += [f"**{title}**", "", "| cause | in words |", "|---|---|"]
            rows += [f"| [{one.id}]({one.id}.md) | {one.meaning} |" for one in causes] + [""]
        return self.parse_text_to_nodes("\n".join(rows))


def _save(path: Path) -> cause_effects.Effect:
    # The same bytes in every build of the same library.
    import matplotlib as mpl

    with mpl.rc_context({"svg.hashsalt": path.stem}):
        cause_effects.figure(path.stem).savefig(path, metadata={"Date": None})
    return cause_effects.effect(path.stem)


def _draw(app: Sphinx) -> None:
    """Draw the figures that are older than the code they come from."""
    code = [*Path(receptance.__path__[0]).rglob("*.py"), *Path(__file__).parent.glob("*.py")]
    newest = max(one.stat().st_mtime for one in code)
    folder = Path(app.srcdir) / FIGURES
    folder.mkdir(exist_ok=True)
    wanted = [folder / f"{id}.svg" for id in CATALOGUE]
    old = [one for one in wanted if not one.exists() or one.stat().st_mtime < newest]
    if old:
        with ProcessPoolExecutor(2) as pool:
            for path, effect in zip(old, pool.map(_save, old), strict=True):
                cause_effects.EFFECTS[path.stem] = effect


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives, and draw the figures before pages are read."""
    app.add_directive("cause-facts", Facts)
    app.add_directive("cause-figure", EffectFigure)
    app.add_directive("cause-look-alikes", LookAlikes)
    app.add_directive("cause-measurements", Measurements)
    app.add_directive("cause-list", CauseList)
    app.connect("builder-inited", _draw)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
