"""Figures of modal estimates."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from known_modes import FORMS, frf_of
from receptance.modal import fit_modes, ring_down

F = np.arange(160.0, 240.0, 0.5)


@pytest.mark.parametrize("form", FORMS)
def test_modal_fit(form):
    frf = frf_of(F, [180.0, 200.0], [0.01, 0.004], [[1.0, 2.0], [0.5, -1.0]], form=form, noise=1e-3, decay_rate=3.0)
    fit = fit_modes(frf, 2)
    figure = fit.plot(response=1)
    panels = figure.axes
    assert panels[0].get_title(loc="left") == "Measured and fitted"
    assert form in panels[0].get_ylabel()
    curves = {line.get_label(): line for line in panels[0].get_lines()}
    np.testing.assert_allclose(curves["measured"].get_ydata(), np.abs(frf.values[:, 1, 0]))
    # The drawn fit runs through the measured points, between lines as well.
    x, y = curves["fitted"].get_data()
    np.testing.assert_allclose(np.interp(F, x, y), np.abs(fit.synthesised()[:, 1, 0]), rtol=2e-2)
    assert x.size > 3 * F.size
    poles = next(group for group in panels[2].containers)
    np.testing.assert_allclose(poles.lines[0].get_ydata(), 100.0 * fit.damping_ratio)
    assert "2 modes between 160 and 239.5 Hz" in figure.get_suptitle()


def test_fit_without_noise_and_without_damping_can_be_drawn():
    exact = fit_modes(frf_of(F, [200.0], [0.01], [[1.0]]), 1)
    assert exact.plot().axes[0].get_ylim()[0] > 0.0


def boxes_of(artists):
    """Return the boxes in pixels of the texts that are drawn."""
    return [artist.get_window_extent() for artist in artists if artist.get_visible() and artist.get_text()]


def overlaps(boxes):
    return [(a, b) for a, b in itertools.combinations(boxes, 2) if a.overlaps(b)]


def test_labels_of_many_modes_do_not_overlap():
    f = np.arange(50.0, 3000.0, 2.0)
    frequencies = [60.0, 420.0, 430.0, 440.0, 700.0, 1500.0, 1540.0, 1580.0, 2300.0, 2980.0]
    figure = fit_modes(frf_of(f, frequencies, [0.003] * 10, [[1.0]] * 10, noise=1e-4), frequencies).plot()
    figure.canvas.draw()
    poles = figure.axes[2]
    boxes = boxes_of(poles.texts)
    assert len(boxes) >= 6
    assert not overlaps(boxes)
    frame = poles.get_window_extent()
    assert all(frame.y0 <= box.y0 and box.y1 <= frame.y1 and box.x0 >= frame.x0 - 10.0 for box in boxes)


@pytest.mark.parametrize("seconds", [0.6, 1.5, 4.0])
def test_tick_labels_of_a_ring_down_do_not_overlap(seconds):
    t = np.arange(0.0, seconds, 1.0 / 1024.0)
    x = 6.9 * np.exp(-2.0 * t) * np.cos(2.0 * np.pi * 80.0 * t)
    figure = ring_down(x, 1024.0, low_hz=60.0, high_hz=100.0).plot()
    figure.canvas.draw()
    for axes in figure.axes:
        low, high = axes.get_xlim()
        labels = [
            label for label, tick in zip(axes.get_xticklabels(), axes.get_xticks(), strict=True) if low <= tick <= high
        ]
        assert len(labels) >= 2
        assert not overlaps(boxes_of(labels))
