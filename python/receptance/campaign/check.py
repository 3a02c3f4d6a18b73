"""What a campaign contains, which commands it allows, what is missing, and its assemblies to scale."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

from receptance.campaign.data import CampaignData
from receptance.campaign.identification import fit_inputs, joints_to_invert, observed_unknowns, transfer_errors
from receptance.campaign.problems import CampaignError
from receptance.campaign.records import missing_records
from receptance.campaign.schema import AutomaticModes
from receptance.fit import Observation
from receptance.model.coordinates import Coordinate
from receptance.model.sketch import Mark
from receptance.report import Column, Provenance, Result, Table

_MOST_NAMED = 3
"""Most names of assemblies of one shape in a title."""


@dataclass(frozen=True, eq=False)
class CampaignCheck(Result):
    """Contents of a campaign, the commands that it allows, and what is missing.

    Parameters
    ----------
    campaign : Campaign
        A campaign that was read without mistakes.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import campaign, examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("er32", folder)
    ...     check = campaign.CampaignCheck(campaign.load(folder))
    >>> check.missing["stability"]
    'no cuts, expected [cuts.NAME]'
    """

    heading: ClassVar[str] = "Check"
    plotted_by = "receptance.campaign.figure:draw_check"
    campaign: CampaignData

    @property
    def provenance(self) -> Provenance:
        """The campaign."""
        return self.campaign.provenance()

    @property
    def notes(self) -> Sequence[str]:
        """Notes on the data."""
        return self.campaign.notes

    @cached_property
    def missing(self) -> dict[str, str]:
        """What each command lacks, by its name; empty for a command that can run."""
        one = self.campaign
        fit = ""
        if not one.measurements:
            fit = "no measurements, expected [measurements.NAME]"
        elif not one.to_identify:
            fit = 'no measurement with the role "identify"'
        elif not one.unknowns:
            fit = 'no unknowns, expected such as "joint.k_theta" under [unknowns]'
        else:
            fit = _refusal(lambda: observed_unknowns(one, one.to_identify))
        weights = [name for name, observation in one.to_identify.items() if not observation.weighted]
        lacks = f"no standard deviation of {', '.join(weights[:3])}" if weights else ""
        identify = fit or _refusal(lambda: fit_inputs(one))
        measured = {observation.configuration for observation in one.measurements.values()}
        speeds = "" if one.table.stability.speeds is not None else "no spindle speeds, expected stability.speeds"
        predicted = any(cut.is_predicted for cut in one.cuts.values())
        commands = {
            "identify": identify,
            "predict": (identify if one.unknowns else "")
            or ("" if one.held_out or one.unmeasured else "no held-out measurement, no assembly unmeasured"),
            "transfer": fit
            or ("" if len(measured) > 1 else "one measured assembly, expected two or more")
            or _refusal(lambda: transfer_errors(one)),
            "diagnose": fit or lacks,
            "invert": fit or _refusal(lambda: joints_to_invert(one)),
            "next": identify,
            "stability": (speeds or (identify if predicted and one.unknowns else ""))
            if one.cuts
            else "no cuts, expected [cuts.NAME]",
            "catalogue": "" if one.table.catalogue is not None else "no tools and holders, expected [catalogue]",
        }
        if not one.table.spindles:
            return commands
        spindle = "" if one.blanks else "no blanks of a spindle, expected `blanks` in [spindles.NAME]"
        if one.built.unidentified:
            commands = dict.fromkeys(commands, f"waits for `receptance spindle`: {listed([*one.built.unidentified])}")
        return {"spindle": spindle, **commands}

    def tables(self) -> list[Table]:
        """Return the assemblies, the measurements, the unknowns, and the commands with what they lack."""
        one = self.campaign
        rows = [
            (name, self._chain(name), 1e3 * assembly.length, assembly.mass, self._measured(name))
            for name, assembly in one.assemblies.items()
        ]
        columns = ("name", "chain", Column("length", "mm", ".5g"), Column("mass", "kg", ".3g"), "role")
        unknowns = []
        for unknown in one.unknowns:
            unknowns.append((unknown.name, unknown.lower, unknown.upper, unknown.unit))
        commands = [(f"receptance {name}", text or "ready") for name, text in self.missing.items()]
        tables = [
            Table("Assemblies", columns, rows),
            *one.tables(),
            Table("Unknowns", ("name", Column("from"), Column("to"), "unit"), unknowns),
            Table("Commands", ("command", "state"), commands),
        ]
        return [table for table in tables if table.rows]

    def _chain(self, assembly: str) -> str:
        return " - ".join(self.campaign.table.assemblies[assembly].chain)

    def _measured(self, assembly: str) -> str:
        if assembly in self.campaign.blanks:
            return f"blank of {self.campaign.blanks[assembly]}"
        own = [table for table in self.campaign.table.measurements.values() if table.assembly == assembly]
        if not own:
            return "predicted"
        held = sum(table.role == "hold out" for table in own)
        if held == len(own):
            return "held out"
        return "identify" + (f", {held} of {len(own)} held out" if held else "")

    def sentences(self) -> list[str]:
        """Return the number of everything, and the number of errors with tolerances."""
        one = self.campaign
        errors = {error.name for tolerances in one.tolerances.values() for error in tolerances}
        automatic = [name for name, part in one.table.modal_parts.items() if isinstance(part.modes, AutomaticModes)]
        counts = (
            (len(one.assemblies), "assembly", "assemblies"),
            (len(one.measurements) + len(one.on_blanks), "measurement", "measurements"),
            (len(one.unknowns) - sum(_numbers(name, one) for name in automatic), "unknown", "unknowns"),
            (len(errors), "dimension or material with a tolerance", "dimensions and materials with tolerances"),
        )
        more = [f"The records choose the number of modes of {listed(automatic)}."] if automatic else []
        text = ", ".join(f"{n} {word if n == 1 else words}" for n, word, words in counts)
        return [f"{one.file} is valid: {text}.", *more]

    def warnings(self) -> Sequence[str]:
        """Return what the description lacks, with the keys to write."""
        one = self.campaign
        found = list(missing_records(one))
        everything = {**one.measurements, **one.on_blanks}
        frfs = {name: observation for name, observation in everything.items() if observation.is_receptance}
        bare = [name for name in frfs if one.table.measurements[name].sensor is None]
        if bare:
            found.append(
                f"no sensor is stated for {listed(bare)}: right for a laser; the mass of an accelerometer belongs to "
                'the model, `sensor = "accelerometer"` and [sensors.accelerometer] with `mass = "0.6 g"`'
            )
        if one.unknowns and not any(one.tolerances.values()):
            found.append(
                "dimensions and materials are taken as exact, because none has a tolerance; small errors are then "
                'taken for other causes. Write `tolerance = { outer_diameter = "0.1 %" }` in their tables'
            )
        if one.unknowns and len(one.to_identify) and not one.held_out:
            found.append(
                'no measurement is held out, so predictions are not tested by `predict`; write `role = "hold out"` '
                "in one, or use `transfer`, which holds out each assembly in turn"
            )
        measured = {observation.configuration for observation in one.measurements.values()}
        if one.unknowns and len(measured) == 1:
            found.append(
                "one assembly was measured: several overhangs separate the joint from errors of dimensions and sensors"
            )
        undamped = [name for name, material in one.built.materials.items() if material.loss_factor == 0.0]
        if frfs and undamped:
            found.append(
                f"{listed(undamped)}: the loss factor is zero, so that all damping is that of joints; write "
                "`loss_factor = 0.001`"
            )
        return found

    def data(self) -> dict[str, Any]:
        """Return assemblies, measurements, unknowns, missing parts of commands, and advice."""
        one = self.campaign
        everything = {**one.measurements, **one.on_blanks}
        return {
            "assemblies": {
                name: {
                    "chain": one.table.assemblies[name].chain,
                    "length_m": assembly.length,
                    "mass_kg": assembly.mass,
                }
                for name, assembly in one.assemblies.items()
            },
            "measurements": {
                name: {
                    "assembly": table.assembly,
                    "data": everything[name].describe(),
                    "sensor": table.sensor,
                    "role": table.role,
                    "files": one.files_of(name),
                }
                for name, table in one.table.measurements.items()
                if name in everything
            },
            "unknowns": {unknown.name: [unknown.lower, unknown.upper] for unknown in one.unknowns},
            "missing": {name: text for name, text in self.missing.items() if text},
            "advice": self.warnings(),
        }


def _refusal(require: Callable[[], object]) -> str:
    """Return the reason for which a command would refuse the campaign; empty if it would not."""
    try:
        require()
    except CampaignError as error:
        return error.problems[0].text
    return ""


def listed(names: Sequence[str]) -> str:
    """Return the first names as text, and the number of the others."""
    rest = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return ", ".join(names[:_MOST_NAMED]) + rest


def _numbers(name: str, campaign: CampaignData) -> int:
    """Return the number of unknowns of the modes of a modal part."""
    return sum(unknown.address.startswith(f"{name}.mode[") for unknown in campaign.unknowns)


def marks_of(measured: Observation) -> list[Mark]:
    """Return the points of an FRF: where it responds and where it is hit."""
    if not measured.is_receptance:
        return []
    response, excitation = measured.response, measured.excitation
    return [
        Mark(_mark("response", response), response, "response"),
        Mark(_mark("hit", excitation), excitation, "excitation"),
    ]


def _mark(text: str, at: Coordinate) -> str:
    return f"{text} (rotation)" if at.direction == "theta" else text
