"""The report of a plan: one HTML page to look at, with no need of a network."""

from sim.pictures.report.anew import Anew
from sim.pictures.report.facts import ReportDetails
from sim.pictures.report.page import write_report, write_run_report

__all__ = ["Anew", "ReportDetails", "write_report", "write_run_report"]
