"""The drivers of the package, by the scheme of their address.

A new driver is a file here and a line in :data:`DRIVERS`.
"""

from __future__ import annotations

from importlib import import_module

from ...errors import unknown_name
from ...simulation import Setup
from ..driver import Address, Driver

#: Scheme, and ``module:Class`` in this folder. A driver's packages are loaded only where it is
#: used.
DRIVERS: dict[str, str] = {
    "simulated": "simulated:SimulatedArm",
    "loopback": "loopback:LoopbackArm",
    "ur-rtde": "ur_rtde:UrRtde",
}


def driver_class(scheme: str) -> type[Driver]:
    """Return the driver class of a scheme; raises ConfigurationError that names the candidates."""
    if scheme not in DRIVERS:
        raise unknown_name("kind of arm", scheme, DRIVERS)
    module, _, name = DRIVERS[scheme].partition(":")
    driver: type[Driver] = getattr(import_module(f".{module}", __name__), name)
    return driver


def driver_for(address: str, setup: Setup) -> Driver:
    """Return the driver for an address, not connected yet; raises ConfigurationError."""
    parsed = Address.parse(address)
    return driver_class(parsed.scheme)(parsed, setup)
