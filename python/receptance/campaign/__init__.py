"""Measuring campaigns: TOML files that describe structures, measurements and unknowns."""

from receptance.campaign.check import CampaignCheck
from receptance.campaign.comparison import Comparison
from receptance.campaign.json_schema import field_tables, json_schema
from receptance.campaign.measurements import Measurement
from receptance.campaign.prediction import Prediction, forecast_of
from receptance.campaign.problems import CampaignError, Issue
from receptance.campaign.read import load
from receptance.campaign.run import Campaign
from receptance.campaign.stability import CampaignCut, Tip
from receptance.campaign.tolerances import Effects
from receptance.campaign.values import Condition, Deviation
from receptance.campaign.write import extended_text, write_extended

__all__ = [
    "Campaign",
    "CampaignCheck",
    "CampaignCut",
    "CampaignError",
    "Comparison",
    "Condition",
    "Deviation",
    "Effects",
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
