"""Compiled functions of laws that command joint speeds."""
