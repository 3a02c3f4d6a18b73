"""FRFs from hits: H1, H2 and Hv, with coherence, variance and usable band."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.measurement.band import NEGLIGIBLE, summary
from receptance.measurement.hits import Hits
from receptance.measurement.records import TimeRecords
from receptance.measurement.search import Settings, find
from receptance.measurement.spectra import Channel, Estimator, Limits, Spectra
from receptance.measurement.windows import ExponentialOn, Windows, make_windows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.frf import FRF

__all__ = ["estimate_frf"]

_FORMS: dict[str, Literal["receptance", "mobility", "accelerance"]] = {
    "displacement": "receptance",
    "velocity": "mobility",
    "acceleration": "accelerance",
}
_WORTH_SAYING = 0.01
"""Share of the lines of the force's band from which on something is said in a warning."""
_DEAD = 0.1
"""Over the standard deviation: to what an exponential window that is suggested brings the response."""
_ALIKE = 1.05
"""Lines that count as one from which on that is said."""
_NO_LINE = "on no line at all: the exponential window is on the response alone"


def estimate_frf(
    hits: Hits | TimeRecords | Sequence[TimeRecords],
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

    With F_i and X_i the windowed spectra of force and response of hit i, S_fx = sum(conj(F_i) X_i) and so on:
    H1 = S_fx / S_ff, which noise on the force makes small by the share r of that noise in |F|^2; H2 = S_xx / S_xf,
    which noise on the response makes large; Hv = S_fx / (S_ff (1 - r)), total least squares with the noise on the
    force as it was measured while no hammer touched and everything else that scatters on the response. It lies
    between H1 and H2. Where no noise could be measured, Hv takes equal shares of noise on both channels,
    sqrt(H1 H2) (Rocklin, Crowley and Vold 1985).

    Parameters
    ----------
    hits : Hits, TimeRecords or sequence of TimeRecords
        What `find_hits` returned; records are searched with its default settings.
    estimator : {"H1", "H2", "Hv"}, optional
        See above. H1 unless the force is noisy.
    decay_rate : float, optional
        sigma in 1/s of an exponential window e^(-sigma t), for responses that have not died away when the record
        ends. It is not taken out afterwards: with the window on both channels, with one origin, the values are those
        of the FRF at the complex frequency w - i sigma, exactly, and the FRF carries the decay rate with it.
    exponential_on : {"both", "response"}, optional
        "response" shows what a recorder gives that does not window the force: the values belong to no line, neither
        real nor complex. No line is usable then, and that is said.
    force_window_s : float, "auto" or None, optional
        How long the force counts after the contact begins; outside it is noise and set to zero. "auto": twice the
        longest contact. Windows fall over one more contact, on both sides. None: the whole block.
    low_hz, high_hz : float, optional
        Band of the lines that are wanted; by default all but 0 Hz and half the sampling rate.
    pooled_lines : int, optional
        Lines, an odd number, over which the variance is pooled; 1: none. By default as few as give 60 degrees of
        freedom, at most 129.
    force_drop_db : float, optional
        The usable band ends where the force's spectrum is so far below its largest.
    largest_deviation : float, optional
        Largest standard deviation of the log FRF of a usable line; around antiresonances there is more.

    Returns
    -------
    FRF
        `(n, n_channels, 1)`, in the form that belongs to the records' quantity, with `coherence`, `averages`,
        `log_variance` and its `degrees_of_freedom`, `usable` (in all channels; take `records.channel(k)` for one of
        them), `decay_rate`, and in `notes` what was done and which lines are not usable and why.

    Raises
    ------
    TypeError, ValueError
        Unusable settings, or no hit that is kept (the message says why each was dropped).

    Warns
    -----
    ReceptanceWarning
        One hit only, a window on the response alone, a response that has not died away, noise on the force that
        makes H1 too small, or no usable line.

    Notes
    -----
    A pulse is what it is, not a random signal: with the force spectra F_i known, H1 is the least-squares slope of
    X_i = H F_i + e_i. So H1 - H is Gaussian with variance E|e|^2 / S_ff, however much the hits differ in strength, and
    sum |X_i - H1 F_i|^2 is E|e|^2 / 2 times a chi-square of 2 (n - 1) degrees of freedom, independent of it. With the
    coherence g^2 that is a variance of the real and of the imaginary part, each, of log H1 of
    (1 - g^2) / (2 (n - 1) g^2), to first order (Bendat and Piersol, Random Data, chapter 9, have n for n - 1). It is
    pooled over neighbouring lines (`receptance.frf.variance.pool_variance`) and multiplied by up to 2 where noise on
    the force goes through so short a window that it changes magnitudes and not phases. H2 and Hv differ from H1 in the
    second order only, so the same variance holds for them.

    Errors that are known but not taken out, of noise on the force, of responses that the block cuts off and of pulses
    that the window cuts off, exclude a line where they are over a quarter of the standard deviation and over 0.1 %;
    elsewhere their squares are added to the variance.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.measurement import TimeRecords, estimate_frf
    >>> noise = np.random.default_rng(1)
    >>> time = np.arange(8192) / 8192.0
    >>> force = np.array([p * np.where(time < 2e-3, np.sin(500 * np.pi * time), 0.0) for p in (60.0, 90.0, 75.0)])
    >>> force = np.roll(force, 100, axis=1)
    >>> ring = np.exp(-30.0 * time) * np.sin(2 * np.pi * 150.0 * time)
    >>> response = np.array([np.convolve(one, ring)[:8192] for one in force])
    >>> response += 0.01 * noise.standard_normal(response.shape)
    >>> records = TimeRecords(force=force, response=response, sample_rate_hz=8192.0, quantity="velocity")
    >>> frf = estimate_frf(records)
    >>> frf.form, frf.averages
    ('mobility', 3)
    """
    if estimator not in get_args(Estimator):
        raise ValueError(f"estimate_frf: estimator is {estimator!r}, expected one of {', '.join(get_args(Estimator))}")
    if exponential_on not in get_args(ExponentialOn):
        raise ValueError(f"estimate_frf: exponential_on is {exponential_on!r}, expected one of both, response")
    decay_rate = _checks.not_negative("estimate_frf", "decay_rate", decay_rate, unit="1/s")
    limits = Limits(
        _checks.positive("estimate_frf", "force_drop_db", force_drop_db, unit="dB"),
        _checks.positive("estimate_frf", "largest_deviation", largest_deviation),
        _half_width(pooled_lines),
    )
    found = hits if isinstance(hits, Hits) else find(hits, Settings(), stacklevel=3)
    if not found.kept:
        raise ValueError(f"estimate_frf: no hit is fit for use\n{found.table()}")
    windows = make_windows(found, decay_rate, force_window_s, exponential_on)
    spectra = Spectra(found, windows, low_hz, high_hz)
    channels = [spectra.channel(index, estimator, limits) for index in range(found.records[0].n_channels)]
    refused = _together(channels)
    if exponential_on == "response" and decay_rate > 0.0:
        refused = {_NO_LINE: np.ones(spectra.frequency_hz.size, dtype=bool)}
    usable = ~np.any(list(refused.values()), axis=0)
    said = _worth_saying(spectra, channels, refused, usable, estimator, limits, decay_rate)
    if said:
        label = f"{found.records[0].label}: " if found.records[0].label else ""
        warnings.warn(label + "; ".join(said), ReceptanceWarning, stacklevel=2)
    done = _what_was_done(found, windows, channels, estimator, decay_rate, exponential_on, force_window_s)
    return _frf(
        found,
        spectra,
        channels,
        decay_rate=0.0 if _NO_LINE in refused else decay_rate + found.records[0].response_decay_rate,
        usable=usable,
        estimator=estimator,
        notes=(*found.notes, *done, *summary(spectra.frequency_hz, refused), *said),
    )


def _half_width(pooled_lines: int | None) -> int | None:
    if pooled_lines is None:
        return None
    whole = isinstance(pooled_lines, (int, np.integer)) and not isinstance(pooled_lines, bool)
    if not whole or pooled_lines < 1 or pooled_lines % 2 == 0:
        raise ValueError(f"estimate_frf: pooled_lines is {pooled_lines!r}, expected an odd number")
    return int(pooled_lines) // 2


def _together(channels: Sequence[Channel]) -> dict[str, NDArray[np.bool_]]:
    """Return the refused lines of all channels by reason."""
    reasons = channels[0].refused
    return {reason: np.any([channel.refused[reason] for channel in channels], axis=0) for reason in reasons}


def _frf(
    hits: Hits,
    spectra: Spectra,
    channels: Sequence[Channel],
    *,
    decay_rate: float,
    usable: NDArray[np.bool_],
    estimator: Estimator,
    notes: tuple[str, ...],
) -> FRF:
    from receptance.frf import FRF

    records = hits.records[0]

    def stacked(parts: list[Any]) -> Any:
        return None if parts[0] is None else np.stack(parts, axis=1)[:, :, None]

    of_all = f" of {len(hits.hits)}" if len(hits.hits) > len(hits.kept) else ""
    return FRF(
        frequency_hz=spectra.frequency_hz,
        values=stacked([channel.values for channel in channels]),
        form=_FORMS[records.quantity],
        responses=records.responses,
        excitations=(records.excitation,),
        decay_rate=decay_rate,
        coherence=stacked([channel.coherence for channel in channels]),
        averages=len(hits.kept),
        log_variance=stacked([channel.log_variance for channel in channels]),
        degrees_of_freedom=stacked([channel.degrees_of_freedom for channel in channels]),
        correlated_lines=np.max([channel.alike_lines for channel in channels], axis=0),
        usable=usable,
        label=records.label,
        source=f"{estimator} of {len(hits.kept)}{of_all} hits" + (f", {records.source}" if records.source else ""),
        notes=notes,
    )


def _what_was_done(
    hits: Hits,
    windows: Windows,
    channels: Sequence[Channel],
    estimator: Estimator,
    decay_rate: float,
    exponential_on: ExponentialOn,
    force_window_s: float | Literal["auto"] | None,
) -> list[str]:
    done = [f"{estimator} of {len(hits.kept)} hits, blocks of {hits.duration_s:g} s"]
    if force_window_s is not None:
        open_s = windows.shape.size / hits.sample_rate_hz
        done.append(f"force window: {1e3 * open_s:.3g} ms around the contact, with its slopes")
    recorded = hits.records[0].response_decay_rate
    if recorded > 0.0:
        done.append(
            f"the recorder's exponential window of {recorded:g} 1/s on the response was put on the force as well"
        )
    if decay_rate > 0.0:
        where = "both channels" if exponential_on == "both" else "the response alone"
        done.append(f"exponential window of {decay_rate:g} 1/s on {where}")
    freedoms = [channel.degrees_of_freedom for channel in channels if channel.degrees_of_freedom is not None]
    if freedoms:
        least = min(float(np.median(freedom)) for freedom in freedoms)
        done.append(f"variance from the scatter between hits, with {least:.0f} degrees of freedom on the median line")
    alike = max(float(np.median(channel.alike_lines)) for channel in channels)
    if alike > _ALIKE:
        done.append(f"the windows make neighbouring lines alike: about {alike:.1f} of them count as one")
    return done


def _worth_saying(
    spectra: Spectra,
    channels: Sequence[Channel],
    refused: dict[str, NDArray[np.bool_]],
    usable: NDArray[np.bool_],
    estimator: Estimator,
    limits: Limits,
    decay_rate: float,
) -> list[str]:
    """Return what a person should know: it goes into a warning and into the notes."""
    if _NO_LINE in refused:
        return [
            "the exponential window is on the response alone: these values are neither the FRF on the real lines nor "
            "that at w - i sigma (the response is weakened by e^(-sigma t) from the block's beginning, the force is "
            "not), so no line is usable; put the window on both channels"
        ]
    said = []
    if len(spectra.force) == 1:
        said.append("there is one hit only: no coherence, no variance, and nothing that tells whether hits repeat")
    inside = ~np.any(list(spectra.outside(limits).values()), axis=0)
    share = {reason: np.mean(lines[inside]) if inside.any() else 0.0 for reason, lines in refused.items()}
    for reason in refused:
        if share[reason] <= _WORTH_SAYING:
            continue
        if "noise makes" in reason:
            remedy = "Hv allows for noise on the force" if estimator == "H1" else "use Hv"
            said.append(
                f"on {share[reason]:.0%} of the lines that the force reaches noise makes {estimator} wrong; {remedy}"
            )
        elif "died away" in reason:
            said.append(
                f"on {share[reason]:.0%} of the lines that the force reaches "
                + _not_dead(spectra, channels, inside, decay_rate)
            )
        elif "cuts off" in reason:
            said.append(
                f"on {share[reason]:.0%} of the lines that the force reaches there is force outside the force's window "
                "(a bounce, or the sensor's own ringing); give a longer force_window_s"
            )
    if spectra.noise_share is None:
        said += _unknown_noise(channels, len(spectra.force), estimator, inside)
    if not usable.any():
        said.append("no line is usable; the notes say why")
    return said


def _not_dead(spectra: Spectra, channels: Sequence[Channel], inside: NDArray[np.bool_], decay_rate: float) -> str:
    after = spectra.hits.duration_s - spectra.over / spectra.hits.sample_rate_hz
    left = max(float(channel.left[inside].max()) for channel in channels)
    wanted = min(float(np.median(np.sqrt(c.log_variance[inside]))) for c in channels if c.log_variance is not None)
    rate = decay_rate + _rounded_up(np.log(max(left / (_DEAD * wanted), 1.0)) / after)
    return (
        f"the response has not died away when the block ends (down to {100.0 * left:.2g} %); longer blocks help, or "
        f"an exponential window (decay_rate={rate:g})"
    )


def _unknown_noise(
    channels: Sequence[Channel], hits: int, estimator: Estimator, inside: NDArray[np.bool_]
) -> list[str]:
    variances = [channel.log_variance[inside] for channel in channels if channel.log_variance is not None]
    # All scatter of one hit, were it on the one channel that makes the estimator wrong.
    most = max((float(np.median(2 * hits * variance)) for variance in variances if variance.size), default=0.0)
    if estimator == "Hv":
        most = 0.5 * most
    if most <= NEGLIGIBLE:
        return []
    which = {"H1": "too small", "H2": "too large", "Hv": "too small or too large"}[estimator]
    return [
        "noise on the force could not be measured (too little silence around the hits, or the recorder's own force "
        f"window); {estimator} may be {which} by up to {100.0 * most:.2g} %, the median of all scatter"
    ]


def _rounded_up(value: float) -> float:
    """Two digits are enough for a suggestion."""
    scale = 10.0 ** (np.floor(np.log10(max(value, 1e-6))) - 1.0)
    return float(np.ceil(value / scale) * scale)
