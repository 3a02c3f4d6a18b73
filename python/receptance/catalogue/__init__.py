"""Catalogues of tools and holders: the tip of every tool in a machine, predicted with its uncertainty."""

from receptance.catalogue.building import Catalogue, errors_of
from receptance.catalogue.line_modes import LineModes, line_modes
from receptance.catalogue.prediction import ToolPrediction, predict_catalogue
from receptance.catalogue.results import CatalogueSummary, ToolSummary, tool_lobes
from receptance.catalogue.rows import HolderRow, ToolRow, read_holders, read_tools

__all__ = [
    "Catalogue",
    "CatalogueSummary",
    "HolderRow",
    "LineModes",
    "ToolPrediction",
    "ToolRow",
    "ToolSummary",
    "errors_of",
    "line_modes",
    "predict_catalogue",
    "read_holders",
    "read_tools",
    "tool_lobes",
]
