"""Figures of a report. Only these modules import matplotlib."""
