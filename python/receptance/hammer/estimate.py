"""Estimates of FRFs from hits: H1, H2 and Hv, with coherence, variance and usable band."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypedDict, get_args

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.errors import warn_user
from receptance.frf import FRF
from receptance.hammer.hits import Hits, find_hits
from receptance.hammer.records import HammerRecords, Quantity
from receptance.hammer.spectra import (
    NEGLIGIBLE,
    Channel,
    Estimator,
    Exclusions,
    ExponentialOn,
    Limits,
    Reason,
    Spectra,
    Windows,
    make_windows,
)
from receptance.report.table import percent
from receptance.units import FORMS

_WARNING_SHARE = 0.01
"""Share of excluded lines in the band of the force above which a warning is issued."""
_DECAYED = 0.1
"""Amplitude at the end of the block under a suggested exponential window, in standard deviations of the log FRF."""
_MIN_CORRELATED = 1.05
"""Number of correlated lines above which a note is added."""
_RESPONSE_WINDOW = Reason("exponential", "on no line: the exponential window is on the response alone")


class EstimateKeywords(TypedDict, total=False):
    """Options of `estimate_frf` that other functions pass on; their meaning is described there."""

    estimator: Estimator
    decay_rate: float
    exponential_on: ExponentialOn
    force_window_s: float | Literal["auto"] | None
    low_hz: float | None
    high_hz: float | None
    pooled_lines: int | None
    force_drop_db: float
    largest_deviation: float


def estimate_frf(
    hits: Hits | HammerRecords | Sequence[HammerRecords],
    *,
    estimator: Estimator = "H1",
    decay_rate: float = 0.0,
    exponential_on: ExponentialOn = "both",
    force_window_s: float | Literal["auto"] | None = "auto",
    low_hz: float | None = None,
    high_hz: float | None = None,
    pooled_lines: int | None = None,
    force_drop_db: float = 20.0,
    largest_deviation: float = 0.12,
) -> FRF:
    """Estimate the FRF from several hits, with its variance.

    With F_i and X_i the windowed spectra of force and response of hit i, and S_fx = sum(conj(F_i) X_i) and so on:
    H1 = S_fx / S_ff is too small by the share r of noise on the force in |F|^2; H2 = S_xx / S_xf is too large by noise
    on the response; Hv = S_fx / (S_ff (1 - r)) is total least squares with the noise on the force as measured outside
    contacts, and lies between H1 and H2. If that noise could not be measured, Hv assumes equal shares of noise on both
    channels, sqrt(H1 H2) (Rocklin, Crowley and Vold 1985).

    Parameters
    ----------
    hits : Hits, HammerRecords or sequence of HammerRecords
        Result of `find_hits`; records are searched with its default settings.
    estimator : {"H1", "H2", "Hv"}, optional
        See above; H1 is suitable unless the force is noisy.
    decay_rate : float, optional
        sigma in 1/s of an exponential window e^(-sigma t), for responses that have not decayed at the end of the
        record. With the window on both channels and one origin, the values are exactly those of the FRF at the complex
        frequency w - i sigma. They are not corrected; the FRF states the decay rate.
    exponential_on : {"both", "response"}, optional
        "response" reproduces recorders that do not window the force. The values are then those of the FRF neither at
        real nor at complex frequencies, so that no line is usable, with a warning.
    force_window_s : float, "auto" or None, optional
        Length of the force window from the beginning of the contact; the force outside is noise and set to zero.
        "auto": twice the longest contact. The slopes on both sides have the length of one contact. None: the whole
        block.
    low_hz, high_hz : float, optional
        Band of the lines; by default all but 0 Hz and half the sampling rate.
    pooled_lines : int, optional
        Odd number of lines over which the variance is pooled; 1: none. By default the fewest that give 60 degrees of
        freedom, at most 129.
    force_drop_db : float, optional
        Level of the force spectrum, below its maximum, at which the usable band ends.
    largest_deviation : float, optional
        Largest standard deviation of the log FRF of a usable line; it is exceeded around antiresonances.

    Returns
    -------
    FRF
        `(n, n_channels, 1)`, in the form of the records' quantity, with `coherence`, `averages`, `log_variance`,
        `degrees_of_freedom`, `usable` (in all channels; use `records.channel(k)` for a single channel), `decay_rate`,
        and `notes` on the processing and the excluded lines.

    Raises
    ------
    TypeError, ValueError
        Invalid settings, or no kept hit (the message has the reasons).

    Warns
    -----
    ReceptanceWarning
        A single hit, a window on the response alone, a truncated response, bias of H1 by noise on the force, or no
        usable line.

    Notes
    -----
    Pulses are deterministic: with the force spectra F_i known, H1 is the least-squares slope of X_i = H F_i + e_i.
    H1 - H is therefore Gaussian with the variance E|e|^2 / S_ff for any strength of the hits, and independent of
    sum |X_i - H1 F_i|^2, which is E|e|^2 / 2 times a chi-square of 2 (n - 1) degrees of freedom. With the coherence g^2
    the real part and the imaginary part of log H1 each have the variance (1 - g^2) / (2 (n - 1) g^2), to first order
    (Bendat and Piersol, Random Data, chapter 9, with n for n - 1). It is pooled over neighbouring lines
    (`receptance.frf.variance.pool_variance`) and multiplied by up to 2 at low frequencies, where noise on the force
    through a short window changes magnitudes and not phases. H2 and Hv differ from H1 in second order only and have the
    same variance.

    Known errors from noise on the force, truncated responses and force outside the window exclude a line if they exceed
    a quarter of the standard deviation and 0.1 %; otherwise their squares are added to the variance.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.hammer import HammerRecords, estimate_frf
    >>> noise = np.random.default_rng(1)
    >>> time = np.arange(8192) / 8192.0
    >>> force = np.array([p * np.where(time < 2e-3, np.sin(500 * np.pi * time), 0.0) for p in (60.0, 90.0, 75.0)])
    >>> force = np.roll(force, 100, axis=1)
    >>> ring = np.exp(-30.0 * time) * np.sin(2 * np.pi * 150.0 * time)
    >>> response = np.array([np.convolve(pulse, ring)[:8192] for pulse in force])
    >>> response += 0.01 * noise.standard_normal(response.shape)
    >>> records = HammerRecords(force=force, response=response, sample_rate_hz=8192.0, quantity="velocity")
    >>> frf = estimate_frf(records)
    >>> frf.form, frf.averages
    ('mobility', 3)
    """
    _checks.one_of("estimate_frf", "estimator", estimator, Estimator)
    _checks.one_of("estimate_frf", "exponential_on", exponential_on, ExponentialOn)
    decay_rate = _checks.not_negative("estimate_frf", "decay_rate", decay_rate, unit="1/s")
    limits = Limits(
        _checks.positive("estimate_frf", "force_drop_db", force_drop_db, unit="dB"),
        _checks.positive("estimate_frf", "largest_deviation", largest_deviation),
        _half_width(pooled_lines),
    )
    hits = hits if isinstance(hits, Hits) else find_hits(hits)
    if not hits.kept:
        raise ValueError(f"estimate_frf: all hits were dropped\n{hits.summary()}")
    windows = make_windows(hits, decay_rate, force_window_s, exponential_on)
    spectra = Spectra(hits, windows, low_hz, high_hz)
    channels = [spectra.channel(index, estimator, limits) for index in range(hits.records[0].n_channels)]
    excluded = {
        reason: np.any([channel.excluded[reason] for channel in channels], axis=0) for reason in channels[0].excluded
    }
    if exponential_on == "response" and decay_rate > 0.0:
        excluded = {_RESPONSE_WINDOW: np.ones(spectra.frequency_hz.size, dtype=bool)}
    usable = ~np.any(list(excluded.values()), axis=0)
    messages = _warnings(spectra, channels, excluded, usable, estimator, limits, decay_rate)
    if messages:
        label = f"{hits.records[0].label}: " if hits.records[0].label else ""
        warn_user(label + "; ".join(messages))
    processing = _processing_notes(hits, windows, channels, estimator, decay_rate, exponential_on, force_window_s)
    records = hits.records[0]
    total = f" of {len(hits.hits)}" if len(hits.hits) > len(hits.kept) else ""
    notes = (*hits.notes, *processing, *usable_band_notes(spectra.frequency_hz, excluded), *messages)

    def stacked(name: str) -> Any:
        parts = [getattr(channel, name) for channel in channels]
        return None if parts[0] is None else np.stack(parts, axis=1)[:, :, None]

    return FRF(
        frequency_hz=spectra.frequency_hz,
        **{name: stacked(name) for name in ("values", "coherence", "log_variance", "degrees_of_freedom")},
        form=FORMS[get_args(Quantity).index(records.quantity)],
        responses=records.responses,
        excitations=(records.excitation,),
        decay_rate=0.0 if _RESPONSE_WINDOW in excluded else decay_rate + records.response_decay_rate,
        averages=len(hits.kept),
        correlated_lines=np.max([channel.correlated_lines for channel in channels], axis=0),
        usable=usable,
        label=records.label,
        source=f"{estimator} of {len(hits.kept)}{total} hits" + (f", {records.source}" if records.source else ""),
        notes=notes,
    )


def _half_width(pooled_lines: int | None) -> int | None:
    if pooled_lines is None:
        return None
    is_whole = isinstance(pooled_lines, (int, np.integer)) and not isinstance(pooled_lines, bool)
    if not is_whole or pooled_lines < 1 or pooled_lines % 2 == 0:
        raise ValueError(f"estimate_frf: pooled_lines is {pooled_lines!r}, expected an odd number")
    return int(pooled_lines) // 2


def _processing_notes(
    hits: Hits,
    windows: Windows,
    channels: Sequence[Channel],
    estimator: Estimator,
    decay_rate: float,
    exponential_on: ExponentialOn,
    force_window_s: float | Literal["auto"] | None,
) -> list[str]:
    notes = [f"{estimator} of {len(hits.kept)} hits, blocks of {hits.duration_s:g} s"]
    if force_window_s is not None:
        open_s = windows.force_window.size / hits.sample_rate_hz
        notes.append(f"force window: {1e3 * open_s:.3g} ms around the contact, including its slopes")
    recorded = hits.records[0].response_decay_rate
    if recorded > 0.0:
        notes.append(
            f"the recorder's exponential window of {recorded:g} 1/s on the response was applied to the force as well"
        )
    if decay_rate > 0.0:
        windowed = "both channels" if exponential_on == "both" else "the response alone"
        notes.append(f"exponential window of {decay_rate:g} 1/s on {windowed}")
    freedoms = [channel.degrees_of_freedom for channel in channels if channel.degrees_of_freedom is not None]
    if freedoms:
        least = min(float(np.median(freedom)) for freedom in freedoms)
        notes.append(f"variance from the scatter between hits, with {least:.0f} degrees of freedom on the median line")
    correlated = max(float(np.median(channel.correlated_lines)) for channel in channels)
    if correlated > _MIN_CORRELATED:
        notes.append(f"the windows correlate neighbouring lines: about {correlated:.1f} lines per independent value")
    return notes


def _warnings(
    spectra: Spectra,
    channels: Sequence[Channel],
    excluded: Exclusions,
    usable: NDArray[np.bool_],
    estimator: Estimator,
    limits: Limits,
    decay_rate: float,
) -> list[str]:
    """Return the warnings, which are notes as well."""
    if _RESPONSE_WINDOW in excluded:
        return [
            "the exponential window is on the response alone: these values are neither the FRF on the real lines nor "
            "that at w - i sigma (the response is weakened by e^(-sigma t) from the beginning of the block, the force "
            "is not), so no line is usable; apply the window to both channels"
        ]
    messages = []
    if len(spectra.force) == 1:
        messages.append("there is a single hit: no coherence, no variance, and no check of repeatability")
    inside = ~np.any(list(spectra.out_of_range(limits).values()), axis=0)
    for reason, lines in excluded.items():
        share = np.mean(lines[inside]) if inside.any() else 0.0
        if share <= _WARNING_SHARE:
            continue
        extent = f"on {share:.0%} of the lines in the band of the force"
        if reason.kind == "noise":
            remedy = "Hv accounts for noise on the force" if estimator == "H1" else "use Hv"
            messages.append(f"{extent} noise biases {estimator}; {remedy}")
        elif reason.kind == "truncation":
            messages.append(f"{extent} {_truncation_warning(spectra, channels, inside, decay_rate)}")
        elif reason.kind == "window":
            messages.append(
                f"{extent} there is force outside the force window (a bounce, or ringing of the sensor); give a longer "
                "force_window_s"
            )
    if spectra.noise_share is None:
        messages += _unknown_noise_warnings(channels, len(spectra.force), estimator, inside)
    if not usable.any():
        messages.append("no line is usable; see the notes")
    return messages


def _truncation_warning(
    spectra: Spectra, channels: Sequence[Channel], inside: NDArray[np.bool_], decay_rate: float
) -> str:
    after = spectra.hits.duration_s - spectra.release / spectra.hits.sample_rate_hz
    remainder = max(float(channel.remainder[inside].max()) for channel in channels)
    deviation = min(float(np.median(np.sqrt(c.log_variance[inside]))) for c in channels if c.log_variance is not None)
    further = max(float(np.log(max(remainder / (_DECAYED * deviation), 1.0))) / after, 1e-6)
    # Rounded up to two digits.
    unit = 10.0 ** (np.floor(np.log10(further)) - 1.0)
    rate = decay_rate + float(np.ceil(further / unit) * unit)
    return (
        f"the response has not decayed at the end of the block (to {percent(remainder)}); use longer blocks, or "
        f"an exponential window (decay_rate={rate:g})"
    )


def _unknown_noise_warnings(
    channels: Sequence[Channel], hits: int, estimator: Estimator, inside: NDArray[np.bool_]
) -> list[str]:
    variances = [channel.log_variance[inside] for channel in channels if channel.log_variance is not None]
    # Upper limit: all scatter of a hit is on the channel that biases the estimator.
    bias = max((float(np.median(2 * hits * variance)) for variance in variances if variance.size), default=0.0)
    if estimator == "Hv":
        bias = 0.5 * bias
    if bias <= NEGLIGIBLE:
        return []
    direction = {"H1": "too small", "H2": "too large", "Hv": "too small or too large"}[estimator]
    return [
        "noise on the force could not be estimated (too little silence around the hits, or a force window of the "
        f"recorder); {estimator} may be {direction} by up to {percent(bias)}, the median of all scatter"
    ]


def usable_band_notes(frequency_hz: NDArray[np.float64], excluded: Exclusions) -> tuple[str, ...]:
    """Return notes on the usable lines and on those excluded for each reason; a line counts for its first reason."""
    usable = ~np.any(list(excluded.values()), axis=0)
    if usable.any():
        low, high = frequency_hz[usable][[0, -1]]
        lines = [f"usable: {usable.sum()} of {usable.size} lines, from {low:g} to {high:g} Hz"]
    else:
        lines = ["no line is usable"]
    counted = np.zeros(usable.size, dtype=bool)
    for reason, lines_excluded in excluded.items():
        new = lines_excluded & ~counted
        counted |= lines_excluded
        if new.any():
            low, high = frequency_hz[new][[0, -1]]
            extent = f"{new.sum()} lines between {low:g} and {high:g} Hz" if new.sum() > 1 else f"1 line at {low:g} Hz"
            lines.append(f"not usable: {extent}, {reason.text}")
    return tuple(lines)
