"""The paper's claims, one function for each sentence: importing this package registers all of them."""

from . import case_study, experiments, general, planar, sweeps

__all__ = ["case_study", "experiments", "general", "planar", "sweeps"]
