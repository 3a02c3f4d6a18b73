"""A variant of a cause of the catalogue by its name, for tests that state which one they are about."""

from __future__ import annotations

from receptance.diagnosis import CATALOGUE, Model, Variant


def variant_of(model: Model, cause: str, name: str) -> Variant:
    """Return the variant of a name that a model can have."""
    (variant,) = [variant for variant in CATALOGUE[cause].variants(model) if variant.name == name]
    return variant


def extended_by(model: Model, cause: str, name: str) -> Model:
    """Return the model with a variant of a cause."""
    return variant_of(model, cause, name).apply(model)
