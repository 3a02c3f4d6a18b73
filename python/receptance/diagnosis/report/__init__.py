"""Reports as one file that needs no network."""

from receptance.diagnosis.report.page import diagnosis_html, write_diagnosis

__all__ = ["diagnosis_html", "write_diagnosis"]
