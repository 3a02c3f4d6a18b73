"""Catalogues of tools and holders: the tip of every tool in a machine, predicted with its uncertainty."""

from receptance.catalogue.building import Catalogue, errors_of
from receptance.catalogue.cutting import ToolCut, tool_lobes
from receptance.catalogue.line_modes import LineModes, line_modes
from receptance.catalogue.prediction import ToolPrediction, predict_catalogue
from receptance.catalogue.rows import HolderRow, ToolRow, read_holders, read_tools

__all__ = [
    "Catalogue",
    "HolderRow",
    "LineModes",
    "ToolCut",
    "ToolPrediction",
    "ToolRow",
    "errors_of",
    "line_modes",
    "predict_catalogue",
    "read_holders",
    "read_tools",
    "tool_lobes",
]
