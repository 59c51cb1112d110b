"""Distance from singular configurations."""

SINGULAR = 1e-9
"""Singular value below which manipulability's curvature is taken as that at this value, so that it stays finite."""
