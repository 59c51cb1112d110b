"""The paper's claims, one function or formula for each sentence: importing this package registers
all of them.
"""

from . import experiments, general, simulations

__all__ = ["experiments", "general", "simulations"]
