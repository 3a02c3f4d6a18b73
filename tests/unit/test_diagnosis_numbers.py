"""Numbers of a diagnosis against their definitions: folds exclude their data, strain, margins."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blank_in_holder import JOINT as TRUE
from blank_in_holder import STARTED as JOINT
from blank_in_holder import make_assembly, observe
from receptance import STEEL, Observation, PointJoint
from receptance.diagnosis import Model, diagnose
from receptance.diagnosis.explanation import Explanation
from receptance.diagnosis.fitting import fit_base, refit
from receptance.diagnosis.held_out import SPECTRAL, predict
from receptance.diagnosis.judgement import conclude
from receptance.diagnosis.prediction import average
from receptance.diagnosis.thresholds import MARGIN
from receptance.fit import Law, PredictedFrequencies, PredictedMode, Scatter
from variant_of_cause import extended_by

SEED = 31
LINES = np.linspace(200.0, 6000.0, 300)


def make_observations(overhang: float, factor: Any = 1.0, joint: PointJoint = TRUE, sd: float = 0.01) -> Observation:
    described = make_assembly(overhang, material=STEEL)
    true = make_assembly(overhang, material=STEEL, joint=joint).receptance(LINES)
    return observe(
        described, LINES, factor * true, np.random.default_rng([SEED, int(1e3 * overhang)]), f"{overhang}", sd
    )


def test_folds_exclude_their_held_out_data() -> None:
    """One overhang was clamped differently: fits with it adapt, fits without it do not."""
    data = [make_observations(0.06), make_observations(0.08), make_observations(0.1, joint=replace(TRUE, k_theta=7e4))]
    verdict = diagnose(data, JOINT, causes=["tool_density", "calibration_gain"], max_causes=1, held_out=True)
    spectral = next(one for one in verdict.gains if one.metric == SPECTRAL)
    for index, fold in enumerate(spectral.folds):
        others = tuple(one for i, one in enumerate(data) if i != index)
        alone = predict(fit_base(Model(others, tuple(JOINT))), Model((data[index],), tuple(JOINT))).metrics[SPECTRAL]
        assert fold["before"] == pytest.approx(alone, rel=1e-4)
    everything = fit_base(Model(tuple(data), tuple(JOINT)))
    measured_data = predict(everything, Model((data[2],), tuple(JOINT))).metrics[SPECTRAL]
    assert spectral.folds[2]["before"] > 1.2 * measured_data


def test_small_common_offset_is_not_noise() -> None:
    """Half the noise, slowly waving: each line has it within its noise, eight neighbours together do not."""
    slowly = np.exp(0.0075j * np.exp(1j * LINES / 250.0))
    fits = [
        refit(Model((make_observations(0.06, f), make_observations(0.08, f)), tuple(JOINT)), {}) for f in (1.0, slowly)
    ]
    quiet, waving = (fit.adequacy for fit in fits)
    assert quiet.passed
    assert waving.misfit < waving.limit
    assert waving.strain.passed
    assert not waving.passed
    assert "in sums over neighbouring lines" in waving.shortcoming
    # An explanation is adequate by the same rules.
    assert [Explanation((), fit, 0.0, 0.0).passed for fit in fits] == [True, False]


def test_explanations_within_the_margin_are_reported_and_others_are_not() -> None:
    data = [make_observations(x, 1.05) for x in (0.06, 0.08, 0.1)]
    ids = ["calibration_gain", "exponential_window"]
    selection = diagnose(data, JOINT, causes=ids, max_causes=1).selection
    (best,) = [one for one in selection.singles if one.ids == {"calibration_gain"}]
    (other,) = [one for one in selection.singles if one.ids == {"exponential_window"}]
    for behind, answer in ((0.5 * MARGIN, "ambiguous"), (1.5 * MARGIN, "named")):
        # As good a fit under another name, so much less likely.
        other_explanation = replace(best, variants=other.variants, evidence=best.evidence - behind)
        judgement = conclude(replace(selection, explanations=[best, other_explanation]))
        assert judgement.answer == answer
        assert ("exponential_window" in judgement.ambiguous_between) == (answer == "ambiguous")


def test_predictions_include_other_adequate_models() -> None:
    """The law of total variance: the mean of the variances, and that of the squared distances."""
    reported, other = (
        PredictedFrequencies(
            modes=(PredictedMode(mode=1, predicted_hz=frequency),),
            scatter=Scatter(np.array([spread]), np.array([spread]), {}),
        )
        for frequency, spread in ((1000.0, 2.0), (1010.0, 3.0))
    )
    assert average(reported, [(0.25, other)]) ** 2 == pytest.approx(0.75 * 2.0**2 + 0.25 * (3.0**2 + 10.0**2))


def test_a_coupling_term_varies_with_the_clamping_like_the_others() -> None:
    """Clampings that scatter by some per cent scatter in all terms of the joint."""
    stiff, ratio = (1.04, 0.97, 1.02, 0.96), -0.3
    laws = [
        Law(address="joint.k_y", lower=1e6, upper=1e11, start=6e8, individual=0.03),
        Law(address="joint.k_theta", lower=1e2, upper=1e8, start=1e5, individual=0.03),
        *JOINT[2:],
    ]
    data = []
    for overhang, share in zip((0.06, 0.075, 0.09, 0.105), stiff, strict=True):
        k_y, k_theta = 6e8 * share, 1e5 * share
        joint = replace(TRUE, k_y=k_y, k_theta=k_theta, k_ytheta=ratio * np.sqrt(k_y * k_theta))
        data.append(make_observations(overhang, joint=joint, sd=1e-3))
    stiffness = extended_by(Model(tuple(data), tuple(laws)), "joint_cross_term", "stiffness")
    fit = refit(stiffness, {"joint_cross_term.k_ytheta": ratio * np.sqrt(6e13)})
    assert fit.adequacy.passed
    assert fit.values["joint_cross_term.k_ytheta"] == pytest.approx(ratio * np.sqrt(6e13), rel=0.03)


def test_negligible_second_cause_is_omitted() -> None:
    """A delay of thirty nanoseconds is in every record, and no explanation of a gain beside it."""
    for delay, named in ((3e-8, ["calibration_gain"]), (2e-6, ["calibration_gain", "time_delay"])):
        chain = 1.05 * np.exp(-2j * np.pi * LINES * delay)
        data = [make_observations(x, chain, sd=1e-3) for x in (0.06, 0.08, 0.1)]
        verdict = diagnose(data, JOINT, causes=["calibration_gain", "time_delay"])
        assert (verdict.verdict, sorted(one.id for one in verdict.causes)) == ("named", named)
