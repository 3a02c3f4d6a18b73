"""Measuring campaigns: one TOML file that says what was measured, on what, and what is to be found."""

from receptance.campaign.campaign import Campaign
from receptance.campaign.comparison import Peak, PredictedFrequencies, PredictedFRF
from receptance.campaign.conditions import Condition
from receptance.campaign.cuts import CampaignCut, Tip
from receptance.campaign.diagnosis import CampaignDiagnosis
from receptance.campaign.identification import CampaignIdentification
from receptance.campaign.inversion import CampaignInversion
from receptance.campaign.loading import load
from receptance.campaign.next_step import CampaignNext
from receptance.campaign.observations import Measurement
from receptance.campaign.prediction import CampaignPrediction
from receptance.campaign.problems import CampaignError, Problem
from receptance.campaign.schema import field_tables, json_schema
from receptance.campaign.stability import CampaignStability, CutLobes
from receptance.campaign.transfer import CampaignTransfer

__all__ = [
    "Campaign",
    "CampaignCut",
    "CampaignDiagnosis",
    "CampaignError",
    "CampaignIdentification",
    "CampaignInversion",
    "CampaignNext",
    "CampaignPrediction",
    "CampaignStability",
    "CampaignTransfer",
    "Condition",
    "CutLobes",
    "Measurement",
    "Peak",
    "PredictedFRF",
    "PredictedFrequencies",
    "Problem",
    "Tip",
    "field_tables",
    "json_schema",
    "load",
]
