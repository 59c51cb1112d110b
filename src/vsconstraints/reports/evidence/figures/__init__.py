"""Figures of the report of evidence."""
