"""The command `sweep`: many candidates of a campaign's parameters, compared with what was measured."""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.text import Text

from receptance.cli.campaigns import File, load_campaign
from receptance.cli.running import InputError, Json, Plot, Seed, Targets, input_errors, with_progress
from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.report import Column, Table
from receptance.report.terminal import print_sentences, print_table

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from matplotlib.figure import Figure

    from receptance.campaign import Campaign
    from receptance.campaign.sweeping import Compared
    from receptance.sweep import Candidates

__all__ = ["sweep"]

_BEST = 10
"""Candidates that are printed."""
_EXAMPLE = "joint.k_y = 1e7 N/m to 1e9 N/m"
_POINTS = 20
_MANY = 10_000_000
_LOGARITHMIC = 10.0
"""Ranges that span at least this ratio are covered evenly in their logarithm."""


def sweep(
    campaign: File,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="'ADDRESS = LOW to HIGH'",
            help="A parameter and its range with units; may be given several times. By default all unknowns.",
        ),
    ] = None,
    points: Annotated[
        int | None,
        typer.Option("--points", min=2, help=f"Of each parameter; all combinations are tried. By default {_POINTS}."),
    ] = None,
    sample: Annotated[
        int | None, typer.Option("--sample", metavar="COUNT", min=1, help="Draw so many instead of a grid.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="'ADDRESS = VALUE'",
            help="A parameter that stays at this value; may be given several times. Other unknowns that are not varied "
            "stay at their identified values.",
        ),
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option("--store", metavar="FOLDER", help="Zarr store of all results; an interrupted run goes on in it."),
    ] = None,
    json_file: Json = None,
    plot: Plot = None,
    seed: Seed = 0,
) -> None:
    """Try many values of a campaign's parameters and tell which agree with what was measured."""
    targets = Targets(json_file, plot)
    from receptance.campaign.sweeping import compared_with
    from receptance.sweep import Misfit
    from receptance.sweep import sweep as run

    with warnings.catch_warnings(record=True) as told, input_errors(ReceptanceError, ValueError, OSError):
        warnings.simplefilter("always", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        told.clear()  # what the campaign says of its measurements is for the commands that fit them
        if not read.to_identify:
            raise InputError("this campaign has no measurement that candidates could be compared with")
        given = _given(at or [])
        candidates = _candidates(read, vary or [], points, sample, seed, given)
        compared = with_progress(lambda say: compared_with(read, candidates.addresses, given, say))
        misfit = Misfit(compared.observations)
        try:
            found = with_progress(
                lambda say: run(read, candidates, misfit, store=store, progress=lambda told: say(str(told)))
            )
        except (KeyboardInterrupt, OSError):
            # A full disk as well.
            if store is not None and store.is_dir():
                print(
                    f"receptance: the store {store} keeps what is done; the same command goes on with it",
                    file=sys.stderr,
                )
            raise
    best = _best(found)
    # The rest of a store stays where it is.
    chosen = found.isel(candidate=best).load()
    document = _document(read, found, best, chosen) | _agreement(compared, chosen)
    targets.write(document, lambda: _figure(found))
    for one in told:
        print(f"receptance: {one.message}", file=sys.stderr)
    console = targets.console()
    valid = int(found["valid"].sum())
    names = list(candidates.addresses)
    console.print(Text(f"{read.title}: {found.sizes['candidate']:,} candidates of {', '.join(names)}"), soft_wrap=True)
    if valid < found.sizes["candidate"]:
        console.print(Text(f"note: {found.sizes['candidate'] - valid:,} of them are no model"), soft_wrap=True)
    columns = [Column("misfit", form=".6g"), *(Column(name, form=".5g") for name in names)]
    rows = list(zip(*(chosen[name].values.tolist() for name in ("misfit", *names)), strict=True))
    print_table(console, Table("The best, values in SI units", columns, rows))
    print_sentences(console, _sentences(read, compared, names, document, given))
    if store is not None:
        console.print(f"Store: {store}", soft_wrap=True)
    targets.name(console)


def _agreement(compared: Compared, chosen: xr.Dataset) -> dict[str, Any]:
    """Return what is held, and how the least misfit compares with what noise explains."""
    from receptance.campaign.sweeping import expected_misfit

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
    """Yield where the other parameters are, and whether any candidate agrees with the data."""
    from receptance.identification.laws import Law

    if compared.held:
        values = (f"{name} = {value:.5g} {_unit(name)}".rstrip() for name, value in compared.held.items())
        fitted = "" if compared.fit is None else ", identified" + (" where --at gives no value" if given else "")
        yield f"Not varied: {', '.join(values)}{fitted}."
    changing = [u.address for u in read.unknowns if isinstance(u, Law) and u.address in names]
    if changing:
        yield f"note: a candidate has one value of {', '.join(changing)} for all assemblies, the campaign has a law"
    if document["agrees"] is None:
        yield (
            "Whether a candidate agrees with the data cannot be said: not all measurements have a standard deviation "
            "(`standard_deviation`, or coherence and `averages`)."
        )
        return
    expected, best = document["expected_misfit"], document["best"]
    if not best:
        yield "No candidate agrees with the data: none is a model."
        return
    ratio = f"{best[0]['misfit'] / expected:.3g} times what noise explains (at most {document['limit'] / expected:.3g})"
    if document["agrees"]:
        yield f"The best candidate agrees with the data: its misfit is {ratio}."
        return
    yield f"No candidate agrees with the data: the least misfit is {ratio}."
    if document["misfit_of_fit"] is None:
        yield "Finer steps, other ranges or other parameters may; `receptance identify` finds the best values."
        return
    times = f"{document['misfit_of_fit'] / expected:.3g} times"
    if document["misfit_of_fit"] <= document["limit"]:
        yield f"The fit of the unknowns does, with {times}: finer steps or other ranges are needed."
    elif given:
        yield f"The fit of the other unknowns to the values of --at does not either, with {times}."
    else:
        yield f"The fit of the unknowns does not either, with {times}; `receptance diagnose` looks for the cause."


def _given(at: list[str]) -> dict[str, float]:
    found: dict[str, float] = {}
    for text in at:
        address, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise InputError(f"--at is {text!r}, expected 'ADDRESS = VALUE', such as 'joint.k_y = 1e8 N/m'")
        if address in found:
            raise InputError(f"--at {address} is there twice, expected one value for each parameter")
        found[address] = _quantity(address, value, f"--at {address}: the value")
    return found


def _candidates(
    read: Campaign, vary: list[str], points: int | None, sample: int | None, seed: int, given: dict[str, float]
) -> Candidates:
    from scipy import stats

    from receptance.identification.factors import FACTORS
    from receptance.sweep import Grid, Sampled

    if points is not None and sample is not None:
        raise InputError("--points are those of a grid and --sample draws; expected one of them")
    points = points or _POINTS
    ranges = _ranges(vary)
    if not vary:
        chosen = (u for u in read.unknowns if u.address not in given and u.address not in FACTORS)
        ranges = {u.address: (u.lower, u.upper) for u in chosen}
    for address in ranges:
        if address in given:
            raise InputError(f"{address} is varied and has a value with --at, expected one of them")
    if not ranges:
        raise InputError(
            "nothing is unknown in this campaign; say what to vary, --vary 'joint.k_y = 1e7 N/m to 1e9 N/m'"
        )
    even = {name: low > 0.0 and high / low >= _LOGARITHMIC for name, (low, high) in ranges.items()}
    if sample is not None:
        distributions = {
            name: stats.loguniform(low, high) if even[name] else stats.uniform(low, high - low)
            for name, (low, high) in ranges.items()
        }
        return Sampled(distributions, count=sample, seed=seed)
    count = points ** len(ranges)
    if count > _MANY:
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
            raise InputError(f"--vary {address} is there twice, expected one range for each parameter")
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
    """Return a value in SI units; a plain number is one of a quantity without unit."""
    from receptance.campaign.addresses import value_at

    try:
        return value_at(address, float(text) if _is_plain(text) else text)
    except ValueError as error:
        raise InputError(f"{what} {error}") from error


def _unit(address: str) -> str:
    from receptance.campaign.addresses import kind_of

    try:
        return kind_of(address).unit
    except ValueError:
        return ""  # an exponent of a law, or the value of one configuration


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
