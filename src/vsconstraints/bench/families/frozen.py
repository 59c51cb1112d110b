"""Test sets: scenes that were drawn once and are read from files, with a SHA-256 of each scene."""

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
from itertools import product, zip_longest
from pathlib import Path
from random import Random
from typing import Any, TypeVar

import msgspec

from ... import __version__
from ...errors import ConfigurationError, unknown_name
from ...plugins.regular_files import read_regular, require_regular
from ...scenarios.reading import Table
from ...scenarios.scenario import Scenario
from ...simulation import Setup
from .attempts import Reason
from .drawn import Drawn
from .family import HALVES, NOMINAL, SHIPPED, Family

V1 = SHIPPED / "testset-v1"  #: folder of the test set that comes with the package
INDEX = "testset.json"  #: index of a test set; below, the file of a family's half
FILE = "{}.{}.jsonl.gz"
MAX_BYTES = 500_000_000  #: largest size of an expanded file
OnDrawn = Callable[[str, int, int], None]  #: progress: family, scenes done, scenes in all
Kind = TypeVar("Kind")


class _Line(msgspec.Struct, forbid_unknown_fields=True):
    """A scene as it is stored.

    Other conditions hold only the tables that differ from the nominal one. NaN is stored as null.
    """

    number: int
    tables: dict[str, Table]
    values: Table
    rejected: dict[str, int]
    challenged: tuple[str, ...]
    share_to_hold: float | None
    least_time: float | None
    duration: float
    noise: int
    refusal: str


class _Family(msgspec.Struct, forbid_unknown_fields=True):
    """Entry of a family in the index.

    ``left_out`` counts the omitted scenes by half; ``sha256`` holds the hashes of the stored ones.
    """

    left_out: dict[str, int]
    tables: Table
    sha256: dict[str, list[str]]


class _Index(msgspec.Struct, forbid_unknown_fields=True):
    version: str
    seed: int
    made_by: str
    families: dict[str, _Family]


class FrozenFamily(Family):
    """A family of a test set: its scenes are read from files, not drawn.

    Its tables are those from which the scenes were drawn. In addition, ``frozen`` holds the
    ``file``, the ``seed`` and the joint ``sha256`` of the scenes, by half.
    """

    @property
    def source(self) -> Family:
        """Family from which the stored scenes were drawn.

        Other seeds give further scenes of the same distribution.
        """
        tables = {key: value for key, value in self.tables.items() if key != "frozen"}
        return Family(self.name, tables, self.folder, self.trusted)

    def file(self, half: str) -> Path:
        """Return the path of a half's scenes."""
        return self.folder / str(self.tables["frozen"][half]["file"])

    def _filled(self, scene: Drawn) -> tuple[Drawn, dict[str, Setup]]:
        try:
            frozen = self.tables["frozen"][scene.half]
            seed = frozen["seed"]
            file = self.file(scene.half)
            lines = _checked_lines(file, frozen["sha256"])
        except (KeyError, TypeError) as error:
            raise ConfigurationError(
                f"{self.name}: frozen has no entry for its {scene.half} scenes"
            ) from error
        if scene.seed != seed or scene.number >= len(lines):
            raise ConfigurationError(
                f"{file.name} has {len(lines)} scenes of seed {seed}, and no scene {scene.number} "
                f"of seed {scene.seed}"
            )
        scene = self.read(lines[scene.number], scene)
        return scene, {name: scene.setup(name) for name in self.conditions}

    def read(self, line: str, scene: Drawn) -> Drawn:
        """Return the scene with the content of a line.

        Raises ConfigurationError, which names file, scene and problem, if the line is not valid.
        """
        where = f"{self.file(scene.half).name}: scene {scene.number}"
        decoded = _decoded(line, _Line, where)
        content: dict[str, Any] = msgspec.structs.asdict(decoded)
        tables = content["tables"]
        if {*tables} != {*self.conditions} or content["number"] != scene.number:
            raise ConfigurationError(
                f"{where} states number {content['number']} with conditions {', '.join(tables)}; "
                f"they are {', '.join(self.conditions)}"
            )
        whole_tables = {}
        for name in self.conditions:
            whole_tables[name] = {**tables[NOMINAL], **tables[name]}
        content["tables"] = whole_tables
        for name, value in content.items():
            if value is None:
                content[name] = math.nan
        return replace(scene, **content)


def line_of(scene: Drawn) -> str:
    """Return a scene as a line of JSON, from which it is read back bit by bit.

    Numbers are written as their shortest exact decimals.
    """
    nominal_tables = scene.scenario().tables
    nominal = {key: _json(value) for key, value in nominal_tables.items()}
    stored_tables = {}
    for condition, tables in scene.tables.items():
        stored_tables[condition] = {
            key: value
            for key, value in tables.items()
            if condition == NOMINAL or nominal.get(key) != _json(value)
        }
    content = {}
    for name in _Line.__struct_fields__:
        value = getattr(scene, name)
        is_nan = value != value
        content[name] = None if is_nan else value
    content["tables"] = stored_tables
    return _json(content)


def family_of(name: str, tables: Table, folder: Path, trusted: bool = True) -> Family:
    """Return a family from its tables, frozen or not."""
    kind = FrozenFamily if "frozen" in tables else Family
    return kind(name, tables, folder, trusted)


def _json(data: Any) -> str:
    return json.dumps(
        data,
        ensure_ascii=False,
        allow_nan=False,
        separators=(",", ":"),
        default=lambda a: a.tolist(),
    )


def _decoded(text: str | bytes, kind: type[Kind], where: str) -> Kind:
    try:
        return msgspec.json.decode(text, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigurationError(f"{where} cannot be read: {error}") from error


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()


def _lines(path: Path) -> list[str]:
    try:
        require_regular(path)
        with gzip.open(path, "rb") as file:
            *lines, _ = file.read(MAX_BYTES).decode().split("\n")
            return lines
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path.name} of a test set cannot be read: {error}") from error


@lru_cache(maxsize=64)
def _checked_lines(path: Path, digest: str) -> list[str]:
    lines = _lines(path)
    if _digest("".join(map(_digest, lines))) != digest:
        raise ConfigurationError(
            f"{path} was changed: `vsconstraints testset verify` names the scenes"
        )
    return lines


@dataclass(frozen=True)
class TestSet:
    """Frozen scenes of several families: a file per family and half, and an index with hashes.

    ``seed`` is the seed of the draws. ``hashes`` holds the hash of each scene by file; ``sha256``
    is the hash of the index.
    """

    __test__ = False  # pytest must not collect this class

    folder: Path
    version: str
    seed: int
    families: tuple[FrozenFamily, ...]
    hashes: Mapping[str, Sequence[str]]
    sha256: str

    @classmethod
    def load(cls, folder: Path = V1) -> TestSet:
        """Read the index of a test set; the files are read with their scenes.

        Raises ConfigurationError if the index cannot be used.
        """
        path = folder / INDEX
        families = []
        hashes = {}
        try:
            text = read_regular(path)
        except OSError as error:
            raise ConfigurationError(f"there is no test set in {folder}: {error}") from error
        index = _decoded(text, _Index, str(path))
        for name, family in index.families.items():
            frozen = {}
            for half in HALVES:
                file = FILE.format(name, half)
                kept = family.sha256.get(half, [])
                hashes[file] = kept
                joint_hash = _digest("".join(kept))
                frozen[half] = {"file": file, "seed": index.seed, "sha256": joint_hash}
            tables = {**family.tables, "testset": index.version, "frozen": frozen}
            families.append(FrozenFamily(name, tables, folder))
        digest = sha256(text).hexdigest()
        return cls(folder, index.version, index.seed, tuple(families), hashes, digest)

    @classmethod
    def make(
        cls,
        folder: Path,
        families: Sequence[Family],
        version: str,
        scenes: Mapping[str, int],
        seed: int,
        on_done: OnDrawn,
    ) -> TestSet:
        """Draw and store a test set.

        ``scenes`` maps each half to its number of scenes. Scenes in which the unconstrained
        baseline does not converge are rejected. Raises ConfigurationError if the folder is not
        empty, or if a family needs further files or custom code.
        """
        if folder.exists() and any(folder.iterdir()):
            raise ConfigurationError(
                f"{folder} is not empty, and a test set is never changed: give another --out"
            )
        folder.mkdir(parents=True, exist_ok=True)
        index = _Index(version, seed, f"vsconstraints {__version__} on {platform.machine()}", {})
        for family in families:
            needs_files = Scenario(family.name, family.tables, family.folder).files
            if needs_files or family.name in index.families:
                raise ConfigurationError(
                    f"family {family.name} appears twice, or needs files, which a test set "
                    "cannot hold"
                )
            source = replace(family, tables={**family.tables, "testset": version})
            entry = _Family({}, source.tables, {})
            index.families[family.name] = entry
            for half, count in scenes.items():
                lines = []
                left_out = 0
                for number in _reported(range(count), on_done, family.name):
                    scene = source.scene(number, half, seed)
                    lines.append(line_of(scene))
                    left_out += scene.rejected.get(Reason.BASELINE_LOST, 0)
                data = "".join(f"{line}\n" for line in lines).encode()
                file = folder / FILE.format(family.name, half)
                file.write_bytes(gzip.compress(data, 9, mtime=0))
                entry.sha256[half] = [_digest(line) for line in lines]
                entry.left_out[half] = left_out
        encoded = msgspec.json.encode(index)
        text = msgspec.json.format(encoded, indent=1)
        (folder / INDEX).write_bytes(text + b"\n")
        return cls.load(folder)

    def chosen(
        self, names: Sequence[str], half: str, most: int | None, secret_seed: int | None
    ) -> dict[str, Any]:
        """Return families, half, seed and number of scenes of a campaign.

        Without ``most``, all scenes are used; with a secret seed, new scenes are drawn. Raises
        ConfigurationError for unknown names, for more scenes than the test set has, and if the
        secret seed is that of the test set.
        """
        if half not in HALVES:
            raise unknown_name(f"half of test set {self.version}", half, HALVES)
        known = {family.name: family for family in self.families}
        for name in names:
            if name not in known:
                raise unknown_name(f"family of test set {self.version}", name, known)
        chosen = list(dict.fromkeys(names or known))
        files = [FILE.format(name, half) for name in chosen]
        counts = [len(self.hashes[file]) for file in files]
        available = min(counts, default=0)
        stored = f"test set {self.version} has {available} {half} scenes of each family"
        if secret_seed == self.seed:
            raise ConfigurationError(f"{stored}; seed {self.seed} is that of the test set")
        if (most or 1) > available:
            raise ConfigurationError(f"{stored}; {most} are requested")
        families: list[Family] = [known[name] for name in chosen]
        seed = self.seed
        if secret_seed is not None:
            families = [known[name].source for name in chosen]
            seed = secret_seed
        return {
            "half": half,
            "scenes": most or available,
            "families": tuple(families),
            "seed": seed,
        }

    def problems(
        self, redraw: float = 0.0, seed: int = 0, on_done: OnDrawn = lambda *_: None
    ) -> Iterator[str]:
        """Yield deviations from the index: missing, added, changed or unreadable files and scenes.

        A share ``redraw`` of the scenes, chosen by ``seed``, is drawn again and compared bit by
        bit.
        """
        for path in sorted(self.folder.glob("*.jsonl*")):
            if path.name not in self.hashes:
                yield f"{path.name} is not a file of the test set"
        whole: list[tuple[FrozenFamily, Drawn, str]] = []
        for family, half in product(self.families, HALVES):
            file = family.file(half)
            try:
                lines = _lines(file)
            except ConfigurationError as error:
                yield str(error)
                continue
            stored_and_known = zip_longest(lines, self.hashes[file.name])
            for number, (line, known) in enumerate(stored_and_known):
                scene = Drawn(family.name, number, half, self.seed, self.folder)
                where = f"{file.name}: scene {number}"
                if line is None or known is None:
                    yield f"{where} is {'missing' if line is None else 'not in the index'}"
                elif _digest(line) != known:
                    yield f"{where} was changed: its SHA-256 differs from the index"
                else:
                    try:
                        family.read(line, scene)
                        whole.append((family, scene, line))
                    except ConfigurationError as error:
                        yield str(error)
        count = math.ceil(redraw * len(whole))
        again = Random(seed).sample(whole, count)
        for family, scene, line in _reported(again, on_done, "drawing again"):
            other = family.source.scene(scene.number, scene.half, self.seed)
            if not other.found or line_of(other) != line:
                yield (
                    f"{family.file(scene.half).name}: scene {scene.number} differs when it is "
                    "drawn here"
                )


def _reported(items: Sequence[Any], on_done: OnDrawn, name: str) -> Iterator[Any]:
    for done, item in enumerate(items):
        on_done(name, done, len(items))
        yield item
