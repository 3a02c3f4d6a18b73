"""Measuring campaigns: TOML files that describe structures, measurements and unknowns."""

from typing import TYPE_CHECKING

from receptance._lazy import lazily

if TYPE_CHECKING:
    from receptance.campaign.check import CampaignCheck
    from receptance.campaign.comparison import Comparison
    from receptance.campaign.measurements import Measurement
    from receptance.campaign.prediction import Prediction, forecast_of
    from receptance.campaign.problems import CampaignError, Issue
    from receptance.campaign.run import Campaign, load
    from receptance.campaign.schema_document import field_tables, json_schema
    from receptance.campaign.stability import CampaignCut, Tip
    from receptance.campaign.values import Deviation
    from receptance.campaign.write import extended_text, write_extended

__all__ = [
    "Campaign",
    "CampaignCheck",
    "CampaignCut",
    "CampaignError",
    "Comparison",
    "Deviation",
    "Issue",
    "Measurement",
    "Prediction",
    "Tip",
    "extended_text",
    "field_tables",
    "forecast_of",
    "json_schema",
    "load",
    "write_extended",
]

_NAMES = {
    "check": ["CampaignCheck"],
    "comparison": ["Comparison"],
    "schema_document": ["field_tables", "json_schema"],
    "measurements": ["Measurement"],
    "prediction": ["Prediction", "forecast_of"],
    "problems": ["CampaignError", "Issue"],
    "run": ["Campaign", "load"],
    "stability": ["CampaignCut", "Tip"],
    "values": ["Deviation"],
    "write": ["extended_text", "write_extended"],
}

if not TYPE_CHECKING:  # a type checker is to find misspelt names
    __getattr__, __dir__ = lazily(__name__, _NAMES)
