"""Codes of answers of the hierarchy: demands are unmet; levels 2 and 3 may be better met; both."""

RELAXED_ROWS, SHORT, RELAXED_SHORT = range(4, 7)
