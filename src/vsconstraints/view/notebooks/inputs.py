"""Laws and scenarios of a session as specifications from which other processes make them.

Laws and setups that cannot be specified in this way stay in the session.
"""

from __future__ import annotations

import inspect
import json
import pickle
import re
import sys
import uuid
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from ...comparisons.runs.spec import ControllerSpec
from ...controllers import WRAPPERS, Controller, Demand, Resolver, make_controller, registered_laws
from ...controllers.base import Wrapper, innermost
from ...errors import ConfigurationError, VsconstraintsError, described, format_value
from ...plugins.provenance import noted_import
from ...scenarios import Scenario
from ...simulation import Setup
from .copies import copied, packed, stable_digest

#: Instance, class that needs no options, name of a registered law, or ``module:Class``.
AnyLaw = Controller | type[Controller] | str
#: Methods that may be replaced on an instance, which no file can specify.
REPLACEABLE = ("solve", "command", "define")
#: One law, several, or several with names chosen by the user.
Laws = AnyLaw | Iterable[AnyLaw] | Mapping[str, AnyLaw]


@dataclass(frozen=True)
class InstanceSpec(ControllerSpec):
    """Law that is given as an ``instance``.

    ``packed`` are the bytes from which other processes make it, empty if that is impossible.
    ``files`` has the file that defines its class, if that exists.
    """

    packed: bytes = b""
    instance: Controller | None = None
    files: tuple[Path, ...] = ()

    @property
    def main_process_only(self) -> bool:
        """True if only this process can make the law; see :class:`.ControllerSpec`."""
        return not self.packed

    def make(self) -> Controller:
        """Return a copy of the instance, or the instance itself if it cannot be copied."""
        if self.instance is not None:
            return copied(self.instance) if self.packed else self.instance
        with noted_import(self.law.partition(":")[0]):
            law: Controller = pickle.loads(self.packed)
        return law

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for other processes, which make the law from the packed bytes."""
        return {**vars(self), "instance": None}


def specs_of(laws: Laws) -> tuple[tuple[ControllerSpec, ...], tuple[str, ...]]:
    """Return the specifications of laws, and sentences about laws that only this process can run.

    Raises ConfigurationError if a value is no law, a law has no name, or two have the same name.
    """
    if isinstance(laws, Controller | str | type):
        laws = [laws]
    if not isinstance(laws, Iterable):
        raise _no_law(laws)
    named: Iterable[tuple[str, AnyLaw]] = [("", law) for law in laws]
    if isinstance(laws, Mapping):
        named = laws.items()
    specs = []
    notes = []
    for name, law in named:
        spec, note = spec_of(law, name)
        specs.append(spec)
        if note:
            notes.append(note)
    for name, count in Counter(spec.name for spec in specs).items():
        if count > 1:
            how = f'{{"{name} 1": …, "{name} 2": …}} instead of a list'
            raise ConfigurationError(
                f"two laws have the name {name!r}; give each its own, as in {how}"
            )
    return tuple(specs), tuple(notes)


def spec_of(law: AnyLaw, name: str = "") -> tuple[ControllerSpec, str]:
    """Return the specification of a law, and why only this process can run it, if so.

    Laws of this package are described by their names and options, as in a file; all others by their
    packed instance.
    """
    if isinstance(law, str):
        return ControllerSpec.called(law, name, Path()), ""
    law = instance_of(law)
    name = name or getattr(law, "name", None) or ""
    if not name:
        raise ConfigurationError(f'{type(law).__name__} has no name: write name = "…" in the class')
    options = _options(law)
    if options is not None:
        return ControllerSpec(name, _named(law).name, options), ""
    data, why = packed(law)
    note = f"{name} runs in this process, which it can stop or keep waiting: {why}" if why else ""
    return own_spec(law, name, data), note


def instance_of(law: Controller | type[Controller]) -> Controller:
    """Return an instance unchanged, or an instance of a class made without options."""
    if isinstance(law, type) and issubclass(law, Controller):
        try:
            return law()
        except (Exception, SystemExit) as error:  # a custom law may fail in any way
            raise ConfigurationError(
                f"{law.__name__}() cannot be made: {described(error)}"
            ) from error
    if not isinstance(law, Controller):
        raise _no_law(law)
    return law


def own_spec(law: Controller, name: str, data: bytes = b"") -> InstanceSpec:
    """Return the specification of an instance, from packed bytes or as it is."""
    kind = type(law)
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    # An instance that is not packed may differ from call to call, so it gets a random identity.
    identity = stable_digest(data) if data else uuid.uuid4().hex
    return InstanceSpec(
        name,
        law=f"{kind.__module__}:{kind.__qualname__}",
        options={"instance": identity},
        packed=data,
        instance=law,
        files=(Path(file),) if file else (),
    )


def _no_law(value: object) -> ConfigurationError:
    kinds = "a name, module:Class, or a class or an instance of a Controller"
    return ConfigurationError(f"a law is {kinds}, not {format_value(value)}")


def _wrappers(law: Controller) -> list[Wrapper]:
    """Return the wrappers around the law of a registered class, outermost first."""
    found = []
    while isinstance(law, Wrapper) and type(law) not in registered_laws().values():
        found.append(law)
        law = law.law
    return found


def _named(law: Controller) -> Controller:
    """Return the law of a registered class: this law, or the one inside its wrappers."""
    wrappers = _wrappers(law)
    return wrappers[-1].law if wrappers else law


def _options(law: Controller) -> dict[str, Any] | None:
    """Return the options with which a file would specify this law, None if that is impossible."""
    inner = innermost(law)
    named = _named(law)
    wrappers = _wrappers(law)
    kind = type(named)
    if registered_laws().get(getattr(kind, "name", "")) is not kind:
        return None
    if any(type(wrapper) not in WRAPPERS for wrapper in wrappers):
        return None
    for part in (*wrappers, named, inner):
        if not vars(part).keys().isdisjoint(REPLACEABLE):
            return None
    options: dict[str, Any] = {}
    if law.factors != kind.factors:
        options |= law.factors.options()
    for parameter in inspect.signature(kind).parameters.values():
        holder = inner if hasattr(inner, parameter.name) else named
        if parameter.kind is parameter.VAR_KEYWORD or not hasattr(holder, parameter.name):
            continue
        value = getattr(holder, parameter.name)
        if isinstance(value, Demand | Resolver):
            options |= _chosen_fields(value)
            value = value.name
        if value != parameter.default:
            options[parameter.name] = value
    for wrapper in wrappers:
        for key in WRAPPERS[type(wrapper)]:
            value = getattr(wrapper, key)
            if value:
                options[key] = value
    try:
        json.dumps(options)
        is_same = repr(make_controller(kind.name, options)) == repr(law)
    except (TypeError, ValueError, VsconstraintsError):
        return None
    return options if is_same else None


def _chosen_fields(part: Demand | Resolver) -> dict[str, Any]:
    """Return the fields of a demand or a resolver that differ from their defaults."""
    chosen = {}
    for field in fields(part):
        value = getattr(part, field.name)
        if value != field.default:
            chosen[field.name] = value
    return chosen


# --- Scenarios ---

#: Scenario, setup made in Python, name of a shipped scenario, or path of a file.
AnyScenario = Scenario | Setup | str | Path


@dataclass(frozen=True)
class SetupScenario(Scenario):
    """Setup made in Python, used as a scenario.

    It has only one trial, and no other process can make it.
    """

    made: Setup | None = None
    why_here = "it is a Setup, which is made in this session"
    in_session = True

    @classmethod
    def of(cls, setup: Setup) -> SetupScenario:
        """Return a setup as a scenario under the name of its robot."""
        title = setup.scene.robot.name
        name = re.sub(r"[^\w]+", "-", title).strip("-") or "setup"
        tables = {
            "title": title,
            "sampling_time": setup.Ts,
            "duration": setup.duration,
            # keeps the stored runs of two setups apart
            "setup": uuid.uuid4().hex,
        }
        return cls(name, tables, made=setup)

    def setup(self, trial: int = 0, seed: int = 0) -> Setup:
        """Return the setup; raises ConfigurationError for any trial except the first."""
        assert self.made is not None
        if trial:
            raise ConfigurationError(
                f"{self.name} is a Setup, which has one trial: a Scenario can have several"
            )
        return self.made


def scenarios_of(scenarios: AnyScenario | Iterable[AnyScenario]) -> tuple[Scenario, ...]:
    """Return one or several scenarios as a tuple.

    Raises ConfigurationError, with candidates, if a scenario does not exist.
    """
    if isinstance(scenarios, Scenario | Setup | str | Path) or not isinstance(scenarios, Iterable):
        scenarios = [scenarios]
    found: list[Scenario] = []
    for scenario in scenarios:
        if isinstance(scenario, Scenario):
            found.append(scenario)
        elif isinstance(scenario, Setup):
            found.append(SetupScenario.of(scenario))
        elif isinstance(scenario, str | Path):
            found.append(Scenario.load(scenario))
        else:
            raise ConfigurationError(
                f"a scenario is a name, a path, a Scenario or a Setup, not {format_value(scenario)}"
            )
    return tuple(found)
