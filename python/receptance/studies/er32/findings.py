"""What the study found, in sentences that follow from its numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from receptance.studies.er32.holder import HolderModel
from receptance.studies.er32.joints import IdentifiedJoint
from receptance.studies.er32.study import ER32Study
from receptance.studies.er32.transfer import ModeError, SetVerdict

__all__ = ["findings"]

_USUAL = 0.05
"""The p value below which chance is called an unlikely explanation."""
_TAIL = 1e-4
"""Nobody knows the tails of these distributions further out than this."""


def findings(study: ER32Study) -> tuple[tuple[str, str], ...]:
    """Return pairs of subject and sentences; nothing in them is known before the study is done."""
    return (
        *(("holder", text) for text in _on_holder(study)),
        *(("joint", text) for text in _on_joints(study)),
        *(("transfer", text) for text in _on_transfer(study)),
        *(("parameter sets", text) for text in _on_sets(study)),
        *(("trends", text) for text in _on_trends(study)),
        *(("bias", text) for text in _on_bias(study)),
        *(("paper", text) for text in _on_paper(study)),
    )


def _on_holder(study: ER32Study) -> Iterator[str]:
    model, consistency = study.model, study.consistency
    yield f"The holder is inferred, not published. {model.inference}"
    yield (
        f"It meets these {consistency.frequencies} frequencies to {consistency.rms_percent:.2f} % rms. Agreement in "
        "frequencies and stiffnesses that were used to infer it is consistency, not validation."
    )
    known = [q for q in consistency.quantities if q.standard_error_percent < consistency.known_within_percent]
    names = ", ".join(f"{q.name} to {q.standard_error_percent:.1f} %" for q in known)
    yield (
        f"The frequencies determine {consistency.combinations_known} combinations of the {len(consistency.quantities)} "
        f"fitted quantities within {consistency.known_within_percent:g} %"
        + (f", and of the quantities themselves only {names}" if known else "")
        + f". The rest of the shape is decided by the bounds of that fit (at a bound: "
        f"{', '.join(model.at_bounds_of_fit)}): "
        "it is a holder with the right receptance at the nose, not the holder's drawing."
    )


def _on_joints(study: ER32Study) -> Iterator[str]:
    joints = study.identified
    worst_y = max(joints, key=lambda j: abs(j.k_y_difference_percent))
    worst_theta = max(joints, key=lambda j: abs(j.k_theta_difference_percent))
    yield (
        f"All {len(joints)} joints of table 4 identified from two natural frequencies each. Against the paper, k_y "
        "differs at "
        f"most by {worst_y.k_y_difference_percent:+.1f} % ({_state(worst_y)}), k_theta by "
        f"{worst_theta.k_theta_difference_percent:+.1f} % ({_state(worst_theta)})."
    )
    lost = [j for j in joints if not j.converged]
    split = [j for j in joints if j.starts_agreeing < j.starts]
    if lost:
        yield f"Not converged: {', '.join(_state(j) for j in lost)}."
    if split:
        yield f"Not all starts agree: {', '.join(f'{_state(j)} ({j.starts_agreeing} of {j.starts})' for j in split)}."
    r = study.settings.resolution
    yield (
        f"The intervals hold every joint whose frequencies would have been printed as they were: steps of "
        f"{r.fine_hz:g} Hz "
        f"below {r.change_hz / 1e3:g} kHz and of {r.coarse_hz:g} Hz from there on (the paper states no resolution). "
        "They say "
        "nothing of the model's own error, nor of how a second clamping would have come out."
    )
    error = study.settings.chance.overhang_mm
    spans = {
        name: sorted(error * abs(getattr(j, f"{name}_percent_per_mm")) for j in joints) for name in ("k_y", "k_theta")
    }
    yield (
        f"An overhang wrong by {error:g} mm would move "
        + " and ".join(f"{name} by {span[0]:.1f} to {span[-1]:.1f} %" for name, span in spans.items())
        + ", at the same frequencies."
    )


def _state(joint: IdentifiedJoint) -> str:
    return f"{joint.diameter_mm:g} mm at {joint.torque_nm:g} N m"


def _on_transfer(study: ER32Study) -> Iterator[str]:
    rows = study.transfers
    yield (
        f"With the paper's stiffnesses (table 5) our model meets the {len(study.published_predictions)} frequencies "
        "that the "
        f"paper predicts in table 2 to {study.published_predictions_rms_percent:.2f} % rms (consistency: they were "
        "used to "
        "infer the holder)."
    )
    worst = max(rows, key=lambda row: abs(row.error_percent))
    yield (
        f"With the joint identified anew at {study.published.recommended_torque_nm:g} N m it predicts the "
        f"{len(rows)} measured "
        f"ones to {study.transfer_rms_percent:.2f} % rms; the paper's predictions reach "
        f"{study.published_transfer_rms_percent:.2f} %. Furthest off: mode {worst.mode} of the {worst.diameter_mm:g} "
        "mm tool at "
        f"{worst.overhang_mm:g} mm, {worst.error_percent:+.2f} %."
    )


def _on_sets(study: ER32Study) -> Iterator[str]:
    threshold = study.parameter_sets[0].threshold_percent
    yield (
        f"A mode betrays a set when it is more than {threshold:.1f} % off, {study.settings.betrayal:g} times the rms "
        "error of the "
        "transfers above."
    )
    for verdict in study.parameter_sets:
        yield _on_set(verdict)


def _on_set(verdict: SetVerdict) -> str:
    worst = verdict.worst
    worst_text = f"worst error {worst.percent:+.1f} % ({_where(worst)})"
    first = verdict.first_betrayal()
    if first is None:
        return f"{verdict.name}: no mode betrays it; {worst_text}."
    long = next(error for error in verdict.errors if error.mode == 1)
    of_first_mode = verdict.first_betrayal(1)
    text = (
        f"{verdict.name}: betrayed by {'; '.join(_overhangs(verdict.betrayed_by))}; {worst_text}. The long tool's "
        "first mode "
        f"({long.percent:+.1f} %) "
    )
    if of_first_mode is long:
        return text + "shows it."
    if of_first_mode is None:
        return text + "does not show it, nor does the first mode at any other overhang."
    return (
        text + f"does not show it; the first mode does so from {of_first_mode.overhang_mm:g} mm down "
        f"({of_first_mode.percent:+.1f} %)."
    )


def _where(error: ModeError) -> str:
    return f"mode {error.mode} at {error.overhang_mm:g} mm"


def _overhangs(errors: Sequence[ModeError]) -> list[str]:
    groups: dict[float, list[ModeError]] = {}
    for error in errors:
        groups.setdefault(error.overhang_mm, []).append(error)
    return [
        f"mode{'s' if len(group) > 1 else ''} {' and '.join(f'{e.mode} ({e.percent:+.1f} %)' for e in group)} at "
        f"{overhang:g} mm"
        for overhang, group in groups.items()
    ]


def _on_trends(study: ER32Study) -> Iterator[str]:
    low, high = study.trends.torque_range_nm
    for quantity in ("k_y", "k_theta"):
        trends = [trend for trend in study.trends.torque if trend.quantity == quantity]
        for exceeds, words in ((True, "beyond what the resolution leaves open"), (False, "within the resolution")):
            group = [t for t in trends if t.exceeds is exceeds]
            if group:
                tools = ", ".join(
                    f"{t.change_percent:+.1f} % ({t.end_values.percent:+.1f} %) at {t.diameter_mm:g} mm" for t in group
                )
                yield (
                    f"{quantity} from {low:g} to {high:g} N m, by a line fitted to the values at all torques (by the "
                    f"two end values), changes {words}: {tools}."
                )
        steps = [step for trend in trends for step in trend.steps]
        up = sum(step.exceeds and step.percent > 0.0 for step in steps)
        down = sum(step.exceeds and step.percent < 0.0 for step in steps)
        yield (
            f"Of the {len(steps)} single steps of torque {quantity} rises in {up} and falls in {down} by more than the "
            f"resolution; {len(steps) - up - down} are within it."
        )
    for law in study.trends.diameter:
        low_s, high_s = law.scatter_interval
        within = [step for step in law.steps if not step.exceeds]
        falls = [step for step in law.steps if step.exceeds and step.percent < 0.0]
        text = (
            f"{law.quantity} over diameter at {law.torque_nm:g} N m: d^{law.exponent:.2f}, 95 % interval {low_s:.2f} "
            f"to {high_s:.2f} "
            f"from a scatter of {law.scatter_percent:.0f} % about the law (the resolution alone leaves "
            f"{_ends(law.interval)}); the "
            f"exponent {'exceeds' if law.exceeds else 'does not exceed'} both."
        )
        for step in falls:
            text += (
                f" From {step.start:g} to {step.end:g} mm it falls by {-step.percent:.1f} %, more than the resolution."
            )
        for step in within:
            text += f" From {step.start:g} to {step.end:g} mm the change is within the resolution."
        yield text
    yield (
        "Each state was clamped once: how much a second clamping would differ is not published, so a trend beyond the "
        "resolution is not yet a trend beyond repetition."
    )


def _ends(interval: tuple[float | None, float | None]) -> str:
    low, high = ("open" if end is None else f"{end:.2f}" for end in interval)
    return f"{low} to {high}"


def _on_bias(study: ER32Study) -> Iterator[str]:
    bias, chance = study.bias, study.settings.chance
    values = ", ".join(f"{p:+.2f}" for p in bias.percent)
    side = "low" if bias.mean_percent < 0.0 else "high"
    alike = all(p < 0.0 for p in bias.percent) or all(p > 0.0 for p in bias.percent)
    yield (
        f"First mode of the long tools, 100 (predicted / measured - 1): {values} %, mean {bias.mean_percent:+.2f} %"
        + (f"; predicted too {side} for all {len(bias.percent)} diameters." if alike else ".")
    )
    sources = ", ".join(f"{name} {value:.2f}" for name, value in bias.deviations_percent.items())
    yield (
        f"Chance means here: readings uniform over the step they are printed in; overhangs {chance.overhang_mm:g} mm "
        "(standard "
        f"deviation; those the paper prints twice differ as {study.overhang_scatter_mm:.2f} mm would); shared by all "
        "tools: "
        f"carbide E {chance.carbide_modulus_percent:g} % and density {chance.carbide_density_percent:g} %, steel E "
        f"{chance.steel_modulus_percent:g} % and density {chance.steel_density_percent:g} %, every dimension of the "
        "holder "
        f"{chance.holder_dimension_percent:g} %, nose factors {chance.nose_factor_percent:g} %. Standard deviation "
        "of the mean bias "
        f"in %: {sources}; together {bias.mean_deviation_percent:.2f}."
    )
    verdict = (
        "is too large for chance under this model"
        if bias.p_value < _USUAL
        else "cannot be told from chance under this model"
    )
    yield (
        f"Two-sided p = {bias.p_value:.3g} for the mean: the bias {verdict}. Simulating the whole procedure "
        f"{study.simulation.draws} times (seed {study.simulation.seed}) gives a standard deviation of "
        f"{study.simulation.deviation_percent:.2f} % and a mean as large in "
        f"{100 * study.simulation.share_as_large:.1f} % of the draws."
    )
    yield (
        "The answer depends on what all tools share: readings and overhangs alone give "
        f"{_small(bias.p_value_without_shared)}; with the standard errors of the inference "
        f"({bias.inference_deviation_percent:.2f} % of "
        f"the mean) in place of the stated tolerances of carbide and holder {_small(bias.p_value_with_inference)}, "
        "but those say how "
        "well the paper's own model is known, not how well that model fits the real parts."
    )
    count = len(bias.percent)
    # Variance of a mean of equally correlated numbers against that of independent ones.
    effective = count / (1.0 + (count - 1) * bias.mean_correlation)
    yield (
        f"Sign test: p = {bias.sign_test_p_value:.3g}, and it takes the tools as independent; under the model their "
        "errors "
        f"correlate with {bias.mean_correlation:.2f} on average, so {count} of them say as much as about "
        f"{effective:.1f} independent ones."
    )
    yield _on_causes(study)


def _small(p_value: float) -> str:
    return f"p = {p_value:.2g}" if p_value >= _TAIL else f"p < {_TAIL:g}"


def _on_causes(study: ER32Study) -> str:
    before = study.transfer_rms_percent
    least = study.causes[0]
    after = (
        ""
        if least.rms_percent is None
        else f", but table 2's rms then goes from {before:.2f} to {least.rms_percent:.2f} %"
    )
    if least.rms_percent is not None and least.rms_percent < before:
        after = f", and table 2's rms goes from {before:.2f} to {least.rms_percent:.2f} %"
    text = (
        f"The least unlikely single cause would be {least.name} {least.change:+.1f} {least.unit} "
        f"({_value(study.model, least.name, least.change)}"
        f"{least.deviations or 0.0:.1f} standard deviations){after}."
    )
    better = [c for c in study.causes if c.rms_percent is not None and c.rms_percent < before]
    if not better:
        return text + " No single cause removes the bias without making table 2 as a whole worse."
    torque = max(abs(t.change_percent) for t in study.trends.torque if t.quantity == "k_theta")
    names = "; ".join(f"{c.name} {c.change:+.1f} {c.unit} ({c.rms_percent:.2f} %)" for c in better)
    return (
        f"{text} Of all single causes only these improve table 2 as a whole: {names}; the whole range of torque "
        "changes k_theta by "
        f"at most {torque:.1f} % (fitted line). No cause is named."
    )


def _value(model: HolderModel, name: str, change: float) -> str:
    if name not in model.shared:
        return ""
    value, unit = model.value(name)
    return f"{value * (1.0 + 0.01 * change):.4g} {unit}, "


def _on_paper(study: ER32Study) -> Iterator[str]:
    for item in study.disagreements:
        text = (
            f"The paper disagrees with itself: {item.what} of the {item.diameter_mm:g} mm tool is {item.first:g} "
            f"{item.unit} in the "
            f"{item.first_source}, {item.second:g} {item.unit} in {item.second_source}."
        ).replace("in the table", "in table")
        if item.k_y_change_percent is not None and item.k_theta_change_percent is not None:
            text += (
                f" With the latter the identified k_y changes by {item.k_y_change_percent:+.1f} %, k_theta by "
                f"{item.k_theta_change_percent:+.1f} %."
            )
        yield text
    coarse = [f for r in study.published.readings for f in r.frequency_hz if f >= study.settings.resolution.change_hz]
    coarse += [f for t in study.published.transfers for f in t.measured_hz if f >= study.settings.resolution.change_hz]
    step = study.settings.resolution.coarse_hz
    odd = sorted({f for f in coarse if not np.isclose(f % step, 0.0)})
    if odd:
        yield (
            f"Of {len(coarse)} measured frequencies from {study.settings.resolution.change_hz / 1e3:g} kHz on all but "
            f"{', '.join(f'{f:g} Hz' for f in odd)} are multiples of {step:g} Hz."
        )
    yield (
        "Not done again, because it stands only in figures: insertion lengths of 40, 30 and 20 mm (figures 12, 13), "
        "high-speed steel "
        "against carbide (figure 15), damping over diameter (figure 6), and the machine-mounted tip FRFs (figures 7, "
        "16, 17)."
    )
