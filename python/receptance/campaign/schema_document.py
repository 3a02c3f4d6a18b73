"""JSON Schema of campaign files, and the same as Markdown tables."""

from __future__ import annotations

import json
from typing import Any

from receptance.campaign.schema import CampaignTable

_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_SECTIONS = (
    ("CampaignTable", "The file"),
    ("MaterialTable", "`[materials.NAME]`"),
    ("PartTable", "`[parts.NAME]`"),
    ("SegmentTable", "`[[parts.NAME.segments]]`"),
    ("ModalPartTable", "`[modal_parts.NAME]`"),
    ("ModeTable", "`[[modal_parts.NAME.modes]]`"),
    ("PointJointTable", "`[joints.NAME]`"),
    ("SpreadJointTable", '`[joints.NAME]` with `kind = "spread"`'),
    ("SectionMemberTable", "`shank` and `sleeve` of a spread joint"),
    ("ColletJointTable", '`[joints.NAME]` with `kind = "collet"`'),
    ("PointJointMemberTable", "`inner` and `outer` of a collet"),
    ("MicroslipJointTable", '`[joints.NAME]` with `kind = "micro-slip"`'),
    ("SensorTable", "`[sensors.NAME]`"),
    ("PointMassTable", '`[attachments.NAME]` with `kind = "mass"`'),
    ("GroundSpringTable", '`[attachments.NAME]` with `kind = "ground"`'),
    ("ResonatorTable", '`[attachments.NAME]` with `kind = "resonator"`'),
    ("AssemblyTable", "`[assemblies.NAME]`"),
    ("FRFTable", '`[measurements.NAME]` with `kind = "frf"`'),
    ("HammerTable", '`[measurements.NAME]` with `kind = "hammer records"`'),
    ("FrequenciesTable", '`[measurements.NAME]` with `kind = "natural frequencies"`'),
    ("CandidateFRFTable", '`[candidates.NAME]` with `kind = "frf"`'),
    ("CandidateFrequenciesTable", '`[candidates.NAME]` with `kind = "natural frequencies"`'),
    ("MillingTable", '`[cuts.NAME]` with `kind = "milling"`'),
    ("TurningTable", '`[cuts.NAME]` with `kind = "turning"`'),
    ("TipTable", "`x` and `y` of a cut"),
    ("EntryTable", "`entry` of a measurement or a tip"),
    ("CoordinateTable", "`response` and `excitation`"),
    ("UnknownTable", '`[unknowns."ADDRESS"]`'),
    ("PriorTable", "`prior` of an unknown"),
    ("SeriesTable", "`[series]`"),
    ("SettingsTable", "`[settings]`"),
    ("PredictionTable", "`[prediction]`"),
    ("StabilityTable", "`[stability]`"),
    ("CatalogueTable", "`[catalogue]`"),
    ("CatalogueSpread", "`[catalogue.tolerance]`"),
)
_TYPES = {"string": "text", "integer": "whole number", "number": "number", "boolean": "`true` or `false`"}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a campaign file.

    It defines keys and the form of quantities. Units, references and files are checked by `receptance.campaign.load`.

    Examples
    --------
    >>> from receptance.campaign import json_schema
    >>> json_schema()["anyOf"]
    [{'required': ['materials', 'parts', 'assemblies']}, {'required': ['cuts']}]
    """
    schema = CampaignTable.model_json_schema()
    needed = schema.pop("required")
    return {
        "$schema": _DIALECT,
        "title": "receptance campaign",
        # A file with cuts and measured tips needs no other section.
        "anyOf": [{"required": needed}, {"required": ["cuts"]}],
        **{k: _plain(v) for k, v in schema.items() if k != "title"},
    }


def _plain(node: Any) -> Any:
    """Remove null, which TOML does not have, and titles that repeat keys."""
    if isinstance(node, list):
        return [_plain(item) for item in node]
    if not isinstance(node, dict):
        return node
    found = {key: _plain(value) for key, value in node.items() if not (key == "title" and isinstance(value, str))}
    if "default" in found and (found["default"] in (None, [], "") or isinstance(found["default"], dict)):
        del found["default"]
    if found.get("type") == "string" and not isinstance(found.get("default", ""), str):
        del found["default"]  # of a quantity, which is text, the default is a number in SI units
    if "patternProperties" in found:
        found.setdefault("additionalProperties", False)
    choices = found.get("anyOf")
    if isinstance(choices, list):
        kept = [choice for choice in choices if choice != {"type": "null"}]
        found["anyOf"] = kept
        if len(kept) == 1:
            del found["anyOf"]
            found = {**kept[0], **found}
    return found


def field_tables() -> str:
    """Return all tables and keys of a campaign file as Markdown.

    Examples
    --------
    >>> from receptance.campaign import field_tables
    >>> field_tables().splitlines()[0]
    '## The file'
    """
    schema = json_schema()
    definitions = {"CampaignTable": {**schema, **schema["anyOf"][0]}, **schema["$defs"]}
    # Tables of tolerances have the keys of their elements.
    missing = {name for name in definitions if not name.endswith("Tolerance")} - {name for name, _ in _SECTIONS}
    if missing:
        raise LookupError(f"tables without a heading: {', '.join(sorted(missing))}")
    blocks = [_block(heading, definitions[name]) for name, heading in _SECTIONS]
    return "\n\n".join(blocks) + "\n"


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
        return f"list of {_plural(_value(field.get('items', {})))}"
    return _TYPES.get(kind, "")


def _plural(value: str) -> str:
    if value.startswith("list of "):
        return "pairs, " + value.removeprefix("list of ")
    return {"table": "tables", "text": "texts", "whole number": "whole numbers"}.get(value, value)


def _default(field: dict[str, Any]) -> str:
    value = field.get("default")
    if value is None or isinstance(value, dict) or "by default" in field.get("description", ""):
        return ""
    return f" (default `{json.dumps(value)}`)"
