"""The clamp of aluminium rods from the first natural frequency of one rod, the other rods predicted.

Source: github.com/leekunhwee/Dynamics at 64deac715399fcde0113a954857c5f0fa13ca51a, folder RCSA/Example. The measured
first modes were read from figures at 7.5 Hz a pixel, so to +-5 Hz. The source gives the tip of rod d as 16 mm in one
place and as 10 mm in the others; 10 mm is used.

One frequency determines one number. The clamp is therefore taken as elastic in rotation alone or in translation
alone. Each rod gives one stiffness under either assumption, and the other rods test it.

Run with `python docs/studies/clamped_rods.py [--reading-error HZ] [--json FILE] [--plot FILE]`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize

import receptance as rc
from output import options, print_table, save

ALUMINIUM = rc.Material(youngs_modulus=72e9, density=2810.0, poisson_ratio=0.33, name="aluminium 7075")
RODS: dict[str, list[tuple[float, float]]] = {
    "b": [(190.0, 16.0)],
    "c": [(140.0, 16.0)],
    "d": [(140.0, 16.0), (50.0, 10.0)],
}
"""Length and diameter of the segments in mm, from the clamp on."""
MEASURED_HZ = {"b": 293.0, "c": 521.0, "d": 398.0}
PREDICTED_BY_AUTHORS_HZ = {"b": 308.0, "c": 513.0, "d": 383.0}
READING_ERROR_HZ = 5.0

ELASTIC = {"rotation": ["clamp.k_theta"], "translation": ["clamp.k_y"], "both": ["clamp.k_y", "clamp.k_theta"]}
"""Parameters of the clamp that are identified; the others are rigid."""
BOUNDS = {"clamp.k_y": (1e4, 1e12), "clamp.k_theta": (1e1, 1e9)}
RIGID = {"clamp.k_y": 1e14, "clamp.k_theta": 1e11}
UNITS = {"clamp.k_y": "N/m", "clamp.k_theta": "N m/rad"}


def rod(name: str) -> rc.Assembly:
    """Return a rod, its tip first, with a rigid clamp at its other end."""
    segments = [
        rc.Segment(length=1e-3 * length, outer_diameter=1e-3 * diameter, material=ALUMINIUM)
        for length, diameter in reversed(RODS[name])
    ]
    clamp = rc.GroundSpring(
        k_y=RIGID["clamp.k_y"], k_theta=RIGID["clamp.k_theta"], part="rod", position="end", name="clamp"
    )
    return rc.Assembly([rc.Part(segments, name="rod")], [clamp])


def first_mode(name: str, values: dict[str, float]) -> float:
    """Return the first natural frequency of a rod in Hz."""
    return float(rod(name).replace(values).lowest_natural_frequencies(1)[0][0])


def unknowns(addresses: list[str]) -> list[rc.Unknown]:
    """Return the unknowns of a clamp."""
    return [rc.Unknown(address=a, lower=BOUNDS[a][0], upper=BOUNDS[a][1]) for a in addresses]


def stiffness(name: str, address: str, frequency_hz: float, seed: int) -> float | None:
    """Return the stiffness for which a rod has a first mode, None if no stiffness is high enough."""
    if frequency_hz >= first_mode(name, {}):
        return None
    measured = rc.Observation.from_modes(assembly=rod(name), frequency_hz=[frequency_hz], label=f"rod {name}")
    value = rc.identify(measured, unknowns([address]), seed=seed, noise="stated").values[address]
    low, high = BOUNDS[address]
    return value if 1.001 * low < value < 0.999 * high else None


def predict(address: str, stiffnesses: list[float | None], name: str, error_hz: float) -> dict[str, Any]:
    """Predict the first mode of a rod from the low, best and high stiffness of the clamp of another rod."""
    low, middle, high = (first_mode(name, {address: RIGID[address] if k is None else k}) for k in stiffnesses)
    measured = MEASURED_HZ[name]
    return {
        "rod": name,
        "measured_hz": measured,
        "predicted_hz": middle,
        "interval_hz": [low, high],
        "error_percent": 100.0 * (middle / measured - 1.0),
        "agrees": low <= measured + error_hz and high >= measured - error_hz,
    }


def common_clamp(addresses: list[str], error_hz: float, seed: int) -> dict[str, Any]:
    """Identify one clamp on all rods, by least squares and by the smallest error of the worst rod."""
    measured = [
        # The reading error is uniform.
        rc.Observation.from_modes(
            assembly=rod(name),
            frequency_hz=[frequency],
            standard_deviation_hz=error_hz / np.sqrt(3.0),
            label=f"rod {name}",
        )
        for name, frequency in MEASURED_HZ.items()
    ]
    found = rc.identify(measured, unknowns(addresses), seed=seed, noise="stated")

    def errors(logarithms: np.ndarray) -> np.ndarray:
        values = dict(zip(found.values, np.exp(logarithms).tolist(), strict=True))
        return np.array([first_mode(name, values) - frequency for name, frequency in MEASURED_HZ.items()])

    # The last variable bounds all errors from both sides and is minimised.
    best = np.log(list(found.values.values()))
    start = np.append(best, np.max(np.abs(errors(best))))
    worst = minimize(
        lambda x: x[-1],
        start,
        method="SLSQP",
        bounds=[*(np.log(BOUNDS[a]) for a in found.values), (0.0, np.inf)],
        constraints={"type": "ineq", "fun": lambda x: np.concatenate([x[-1] - errors(x[:-1]), x[-1] + errors(x[:-1])])},
    )
    least = min(float(np.max(np.abs(errors(x)))) for x in (best, worst.x[:-1]))
    return {
        "values": dict(found.values),
        "error_hz": dict(zip(RODS, errors(best).tolist(), strict=True)),
        "least_worst_hz": least,
        "explains": least <= error_hz,
        "advice": list(found.advice),
    }


def study(error_hz: float = READING_ERROR_HZ, seed: int = 0) -> dict[str, Any]:
    """Return all results.

    Parameters
    ----------
    error_hz : float, optional
        Reading error in Hz.
    seed : int, optional
        Seed of the starts of the identification.
    """
    if not 0.0 < error_hz < min(MEASURED_HZ.values()):
        raise ValueError(f"the reading error is {error_hz:g} Hz, expected above 0 and below all measured frequencies")
    identified, predictions = [], []
    for assumption in ("rotation", "translation"):
        (address,) = ELASTIC[assumption]
        for name, frequency in MEASURED_HZ.items():
            values = [stiffness(name, address, frequency + shift, seed) for shift in (-error_hz, 0.0, error_hz)]
            own = {"assumption": assumption, "rod": name, "address": address, "unit": UNITS[address]}
            identified.append({**own, "value": values[1], "interval": [values[0], values[2]]})
            predictions += [
                {"assumption": assumption, "identified_on": name, **predict(address, values, other, error_hz)}
                for other in RODS
                if other != name
            ]
    return {
        "study": "clamped-rods",
        "settings": {"reading_error_hz": error_hz, "seed": seed},
        "material": ALUMINIUM,
        "rods": [
            {
                "name": name,
                "segments_mm": segments,
                "measured_hz": MEASURED_HZ[name],
                "authors_prediction_hz": PREDICTED_BY_AUTHORS_HZ[name],
                "rigid_clamp_hz": first_mode(name, {}),
            }
            for name, segments in RODS.items()
        ],
        "identified": identified,
        "predictions": predictions,
        "common_clamp": [
            {"assumption": assumption, **common_clamp(addresses, error_hz, seed)}
            for assumption, addresses in ELASTIC.items()
        ],
    }


def show(found: dict[str, Any]) -> None:
    """Print the results."""
    print_table(
        f"First modes in Hz; readings +-{found['settings']['reading_error_hz']:g} Hz",
        found["rods"],
        {
            "rod": "name",
            "measured": "measured_hz:g",
            "rigid clamp": "rigid_clamp_hz:.1f",
            "authors": "authors_prediction_hz:g",
        },
    )
    print_table(
        "The clamp, one number from one frequency",
        found["identified"],
        {
            "elastic in": "assumption",
            "from rod": "rod",
            "stiffness": "value:.3e",
            "interval": "interval:.2e",
            "unit": "unit",
        },
    )
    print_table(
        "The other rods; a prediction agrees if its interval meets that of the reading",
        found["predictions"],
        {
            "elastic in": "assumption",
            "from rod": "identified_on",
            "to rod": "rod",
            "measured [Hz]": "measured_hz:g",
            "predicted [Hz]": "predicted_hz:.1f",
            "interval [Hz]": "interval_hz:.1f",
            "error [%]": "error_percent:+.1f",
            "agrees": "agrees",
        },
    )
    print_table(
        "One clamp for all rods",
        [
            {
                **clamp,
                **{a: clamp["values"].get(a) for a in UNITS},
                **{f"error {n}": clamp["error_hz"][n] for n in RODS},
            }
            for clamp in found["common_clamp"]
        ],
        {
            "elastic in": "assumption",
            "k_y [N/m]": "clamp.k_y:.3g",
            "k_theta [N m/rad]": "clamp.k_theta:.3g",
            **{f"error of {name} [Hz]": f"error {name}:+.1f" for name in RODS},
            "least worst error [Hz]": "least_worst_hz:.1f",
            "explains all": "explains",
        },
    )
    for assumption in ("rotation", "translation"):
        own = [p for p in found["predictions"] if p["assumption"] == assumption]
        worst = max(own, key=lambda p: abs(p["error_percent"]))
        print(
            f"\nElastic in {assumption} alone: {sum(p['agrees'] for p in own)} of {len(own)} predictions agree; the "
            f"largest error is {worst['error_percent']:+.1f} % ({worst['identified_on']} to {worst['rod']})."
        )
    if not any(clamp["explains"] for clamp in found["common_clamp"]):
        print(
            "\nNo single clamp of this model explains the rods: the clamping differed from rod to rod, or lengths, "
            "material or the removed accelerometer are wrong. Three frequencies cannot tell which."
        )


def draw(found: dict[str, Any]) -> Any:
    """Return a figure of the predicted first modes, with intervals, relative to the readings."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.5), layout="constrained")
    figure.suptitle("First mode of clamped aluminium rods, predicted with the clamp of another rod")
    names = list(RODS)
    for axes, assumption in zip(figure.subplots(1, 2, sharey=True), ("rotation", "translation"), strict=True):
        axes.set_title(f"clamp elastic in {assumption} alone")
        for i, one in enumerate(found["rods"]):
            band = 100.0 * found["settings"]["reading_error_hz"] / one["measured_hz"]
            axes.bar(i, 2.0 * band, bottom=-band, color="#E3E3E3", label="reading error" if i == 0 else None)
            rigid = 100.0 * (one["rigid_clamp_hz"] / one["measured_hz"] - 1.0)
            axes.plot(i, rigid, "k_", markersize=26, label="rigid clamp" if i == 0 else None)
        for number, source in enumerate(names):
            own = [p for p in found["predictions"] if (p["assumption"], p["identified_on"]) == (assumption, source)]
            ends = [
                [abs(100.0 * (p["predicted_hz"] - p["interval_hz"][s]) / p["measured_hz"]) for p in own] for s in (0, 1)
            ]
            places = [names.index(p["rod"]) + 0.22 * (number - 1) for p in own]
            axes.errorbar(
                places, [p["error_percent"] for p in own], ends, fmt="o", capsize=4, label=f"from rod {source}"
            )
        axes.set_xticks(range(len(names)), [f"rod {name}: {MEASURED_HZ[name]:g} Hz" for name in names])
        axes.set_ylabel("relative to the reading (%)")
        axes.legend(fontsize=8)
    return figure


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--reading-error", metavar="HZ", type=float, default=READING_ERROR_HZ)
    given = parser.parse_args()
    results = study(given.reading_error, given.seed)
    show(results)
    save(given.json, results)
    if given.plot:
        draw(results).savefig(given.plot)
