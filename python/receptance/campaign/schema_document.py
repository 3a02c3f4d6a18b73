"""JSON Schema of campaign files, and the same as Markdown tables."""

from __future__ import annotations

import json
from typing import Any

from receptance.campaign import schema as tables
from receptance.campaign.keys import Keys, KeyTable, element_keys
from receptance.campaign.shapes import ShapeTable
from receptance.model.beams import Section
from receptance.model.joints import PointJoint

_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_SECTIONS: tuple[tuple[Any, str], ...] = (
    (tables.CampaignTable, "The file"),
    (tables.MATERIAL, "`[materials.NAME]`"),
    (tables.PartTable, "`[parts.NAME]`"),
    (tables.ContourSpread, "`tolerance` of a part with a contour"),
    (tables.SEGMENT, "`[[parts.NAME.segments]]`"),
    (ShapeTable, "`shape` of a segment"),
    (tables.MODAL_PART, "`[modal_parts.NAME]`"),
    (tables.MODE, "`[[modal_parts.NAME.modes]]`"),
    (tables.SpindleTable, "`[spindles.NAME]`"),
    (tables.JOINTS.by_word["point"], "`[joints.NAME]`"),
    (tables.JOINTS.by_word["spread"], '`[joints.NAME]` with `kind = "spread"`'),
    (element_keys(Section, title="SectionMemberTable"), "`shank` and `sleeve` of a spread joint"),
    (tables.JOINTS.by_word["collet"], '`[joints.NAME]` with `kind = "collet"`'),
    (element_keys(PointJoint, title="PointJointMemberTable"), "`inner` and `outer` of a collet"),
    (tables.JOINTS.by_word["micro-slip"], '`[joints.NAME]` with `kind = "micro-slip"`'),
    (tables.SENSOR, "`[sensors.NAME]`"),
    (tables.ATTACHMENTS.by_word["mass"], '`[attachments.NAME]` with `kind = "mass"`'),
    (tables.ATTACHMENTS.by_word["ground"], '`[attachments.NAME]` with `kind = "ground"`'),
    (tables.ATTACHMENTS.by_word["resonator"], '`[attachments.NAME]` with `kind = "resonator"`'),
    (tables.AssemblyTable, "`[assemblies.NAME]`"),
    (tables.FRFTable, '`[measurements.NAME]` with `kind = "frf"`'),
    (tables.HammerTable, '`[measurements.NAME]` with `kind = "hammer records"`'),
    (tables.FrequenciesTable, '`[measurements.NAME]` with `kind = "natural frequencies"`'),
    (tables.CandidateFRFTable, '`[candidates.NAME]` with `kind = "frf"`'),
    (tables.CandidateFrequenciesTable, '`[candidates.NAME]` with `kind = "natural frequencies"`'),
    (tables.CUTS.by_word["milling"], '`[cuts.NAME]` with `kind = "milling"`'),
    (tables.CUTS.by_word["turning"], '`[cuts.NAME]` with `kind = "turning"`'),
    (tables.TipTable, "`x` and `y` of a cut"),
    (tables.EntryTable, "`entry` of a measurement or a tip"),
    (tables.CoordinateTable, "`response` and `excitation`"),
    (tables.UnknownTable, '`[unknowns."ADDRESS"]`'),
    (tables.PriorTable, "`prior` of an unknown"),
    (tables.SeriesTable, "`[series]`"),
    (tables.SettingsTable, "`[settings]`"),
    (tables.PredictionTable, "`[prediction]`"),
    (tables.StabilityTable, "`[stability]`"),
    (tables.CatalogueTable, "`[catalogue]`"),
    (tables.CatalogueSpread, "`[catalogue.tolerance]`"),
)
_TYPES = {"string": "text", "integer": "whole number", "number": "number", "boolean": "`true` or `false`"}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a campaign file.

    It defines keys and the form of quantities. Units, references and files are checked by `receptance.campaign.load`.

    Examples
    --------
    >>> from receptance.campaign import json_schema
    >>> json_schema()["anyOf"]
    [{'required': ['parts', 'assemblies']}, {'required': ['cuts']}]
    """
    schema = tables.CampaignTable.keys().definition()
    needed = schema.pop("required")
    return {
        "$schema": _DIALECT,
        "title": "receptance campaign",
        # A file with cuts and measured tips needs no other section.
        "anyOf": [{"required": needed}, {"required": ["cuts"]}],
        **schema,
        "$defs": {keys.title: keys.definition() for keys in (_keys(table) for table, _ in _SECTIONS[1:])},
    }


def _keys(table: type[KeyTable] | Keys[Any]) -> Keys[Any]:
    return table if isinstance(table, Keys) else table.keys()


def field_tables() -> str:
    """Return all tables and keys of a campaign file as Markdown.

    Examples
    --------
    >>> from receptance.campaign import field_tables
    >>> field_tables().splitlines()[0]
    '## The file'
    """
    return "\n\n".join(_block(heading, _keys(table).definition()) for table, heading in _SECTIONS) + "\n"


def _block(heading: str, table: dict[str, Any]) -> str:
    rows = ["| key | | value | meaning |", "|---|---|---|---|"]
    required = table.get("required", [])
    for key, field in table["properties"].items():
        needed = "needed" if key in required else ""
        # A row of a Markdown table is one line.
        meaning = " ".join(field.get("description", "").split())
        rows.append(f"| `{key}` | {needed} | {_value(field)} | {meaning}{_default(field)} |")
    return "\n".join([f"## {heading}", "", table.get("description", ""), "", *rows])


def _value(field: dict[str, Any]) -> str:
    """Return a short description of the values of a key."""
    if "examples" in field:
        return ", ".join(f"`{json.dumps(example, ensure_ascii=False)}`" for example in field["examples"])
    if "const" in field:
        return f"`{json.dumps(field['const'])}`"
    if "enum" in field:
        return ", ".join(f"`{json.dumps(option)}`" for option in field["enum"])
    if "anyOf" in field:
        return " or ".join(dict.fromkeys(_value(choice) for choice in field["anyOf"]))
    if "$ref" in field or "oneOf" in field:
        return "table"
    kind = field.get("type", "")
    if kind == "object":
        return "table"
    if kind == "array":
        return f"list of {_plural(field.get('items', {}))}"
    return _TYPES.get(kind, "")


def _plural(field: dict[str, Any]) -> str:
    if field.get("type") == "array":
        return f"pairs, {_plural(field['items'])}"
    value = _value(field)
    return {"table": "tables", "text": "texts", "whole number": "whole numbers"}.get(value, value)


def _default(field: dict[str, Any]) -> str:
    value = field.get("default")
    if value is None or isinstance(value, dict) or "by default" in field.get("description", ""):
        return ""
    return f" (default `{json.dumps(value)}`)"
