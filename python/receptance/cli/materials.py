"""The command `materials`: the list of materials, and one of them as a table of a campaign."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from receptance.campaign.listed_materials import listed_table
from receptance.cli.running import Json, Overwrite, Targets, input_errors
from receptance.model.materials import MATERIALS, Grade, grade
from receptance.report.table import Column, Table
from receptance.report.terminal import print_sentences, print_table


def materials(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME", help="Materials to show with source and table; also carbide-9co, with 9 % Co."),
    ] = None,
    json_file: Json = None,
    overwrite: Overwrite = False,
) -> None:
    """List the materials that campaigns can name without a table, with their scatter."""
    targets = Targets(json_file, None, None, overwrite=overwrite)
    targets.require_new()
    with input_errors():
        chosen = [grade(name) for name in names or MATERIALS]
    targets.write(lambda: {"materials": {listed.name: asdict(listed) for listed in chosen}})
    console = targets.console()
    print_table(console, _table(chosen))
    if names:
        print_sentences(console, [f"{listed.name}: {listed.title}. Source: {listed.source}." for listed in chosen])
        for listed in chosen:
            console.print(_as_toml(listed), soft_wrap=True, markup=False, highlight=False)
    else:
        text = 'In a campaign: material = "carbide-10co"; carbide-NUMBERco has any percentage of cobalt from 3 to 25. '
        print_sentences(console, [f"{text}Source and table of one: receptance materials NAME."])
    targets.print_names(console)


def _table(chosen: list[Grade]) -> Table:
    columns = (
        "material",
        Column("E", "GPa", ".4g"),
        Column("+-", "%", ".2g"),
        Column("density", "kg/m3", ".0f"),
        Column("+-", "%", ".2g"),
        Column("Poisson", "", ".3g"),
        Column("+-", "", ".2g"),
    )
    rows = [
        (
            listed.name,
            1e-9 * listed.youngs_modulus,
            100.0 * listed.modulus_scatter,
            listed.density,
            100.0 * listed.density_scatter,
            listed.poisson_ratio,
            listed.poisson_scatter,
        )
        for listed in chosen
    ]
    return Table("Materials, and standard deviations of a delivery", columns, rows)


def _as_toml(listed: Grade) -> str:
    """Return the table of a listed material for a campaign file."""
    table = listed_table(listed.name)
    tolerance = table.pop("tolerance")
    tables = {f"materials.{listed.name}": table, f"materials.{listed.name}.tolerance": tolerance}
    return "\n".join(
        line
        for head, values in tables.items()
        for line in (f"[{head}]", *(f"{key} = {_written(value)}" for key, value in values.items()), "")
    )


def _written(value: str | float) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
