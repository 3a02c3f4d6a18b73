"""What the paper claims in figures or in words alone: quoted as claims, no value is read off a figure."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CLAIMS", "Claim"]


@dataclass(frozen=True)
class Claim:
    """A claim, in the paper's words, and where it stands."""

    about: str
    where: str
    text: str


CLAIMS = (
    Claim(
        "insertion",
        "figures 12 and 13, text",
        "For a tool diameter of 9.53 mm, 11.11 mm, 12.7 mm and 16 mm the stiffness is almost constant [over insertions "
        "of 40, 30 and 20 mm]. A reason for this is that the clamping interface can be modeled as two springs "
        "in series.",
    ),
    Claim(
        "material",
        "figure 15, text",
        "The difference between both materials [carbide, high-speed steel] varies between 10% for the 9.54 mm tool and "
        "31% for 12.70 mm tool. The rotational stiffness shows even a bigger deviation. Except for the 12.7 mm tool, "
        "each difference is over 45%.",
    ),
    Claim(
        "damping",
        "figure 6, text",
        "due to the fact that magnitude is varying and damping is low enough that it does not affect the modeling of "
        "spindle-holder-tool assembly, we neglect the damping in further research",
    ),
    Claim(
        "torque",
        "table 4, text",
        "the influence of clamping torque is low for this holder and tool connection. Although the change of "
        "eigenvalues is low, the percentage difference for stiffness parameters is huge.",
    ),
    Claim(
        "diameter",
        "figure 6, text",
        "The almost constant translational stiffness of the first three diameters can be explained by various clamping "
        "conditions.",
    ),
)
