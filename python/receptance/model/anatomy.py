"""The tool before the joint that is identified, and what is behind it, in an assembly."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from receptance.model.assembly import Assembly
from receptance.model.beams import Part, SpreadJoint
from receptance.model.joints import ColletJoint, PointJoint
from receptance.model.terminals import Terminal

_JOINTS = (PointJoint, SpreadJoint, ColletJoint)


@dataclass(frozen=True)
class Anatomy:
    """The parts of an assembly before the joint that is identified, the joint, and the parts behind it."""

    tool: tuple[str, ...]
    """Names of the parts before the joint."""
    joint: str
    """Name of the joint; empty where there is none."""
    holder: tuple[str, ...]
    """Names of the parts behind it."""
    end: str = ""
    """Name of the table of receptances or of the modes at the far end; empty where there is none. If there is no
    holder, it describes all that is behind the joint."""

    @property
    def in_spindle(self) -> bool:
        """Whether the holder is in a spindle, so that it neither hangs nor is measured by itself.

        Modes or a table right behind the joint may be those of a holder that hangs free.
        """
        return bool(self.end) and bool(self.holder or not self.joint)


def anatomy_of(assembly: Assembly, identified: Iterable[str]) -> Anatomy:
    """Return the anatomy of an assembly, about the first joint with one of the identified addresses, or the first."""
    names = list(assembly.elements)
    owners = {address.partition(".")[0] for address in identified}
    joints = [name for name in names if isinstance(assembly.elements[name], _JOINTS)]
    joint = next((name for name in joints if name in owners), joints[0] if joints else "")
    parts = [name for name in names if isinstance(assembly.elements[name], Part)]
    end = names[-1] if isinstance(assembly.elements[names[-1]], Terminal) else ""
    if not joint:
        return Anatomy(tuple(parts), "", (), end)
    before = names[: names.index(joint)]
    tool = tuple(name for name in parts if name in before)
    return Anatomy(tool, joint, tuple(name for name in parts if name not in before), end)


def overhang_of(assembly: Assembly, anatomy: Anatomy) -> str:
    """Return the address of the overhang: the length of the tool's last segment."""
    name = anatomy.tool[-1]
    return f"{name}.segment[{len(assembly.parts[name].segments) - 1}].length"
