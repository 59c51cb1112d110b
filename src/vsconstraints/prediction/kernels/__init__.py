"""Compiled functions of the predictive safety filter.

- ``predictive`` is the law. ``last_plan`` shifts the last plan in time.
- ``predicted_program`` makes the program of the next plan from rows and task along the last one.
- ``plan_program`` solves it, with ``plan_rows``, ``plan_cost`` and ``plan_search``.
- ``plan_arrays`` and ``predictive_arrays`` declare the arrays that they share.
"""
