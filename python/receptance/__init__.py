"""Joint parameters of spindle-holder-tool assemblies from measured vibration."""

from typing import TYPE_CHECKING, Any

from receptance._lazy import lazily

if TYPE_CHECKING:
    import receptance.campaign
    import receptance.catalogue
    import receptance.diagnosis
    import receptance.examples
    import receptance.io
    import receptance.measurement
    import receptance.modal
    import receptance.report
    import receptance.spindle
    import receptance.stability
    import receptance.studies
    import receptance.sweep
    import receptance.taper  # noqa: F401
    from receptance.campaign import Campaign, CampaignError
    from receptance.diagnosis import diagnose
    from receptance.errors import (
        GrossSlipError,
        MissingExtraError,
        ReceptanceError,
        ReceptanceWarning,
        ResonanceError,
        SingularInterfaceError,
    )
    from receptance.frf import FRF
    from receptance.identification import (
        Identification,
        MeasuredFrequencies,
        MeasuredFRF,
        Tolerance,
        Unknown,
        find_bands,
        identify,
    )
    from receptance.io import read_frf
    from receptance.model.assembly import Assembly
    from receptance.model.beams import CARBIDE, STEEL, Material, Part, Section, Segment, SpreadJoint
    from receptance.model.coordinates import Coordinate
    from receptance.model.joints import ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
    from receptance.model.modes import DampedModes, ModeShapes, damped_modes
    from receptance.model.terminals import MeasuredPart, ModalPart, Mode

    __version__: str

__all__ = [
    "CARBIDE",
    "FRF",
    "STEEL",
    "Assembly",
    "Campaign",
    "CampaignError",
    "ColletJoint",
    "Coordinate",
    "DampedModes",
    "GrossSlipError",
    "GroundSpring",
    "Identification",
    "Material",
    "MeasuredFRF",
    "MeasuredFrequencies",
    "MeasuredPart",
    "MicroslipJoint",
    "MissingExtraError",
    "ModalPart",
    "Mode",
    "ModeShapes",
    "Part",
    "PointJoint",
    "PointMass",
    "ReceptanceError",
    "ReceptanceWarning",
    "ResonanceError",
    "Resonator",
    "Section",
    "Segment",
    "SingularInterfaceError",
    "SpreadJoint",
    "Tolerance",
    "Unknown",
    "damped_modes",
    "diagnose",
    "find_bands",
    "identify",
    "read_frf",
]

_NAMES = {
    "campaign": ["Campaign", "CampaignError"],
    "diagnosis": ["diagnose"],
    "errors": [
        "GrossSlipError",
        "MissingExtraError",
        "ReceptanceError",
        "ReceptanceWarning",
        "ResonanceError",
        "SingularInterfaceError",
    ],
    "frf": ["FRF"],
    "identification": [
        "Identification",
        "MeasuredFRF",
        "MeasuredFrequencies",
        "Tolerance",
        "Unknown",
        "find_bands",
        "identify",
    ],
    "io": ["read_frf"],
    "model.assembly": ["Assembly"],
    "model.beams": ["CARBIDE", "STEEL", "Material", "Part", "Section", "Segment", "SpreadJoint"],
    "model.coordinates": ["Coordinate"],
    "model.joints": ["ColletJoint", "GroundSpring", "MicroslipJoint", "PointJoint", "PointMass", "Resonator"],
    "model.modes": ["DampedModes", "ModeShapes", "damped_modes"],
    "model.terminals": ["MeasuredPart", "ModalPart", "Mode"],
}
_MODULES = (
    "campaign",
    "catalogue",
    "diagnosis",
    "examples",
    "io",
    "measurement",
    "modal",
    "report",
    "spindle",
    "stability",
    "studies",
    "sweep",
    "taper",
)

if not TYPE_CHECKING:  # a type checker is to find misspelt names
    _imported, __dir__ = lazily(__name__, _NAMES, (*_MODULES, "__version__"))

    def __getattr__(name: str) -> Any:
        if name != "__version__":
            return _imported(name)
        from importlib import metadata

        return metadata.version("receptance")
