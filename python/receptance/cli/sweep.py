"""The command `sweep`: many candidate values of parameters of a campaign, compared with the measurements."""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.text import Text

from receptance.cli.campaigns import CampaignFile, load_campaign
from receptance.cli.running import InputError, Json, Plot, Seed, Targets, input_errors, with_progress
from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.report import Column, Table
from receptance.report.terminal import print_sentences, print_table

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from matplotlib.figure import Figure

    from receptance.campaign import Campaign
    from receptance.campaign.run import Compared
    from receptance.sweep import Candidates

__all__ = ["sweep"]

_BEST = 10
"""Largest number of candidates that are printed."""
_EXAMPLE = "joint.k_y = 1e7 N/m to 1e9 N/m"
_POINTS = 20
"""Number of values of each parameter by default."""
_MOST_CANDIDATES = 10_000_000
_LOGARITHMIC = 10.0
"""Ratio of the ends of a range from which on its values are spaced logarithmically."""


def sweep(
    campaign: CampaignFile,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="'ADDRESS = LOW to HIGH'",
            help="Parameter and its range with units; may be repeated. By default all unknowns.",
        ),
    ] = None,
    points: Annotated[
        int | None,
        typer.Option("--points", metavar="N", min=2, help=f"Values of each parameter in a grid; by default {_POINTS}."),
    ] = None,
    sample: Annotated[
        int | None,
        typer.Option("--sample", metavar="COUNT", min=1, help="Number of random candidates instead of a grid."),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="'ADDRESS = VALUE'",
            help="Fixed value of a parameter; may be repeated. Unknowns that are neither varied nor fixed have their "
            "identified values.",
        ),
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option(
            "--store", metavar="FOLDER", help="Zarr store of all results; an interrupted run resumes from it."
        ),
    ] = None,
    json_file: Json = None,
    plot: Plot = None,
    seed: Seed = 0,
) -> None:
    """Compare many values of parameters with the measurements."""
    targets = Targets(json_file, plot)
    from receptance.campaign.run import compared_with
    from receptance.sweep import Misfit
    from receptance.sweep import sweep as run

    with warnings.catch_warnings(record=True) as caught, input_errors(ReceptanceError, ValueError, OSError):
        warnings.simplefilter("always", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        caught.clear()  # warnings on measurements are shown by the commands that fit them
        if not read.to_identify:
            raise InputError('the campaign has no measurement with the role "identify" to compare candidates with')
        given = _fixed_values(at or [])
        candidates = _candidates(read, vary or [], points, sample, seed, given)
        compared = with_progress(lambda say: compared_with(read, candidates.addresses, given, say))
        misfit = Misfit(compared.observations)
        try:
            found = with_progress(
                lambda say: run(read, candidates, misfit, store=store, progress=lambda state: say(str(state)))
            )
        except (KeyboardInterrupt, OSError):
            # OSError: the disk may be full.
            if store is not None and store.is_dir():
                print(
                    f"receptance: the store {store} contains the results so far; the same command resumes from it",
                    file=sys.stderr,
                )
            raise
    best = _best(found)
    # Only the best candidates of a store are loaded.
    chosen = found.isel(candidate=best).load()
    document = _document(read, found, best, chosen) | _agreement(compared, chosen)
    targets.write(document, lambda: _figure(found))
    for one in caught:
        print(f"receptance: {one.message}", file=sys.stderr)
    console = targets.console()
    valid = int(found["valid"].sum())
    names = list(candidates.addresses)
    console.print(Text(f"{read.title}: {found.sizes['candidate']:,} candidates of {', '.join(names)}"), soft_wrap=True)
    if valid < found.sizes["candidate"]:
        console.print(Text(f"note: {found.sizes['candidate'] - valid:,} of them are not valid models"), soft_wrap=True)
    columns = [Column("misfit", form=".6g"), *(Column(name, form=".5g") for name in names)]
    rows = list(zip(*(chosen[name].values.tolist() for name in ("misfit", *names)), strict=True))
    print_table(console, Table("The best, values in SI units", columns, rows))
    print_sentences(console, _sentences(read, compared, names, document, given))
    if store is not None:
        console.print(f"Store: {store}", soft_wrap=True)
    targets.print_names(console)


def _agreement(compared: Compared, chosen: xr.Dataset) -> dict[str, Any]:
    """Return the values of fixed parameters, and the smallest misfit in comparison with noise."""
    from receptance.campaign.run import expected_misfit

    found = expected_misfit(compared.observations)
    least = float(chosen["misfit"].values[0]) if chosen.sizes["candidate"] else float("inf")
    expected, limit = (None, None) if found is None else found
    fit = None if compared.fit is None else float(sum(np.sum(np.square(one)) for one in compared.fit.residuals))
    return {
        "held": compared.held,
        "expected_misfit": expected,
        "limit": limit,
        "misfit_of_fit": fit if compared.fit is not None and compared.fit.known_scatter else None,
        "agrees": None if limit is None else least <= limit,
    }


def _sentences(
    read: Campaign, compared: Compared, names: list[str], document: dict[str, Any], given: dict[str, float]
) -> Iterator[str]:
    """Yield the values of the other parameters, and whether a candidate agrees with the data."""
    from receptance.identification.laws import Law

    if compared.held:
        values = (f"{name} = {value:.5g} {_unit(name)}".rstrip() for name, value in compared.held.items())
        fitted = "" if compared.fit is None else ", identified" + (" where --at gives no value" if given else "")
        yield f"Not varied: {', '.join(values)}{fitted}."
    changing = [u.address for u in read.unknowns if isinstance(u, Law) and u.address in names]
    if changing:
        yield (
            f"note: a candidate has one value of {', '.join(changing)} for all assemblies, although the campaign has "
            "a law"
        )
    if document["agrees"] is None:
        yield (
            "Agreement with the data cannot be tested, because not all measurements have a standard deviation "
            "(`standard_deviation`, or coherence and `averages`)."
        )
        return
    expected, best = document["expected_misfit"], document["best"]
    if not best:
        yield "No candidate agrees with the data: none is a valid model."
        return
    limit = document["limit"] / expected
    ratio = f"{best[0]['misfit'] / expected:.3g} times the misfit expected from noise (limit {limit:.3g})"
    if document["agrees"]:
        yield f"The best candidate agrees with the data: its misfit is {ratio}."
        return
    yield f"No candidate agrees with the data: the smallest misfit is {ratio}."
    if document["misfit_of_fit"] is None:
        yield "Finer steps, other ranges or other parameters may agree; `receptance identify` finds the best values."
        return
    times = f"{document['misfit_of_fit'] / expected:.3g} times"
    if document["misfit_of_fit"] <= document["limit"]:
        yield f"The fit of the unknowns agrees, with {times}: finer steps or other ranges are needed."
    elif given:
        yield f"The fit of the other unknowns at the values of --at does not agree either, with {times}."
    else:
        yield f"The fit of the unknowns does not agree either, with {times}; find the cause with `receptance diagnose`."


def _fixed_values(at: list[str]) -> dict[str, float]:
    """Return the values of --at by address in SI units."""
    found: dict[str, float] = {}
    for text in at:
        address, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise InputError(f"--at is {text!r}, expected 'ADDRESS = VALUE', such as 'joint.k_y = 1e8 N/m'")
        if address in found:
            raise InputError(f"--at {address} is given twice, expected one value for each parameter")
        found[address] = _quantity(address, value, f"--at {address}: the value")
    return found


def _candidates(
    read: Campaign, vary: list[str], points: int | None, sample: int | None, seed: int, given: dict[str, float]
) -> Candidates:
    from scipy import stats

    from receptance.identification.mapping import FACTORS
    from receptance.sweep import Grid, Sampled

    if points is not None and sample is not None:
        raise InputError("--points makes a grid and --sample random candidates; expected one of them")
    points = points or _POINTS
    ranges = _ranges(vary)
    if not vary:
        chosen = (u for u in read.unknowns if u.address not in given and u.address not in FACTORS)
        ranges = {u.address: (u.lower, u.upper) for u in chosen}
    for address in ranges:
        if address in given:
            raise InputError(f"{address} is varied and has a fixed value by --at, expected one of them")
    if not ranges:
        raise InputError(
            "the campaign has no unknowns, expected a parameter, such as --vary 'joint.k_y = 1e7 N/m to 1e9 N/m'"
        )
    even = {name: low > 0.0 and high / low >= _LOGARITHMIC for name, (low, high) in ranges.items()}
    if sample is not None:
        distributions = {
            name: stats.loguniform(low, high) if even[name] else stats.uniform(low, high - low)
            for name, (low, high) in ranges.items()
        }
        return Sampled(distributions, count=sample, seed=seed)
    count = points ** len(ranges)
    if count > _MOST_CANDIDATES:
        raise InputError(f"{points} values of {len(ranges)} parameters are {count:.1e} candidates; use --sample COUNT")
    return Grid(
        {
            name: np.geomspace(low, high, points) if even[name] else np.linspace(low, high, points)
            for name, (low, high) in ranges.items()
        }
    )


def _ranges(vary: list[str]) -> dict[str, tuple[float, float]]:
    found: dict[str, tuple[float, float]] = {}
    for address, ends in map(_range, vary):
        if address in found:
            raise InputError(f"--vary {address} is given twice, expected one range for each parameter")
        found[address] = ends
    return found


def _range(text: str) -> tuple[str, tuple[float, float]]:
    address, equals, rest = text.partition("=")
    low, to, high = rest.partition(" to ")
    address = address.strip()
    if not equals or not to:
        raise InputError(
            f"--vary is {text!r}, expected 'ADDRESS = LOW to HIGH', such as 'joint.k_y = 1e7 N/m to 1e9 N/m'"
        )
    ends = [
        _quantity(address, end.strip(), f"--vary {address}: the {word} end")
        for word, end in (("lower", low), ("upper", high))
    ]
    if not ends[0] < ends[1]:
        raise InputError(
            f"--vary {address}: the range is {low.strip()} to {high.strip()}, expected the lower end first"
        )
    return address, (ends[0], ends[1])


def _quantity(address: str, text: str, what: str) -> float:
    """Return a value in SI units; a number without unit is accepted for dimensionless quantities."""
    from receptance.campaign.quantities import value_at

    try:
        return value_at(address, float(text) if _is_plain(text) else text)
    except ValueError as error:
        raise InputError(f"{what} {error}") from error


def _unit(address: str) -> str:
    from receptance.campaign.quantities import kind_of

    try:
        return kind_of(address).unit
    except ValueError:
        return ""  # exponent of a law, or value of one configuration


def _is_plain(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _best(found: xr.Dataset) -> list[int]:
    order = np.argsort(np.where(found["valid"].values, found["misfit"].values, np.inf), kind="stable")
    return [int(i) for i in order[:_BEST] if found["valid"].values[i]]


def _document(read: Campaign, found: xr.Dataset, best: list[int], chosen: xr.Dataset) -> dict[str, Any]:
    addresses = json.loads(found.attrs["addresses"])
    return {
        "title": read.title,
        "candidates": found.sizes["candidate"],
        "no_model": int((~found["valid"]).sum()),
        "best": [
            {
                "number": i,
                "misfit": float(chosen["misfit"].values[place]),
                "values": {name: float(chosen[name].values[place]) for name in addresses},
            }
            for place, i in enumerate(best)
        ],
        "settings": {name: json.loads(text) if name != "receptance" else text for name, text in found.attrs.items()},
    }


def _figure(found: xr.Dataset) -> Figure:
    from receptance.sweep.figure import draw_misfit

    return draw_misfit(found)
