"""The paper's claims, one function for each sentence: importing this package registers all of them."""

from . import experiments, general, simulations, sweeps

__all__ = ["experiments", "general", "simulations", "sweeps"]
