"""Measuring campaigns: one TOML file that says what was measured, on what, and what is to be found."""

from receptance.campaign.campaign import Campaign
from receptance.campaign.comparison import Peak, PredictedFrequencies, PredictedFRF, Prediction
from receptance.campaign.cuts import CampaignCut, Tip
from receptance.campaign.loading import load
from receptance.campaign.observations import Measurement
from receptance.campaign.problems import CampaignError, Problem
from receptance.campaign.quantities import Condition
from receptance.campaign.schema import field_tables, json_schema

__all__ = [
    "Campaign",
    "CampaignCut",
    "CampaignError",
    "Condition",
    "Measurement",
    "Peak",
    "PredictedFRF",
    "PredictedFrequencies",
    "Prediction",
    "Problem",
    "Tip",
    "field_tables",
    "json_schema",
    "load",
]
