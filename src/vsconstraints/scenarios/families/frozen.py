"""Test sets: scenes that were drawn once and are read from files, each with its SHA-256."""

from __future__ import annotations

import gzip
import json
import math
import platform
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from itertools import zip_longest
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pinocchio as pin

from ... import __version__
from ...errors import ConfigurationError, unknown_name
from ...simulation import Setup
from ..reading import Table, from_table
from ..scenario import Scenario
from .attempts import Reason
from .drawn import Drawn
from .family import HALVES, NOMINAL, SHIPPED, Family

V1 = SHIPPED / "testset-v1"  #: folder of the test set that comes with the package
INDEX = "testset.json"  #: the file that says what a test set's files hold
MAX_BYTES = 500_000_000  #: that a file may expand to
Told = Callable[[str, int, int], None]  #: told of which family how many of how many scenes are done


class FrozenFamily(Family):
    """A family of a test set: the same as any other, but its scenes are read, not drawn.

    Its tables are those that the scenes were drawn from; ``frozen`` in them has, by half, the ``file``, how many
    ``scenes`` it holds, their ``seed`` and the ``sha256`` of their own.
    """

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of its conditions, the nominal one first."""
        return (NOMINAL, *(name for name in self.tables.get("conditions", {}) if name != NOMINAL))

    @property
    def source(self) -> Family:
        """The family that draws what the files hold, and with other seeds further scenes in the same way."""
        tables = {key: value for key, value in self.tables.items() if key != "frozen"}
        return Family(self.name, tables, self.folder, self.trusted)

    def file(self, half: str) -> Path:
        """The file of a half's scenes."""
        return self.folder / str(self.tables["frozen"][half]["file"])

    def _filled(self, scene: Drawn) -> tuple[Drawn, dict[str, Setup]]:
        kept = self.tables["frozen"][scene.half]
        if scene.seed != kept["seed"] or scene.number >= kept["scenes"]:
            raise ConfigurationError(
                f"{self.file(scene.half).name} has scenes 0 to {kept['scenes'] - 1} of seed {kept['seed']}, not scene "
                f"{scene.number} of seed {scene.seed}"
            )
        scene = self.read(_checked_lines(self.file(scene.half), kept["sha256"])[scene.number], scene)
        return scene, {name: scene.setup(name) for name in self.conditions}

    def read(self, line: str, scene: Drawn) -> Drawn:
        """The scene with what a line says of it; raises ConfigurationError that names file, scene and what is wrong."""
        where = f"{self.file(scene.half).name}: scene {scene.number}"
        try:
            own: dict[str, Any] = vars(from_table(_Line, json.loads(line, parse_constant=_refused), where))
        except (ValueError, RecursionError) as error:
            raise error if isinstance(error, ConfigurationError) else ConfigurationError(f"{where}: {error}") from error
        tables = own["tables"]
        for names, known in ((tables, self.conditions), (self.conditions, tables)):
            for name in names:
                if name not in known:
                    raise unknown_name(f"condition in {where}", name, known)
        if own["number"] != scene.number:
            raise ConfigurationError(f"{where} says that it is number {own['number']}")
        own["challenged"] = tuple(own["challenged"])
        own["tables"] = {name: {**tables[NOMINAL], **tables[name]} for name in self.conditions}
        own |= {name: math.nan for name, value in own.items() if value is None}
        return replace(scene, **own)


@dataclass(frozen=True)
class _Line:
    """A scene as it is stored: of the conditions what is another than in the nominal one, null for NaN."""

    number: int
    tables: dict[str, Table]
    values: Table
    rejected: dict[str, int]
    challenged: Sequence[str]
    share_to_hold: float | None
    least_time: float | None
    duration: float
    noise: int
    refusal: str = ""


def line_of(scene: Drawn) -> str:
    """A scene as one line of JSON, from which it is read again bit by bit; raises ConfigurationError if none is found.

    Numbers are the shortest decimals that are the same in double precision.
    """
    nominal = scene.scenario().tables
    own = {name: getattr(scene, name) for name in _Line.__dataclass_fields__}
    own["tables"] = {
        name: {
            key: value for key, value in tables.items() if name == NOMINAL or _json(nominal.get(key)) != _json(value)
        }
        for name, tables in scene.tables.items()
    }
    return _json({name: None if value != value else value for name, value in own.items()})


def _json(data: Any) -> str:
    return json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"), default=lambda a: a.tolist())


def _refused(constant: str) -> Any:
    raise ValueError(f"{constant} is no number that a scene may have")


def family_of(name: str, tables: Table, folder: Path, trusted: bool = True) -> Family:
    """A family from its tables, frozen or not."""
    return (FrozenFamily if "frozen" in tables else Family)(name, tables, folder, trusted)


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()


def _lines(path: Path) -> list[str]:
    """The lines of a file; raises ConfigurationError if it cannot be read to its end."""
    try:
        with gzip.open(path, "rb") as file:
            text = file.read(MAX_BYTES).decode()
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path.name} of a test set cannot be read: {error}") from error
    return text.removesuffix("\n").split("\n")


@lru_cache(maxsize=64)
def _checked_lines(path: Path, digest: str) -> list[str]:
    lines = _lines(path)
    if _digest("".join(map(_digest, lines))) != digest:
        raise ConfigurationError(
            f"{path} does not hold what the test set was made with; `vsconstraints testset verify` names the scenes"
        )
    return lines


@dataclass(frozen=True)
class TestSet:
    """The scenes of some families, frozen: a file for each family and half, and an index with the hash of each scene.

    ``seed`` is what they were drawn with by the version ``made_by``; ``hashes`` are by file.
    """

    __test__ = False  # it is none of pytest's

    folder: Path
    version: str
    seed: int
    made_by: str
    families: tuple[FrozenFamily, ...]
    hashes: Mapping[str, Sequence[str]]

    @classmethod
    def load(cls, folder: Path = V1) -> TestSet:
        """Read a test set's index; raises ConfigurationError if it cannot be used. Files are read with their scenes."""
        path = folder / INDEX
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise ConfigurationError(f"{path} cannot be read, so there is no test set: {error}") from error
        index, families, hashes = from_table(_Index, data, str(path)), [], {}
        for name, said in index.families.items():
            family, frozen = from_table(_Family, said, f"{path}: {name}"), {}
            for half in HALVES:
                file = f"{name}.{half}.jsonl.gz"
                hashes[file] = kept = family.sha256.get(half, [])
                frozen[half] = {"file": file, "scenes": len(kept), "seed": index.seed, "sha256": _digest("".join(kept))}
            tables = {**family.tables, "testset": index.version, "frozen": frozen}
            families.append(FrozenFamily(name, tables, folder))
        return cls(folder, index.version, index.seed, index.made_by, tuple(families), hashes)

    def chosen(
        self, names: Sequence[str], half: str, most: int | None = None, secret_seed: int | None = None
    ) -> dict[str, Any]:
        """The families, half, seed and number of scenes of a campaign: all, or what is named.

        With a ``secret_seed`` families that draw other scenes in the same way. Raises ConfigurationError for unknown
        names, more scenes than there are, and a seed that is no secret.
        """
        known = {family.name: family for family in self.families}
        for what, name, others in (("half", half, HALVES), *(("family", name, known) for name in names)):
            if name not in others:
                raise unknown_name(f"{what} of test set {self.version}", name, others)
        families = [known[name] for name in dict.fromkeys(names or known)]
        there = min(family.tables["frozen"][half]["scenes"] for family in families)
        if secret_seed == self.seed or (most or 1) > there:
            why = f"seed {self.seed} is that of its own scenes" if secret_seed == self.seed else f"{most} are asked for"
            raise ConfigurationError(f"test set {self.version} has {there} {half} scenes of a family; {why}")
        seed = self.seed if secret_seed is None else secret_seed
        drawn = families if secret_seed is None else [family.source for family in families]
        return {"families": tuple(drawn), "half": half, "seed": seed, "scenes": most or there}

    @classmethod
    def make(
        cls, folder: Path, families: Sequence[Family], version: str, scenes: Mapping[str, int], seed: int, told: Told
    ) -> TestSet:
        """Draw so many scenes of each half, those left out of which the unconstrained baseline does not converge.

        Raises ConfigurationError if the folder holds something, or a family needs files or code of its own.
        """
        if folder.exists() and any(folder.iterdir()):
            raise ConfigurationError(
                f"{folder} is not empty: a test set is not changed. Give another folder with --out"
            )
        folder.mkdir(parents=True, exist_ok=True)
        index: dict[str, Any] = {}
        for family in families:
            if family.name in index:
                raise ConfigurationError(f"there are two families {family.name}: a test set names its files after them")
            if files := Scenario(family.name, family.tables, family.folder).files:
                raise ConfigurationError(f"family {family.name} needs {files[0].name}: a test set has scenes alone")
            tables = {**family.tables, "testset": version}
            source, hashes, left_out = replace(family, tables=tables), {}, {}
            for half, count in scenes.items():
                drawn = [source.scene(number, half, seed) for number in _reported(range(count), told, family.name)]
                lines = [line_of(scene) for scene in drawn]
                (folder / f"{family.name}.{half}.jsonl.gz").write_bytes(
                    gzip.compress("".join(f"{line}\n" for line in lines).encode(), 9, mtime=0)
                )
                hashes[half] = [_digest(line) for line in lines]
                left_out[half] = sum(scene.rejected.get(Reason.BASELINE_LOST, 0) for scene in drawn)
            index[family.name] = {"left_out": left_out, "tables": tables, "sha256": hashes}
        tools = ("vsconstraints", __version__), ("NumPy", np.__version__), ("Pinocchio", pin.__version__)
        made_by = f"{', '.join(map(' '.join, tools))} on {platform.machine()}"
        made = {"version": version, "seed": seed, "made_by": made_by, "families": index}
        (folder / INDEX).write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        return cls.load(folder)

    def problems(self, redraw: float = 0.0, seed: int = 0, told: Told = lambda *_: None) -> Iterator[str]:
        """What is not as it was made: files and scenes that are missing, added or changed, or cannot be read.

        A share ``redraw`` of all scenes, chosen by ``seed``, is drawn again too, and compared bit by bit.
        """
        for path in sorted(self.folder.glob("*.jsonl*")):
            if path.name not in self.hashes:
                yield f"{path.name}: no file of the test set"
        whole: list[tuple[FrozenFamily, str, int, str]] = []
        for family in self.families:
            for half in HALVES:
                file = family.file(half)
                try:
                    lines = _lines(file)
                except ConfigurationError as error:
                    yield str(error)
                    continue
                for number, (line, known) in enumerate(zip_longest(lines, self.hashes[file.name])):
                    if line is None or known is None:
                        yield f"{file.name}: scene {number} is {'missing' if line is None else 'not in the index'}"
                    elif _digest(line) != known:
                        yield f"{file.name}: scene {number} was changed: its SHA-256 is another one"
                    else:
                        whole.append((family, half, number, line))
        for family, half, number, line in whole:
            try:
                family.read(line, Drawn(family.name, number, half, self.seed, self.folder))
            except ConfigurationError as error:
                yield str(error)
        again = Random(seed).sample(whole, math.ceil(redraw * len(whole)))
        for family, half, number, line in _reported(again, told, "drawn again"):
            other = family.source.scene(number, half, self.seed)
            if not other.found or line_of(other) != line:
                yield f"{family.file(half).name}: scene {number} is drawn otherwise by this version on this machine"


def _reported(items: Sequence[Any], told: Told, name: str) -> Iterator[Any]:
    """The items, with progress told before each."""
    for done, item in enumerate(items):
        told(name, done, len(items))
        yield item


@dataclass(frozen=True)
class _Index:
    """Keys of a test set's index."""

    version: str
    seed: int
    made_by: str
    families: dict[str, Table]


@dataclass(frozen=True)
class _Family:
    """Keys of one family in it: by half, how many scenes were left out, and the hashes of those that are kept."""

    left_out: dict[str, int]
    tables: Table
    sha256: dict[str, list[str]]
