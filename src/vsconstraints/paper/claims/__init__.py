"""Claims of the paper, one function or formula for each sentence; importing registers them."""

from . import experiments, general, simulations

__all__ = ["experiments", "general", "simulations"]
