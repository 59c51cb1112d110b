"""Stored results are data: whoever reads them runs nothing, writes nothing elsewhere, and asks
nobody.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import html5lib
import pytest
from checks.stored import Watch
from markdown_it import MarkdownIt
from typer.testing import CliRunner

from browser import NAMES, browser, program
from campaigns import campaign
from documents import ROOT
from test_evidence import HERE
from vsconstraints.bench.evidence import Evidence, collect, merge
from vsconstraints.bench.reports import replay, write_evidence_report
from vsconstraints.cli import app
from vsconstraints.comparisons import StoredComparison, Suite, compare
from vsconstraints.comparisons.metrics import constraint_columns, result_columns
from vsconstraints.comparisons.runs.files import SUMS, write_arrays
from vsconstraints.comparisons.tables import read_table, write_table
from vsconstraints.errors import ConfigurationError, VsconstraintsError
from vsconstraints.reports import write_report
from vsconstraints.reports.page import page_of
from vsconstraints.view.notebooks.comparison import Comparison
from vsconstraints.view.replay import write_replay
from vsconstraints.view.replay.runs import select_run

OWN = '''
from pathlib import Path
Path(__file__).with_name("has-run").touch()
from vsconstraints.constraints import FieldOfView


class Mine(FieldOfView):
    """One of somebody's own."""
'''

LAW = '''
from pathlib import Path
Path(__file__).with_name("has-run").touch()
from vsconstraints.controllers import Tracking


class Law(Tracking):
    """One of somebody's own."""
'''

NPZ = "example-2d-fov--sliding-mode--0.npz"


def changed(folder: Path, change: Callable[[dict[str, Any]], object], sums: bool = False) -> Path:
    """A folder whose manifest somebody has edited, who removed the checksums."""
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    change(manifest)
    path.write_text(json.dumps(manifest), encoding="utf-8")
    if not sums:
        (folder / SUMS).unlink(missing_ok=True)
    return folder


@pytest.fixture(scope="module")
def watch() -> Watch:
    return Watch()


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("real") / "results"
    settings = ["scenario.duration=0.2"]
    compare(
        Suite.load().select(["example-2d-fov"], ["sliding-mode"], settings=settings),
        folder,
        workers=1,
    )
    return folder


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drawn")
    collect(campaign(folder, scenes=2), folder / "out", HERE)
    return folder / "out"


@pytest.fixture
def with_code(real: Path, tmp_path: Path) -> Path:
    """Results whose scenario names a constraint in a file that lies where they say."""
    plant = tmp_path / "plant"
    plant.mkdir()
    (plant / "own.py").write_text(OWN)
    (plant / "mujoco.py").write_text(OWN)  # nor is it what stands in for a package

    def name(manifest: dict[str, Any]) -> None:
        (scenario,) = manifest["configuration"]["scenarios"].values()
        scenario["folder"] = str(plant)
        scenario["tables"]["constraints"][0]["type"] = "own:Mine"
        manifest["configuration"]["controllers"]["sliding-mode"] = {"type": "own:Law"}

    return changed(shutil.copytree(real, tmp_path / "results"), name)


def ran(folder: Path) -> bool:
    return (folder.parent / "plant" / "has-run").exists()


READERS: dict[str, Callable[[Path, bool], object]] = {
    "report": lambda folder, trust: write_report(folder, replays=True, trust=trust),
    "replay": lambda folder, trust: select_run(str(folder / "trajectories" / NPZ), trust=trust),
    "run of a notebook": lambda folder, trust: Comparison.load(folder, trust).run("sliding-mode"),
    "figures of a notebook": lambda folder, trust: Comparison.load(folder, trust).plot(),
}


@pytest.mark.parametrize("reader", READERS)
def test_a_comparison_that_names_code_is_read_without_it(reader: str, with_code: Path) -> None:
    path = list(sys.path)
    said = ""
    try:
        READERS[reader](with_code, False)
    except ConfigurationError as error:
        said = str(error)
    assert not ran(with_code)
    assert sys.path == path
    text = said or (with_code / "report.md").read_text(encoding="utf-8")
    assert "needs code that the results name, 'own:Mine'" in text
    assert "--trust" in text
    READERS[reader](with_code, True)
    assert ran(with_code)


def test_one_line_of_each_command_says_that_code_is_not_run(
    with_code: Path, tmp_path: Path
) -> None:
    for words in (
        ["report", str(with_code)],
        ["replay", str(with_code / "trajectories" / NPZ), "--gif", "a.gif"],
    ):
        done = CliRunner().invoke(app, words)
        assert (
            done.stderr.count(
                "warning: some of what is drawn needs code that the results name, 'own:Mine'"
            )
            == 1
        )
    assert not ran(with_code)
    for words in (["diff", str(with_code), str(with_code)], ["verify", str(with_code)]):
        CliRunner().invoke(app, words)
    assert not ran(with_code)
    assert CliRunner().invoke(app, ["report", str(with_code), "--trust"]).exit_code == 0
    assert ran(with_code)


def test_code_in_an_installed_package_is_not_run_either(
    real: Path, tmp_path: Path, watch: Watch
) -> None:
    def name(manifest: dict[str, Any]) -> None:
        (scenario,) = manifest["configuration"]["scenarios"].values()
        scenario["tables"]["constraints"][0]["type"] = "antigravity:Mine"

    folder = changed(shutil.copytree(real, tmp_path / "results"), name)
    write_report(folder)
    assert "antigravity" not in sys.modules


@pytest.fixture
def campaign_with_code(drawn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Evidence of which a law and a family's constraint are somebody's own."""
    plant = tmp_path / "plant"
    plant.mkdir()
    (plant / "own.py").write_text(OWN + LAW)
    monkeypatch.syspath_prepend(str(plant))
    folder = shutil.copytree(drawn, tmp_path / "results")
    for path in (*folder.rglob("*.parquet"), folder / SUMS):
        path.unlink()

    def name(manifest: dict[str, Any]) -> None:
        configuration = manifest["configuration"]
        configuration["controllers"]["sliding-mode"]["type"] = "own:Law"
        configuration["families"]["quick"]["folder"] = str(plant)
        configuration["families"]["quick"]["tables"]["constraints"][0]["type"] = "own:Mine"

    return changed(folder, name)


def test_a_campaign_that_names_code_is_read_without_it(campaign_with_code: Path) -> None:
    evidence = Evidence.load(campaign_with_code)
    (remark,) = [text for text in evidence.remarks if "code" in text]
    assert "'own:Law'" in remark
    assert "'own:Mine'" in remark
    with pytest.raises(ConfigurationError, match="needs code that the results name, 'own:Mine'"):
        evidence.drawn("quick", 0)
    for law in ("sliding-mode", "tracking"):
        with pytest.raises(ConfigurationError, match="needs code that the results name"):
            replay(campaign_with_code, "quick", 0, "nominal", law)
    assert not ran(campaign_with_code)


def test_a_law_of_a_campaign_is_made_only_where_it_is_trusted(
    drawn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "plant").mkdir()
    (tmp_path / "plant" / "own_law.py").write_text(LAW)
    monkeypatch.syspath_prepend(str(tmp_path / "plant"))
    folder = shutil.copytree(drawn, tmp_path / "results")
    for path in folder.rglob("*.parquet"):
        path.unlink()
    changed(
        folder,
        lambda manifest: manifest["configuration"]["controllers"].update(
            mine={"type": "own_law:Law"}
        ),
    )
    with pytest.raises(
        ConfigurationError, match="controller mine needs code that the results name, 'own_law:Law'"
    ):
        replay(folder, "quick", 0, "nominal", "mine")
    assert not ran(folder)
    replay(folder, "quick", 0, "nominal", "mine", trust=True)
    assert ran(folder)


def test_no_pickle_is_read(real: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(real, tmp_path / "results")
    (folder / SUMS).unlink()
    import numpy as np

    class Acts:
        def __reduce__(self) -> Any:
            return (Path.touch, (tmp_path / "has-run",))

    file = folder / "trajectories" / NPZ
    with np.load(file) as stored:
        arrays = {name: stored[name] for name in stored.files}
    np.savez_compressed(
        file, allow_pickle=True, **{**arrays, "phi": np.array([Acts()], dtype=object)}
    )
    assert StoredComparison.load(folder).run("example-2d-fov", "sliding-mode") is None
    assert not (tmp_path / "has-run").exists()


@pytest.mark.parametrize("what", ["scenarios", "controllers"])
@pytest.mark.parametrize(
    "name", ["../../../x", "/tmp/x", "a/b", "..", "", "a--b", "![x](y)", "a\nb", "x" * 101]
)
def test_names_that_files_are_named_after_are_looked_at(
    what: str, name: str, real: Path, tmp_path: Path
) -> None:
    def rename(manifest: dict[str, Any]) -> None:
        table = manifest["configuration"][what]
        table[name] = table.pop(list(table)[-1])

    folder = changed(shutil.copytree(real, tmp_path / "deep" / "er" / "results"), rename)
    before = sorted(path for path in tmp_path.rglob("*") if folder not in path.parents)
    with pytest.raises(ConfigurationError, match="is used in file names"):
        write_report(folder)
    assert sorted(path for path in tmp_path.rglob("*") if folder not in path.parents) == before


@pytest.mark.parametrize("what", ["families", "controllers", "conditions"])
def test_names_of_a_campaign_are_looked_at(what: str, drawn: Path, tmp_path: Path) -> None:
    def rename(manifest: dict[str, Any]) -> None:
        table = manifest["configuration"]
        if what == "conditions":
            table["families"]["quick"]["conditions"][0] = "../../x"
        else:
            table[what]["../../x"] = table[what].pop(list(table[what])[-1])

    folder = changed(shutil.copytree(drawn, tmp_path / "results"), rename)
    for read in (write_evidence_report, lambda folder: merge(tmp_path / "merged", [folder])):
        with pytest.raises(ConfigurationError, match="is used in file names"):
            read(folder)
    assert not (tmp_path / "merged").exists()


@pytest.mark.parametrize(
    "name", [".vsconstraints-lock", "report.md.part", "figures", "figures/a.png", "trajectories/x"]
)
def test_a_link_out_of_the_folder_is_refused(name: str, real: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(real, tmp_path / "results")
    (tmp_path / "outside").write_text("mine")
    (folder / name).parent.mkdir(exist_ok=True)
    shutil.rmtree(folder / name, ignore_errors=True)
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(tmp_path / "outside")
    for read in (write_report, StoredComparison.load):
        with pytest.raises(ConfigurationError, match="a link that leads out of the folder"):
            read(folder)
    with pytest.raises(ConfigurationError, match="a link that leads out of the folder"):
        compare(Suite.load().select(["example-2d-fov"], ["sliding-mode"]), folder, workers=0)
    assert (tmp_path / "outside").read_text() == "mine"


def test_a_device_is_no_file_of_a_scenario(real: Path, tmp_path: Path) -> None:
    def name(manifest: dict[str, Any]) -> None:
        (scenario,) = manifest["configuration"]["scenarios"].values()
        scenario["tables"]["camera"] = {"calibration": "/dev/zero"}

    folder = changed(shutil.copytree(real, tmp_path / "results"), name)
    assert "'/dev/zero', which is neither a file" in write_report(folder).read_text(
        encoding="utf-8"
    )


BAIT = "http://127.0.0.1:9/bait"
HOSTILE = (
    f"![x]({BAIT}) [here]({BAIT}) <img src={BAIT}> <{BAIT}> <script>fetch('{BAIT}')</script> `x` "
    f"| ![][b]\n\n"
    f"[b]: {BAIT}\n\n<img src='{BAIT}'>\n\n![x]({BAIT})"
)
"""A text that asks a server, in every way that Markdown and HTML know."""


def everywhere(data: Any) -> Iterator[tuple[Any, Any]]:
    items = (
        data.items()
        if isinstance(data, dict)
        else enumerate(data)
        if isinstance(data, list)
        else ()
    )
    for key, inner in items:
        if isinstance(inner, str):
            yield data, key
        yield from everywhere(inner)


def addresses(text: str) -> set[str]:
    """What Markdown links to and shows, and its HTML."""
    found = set()
    for token in MarkdownIt("commonmark").enable("table").parse(text):
        for one in (token, *(token.children or ())):
            found |= {str(one.attrs[name]) for name in ("src", "href") if name in one.attrs}
            found |= (
                {one.content}
                if one.type.startswith("html") and "<a id=" not in one.content
                else set()
            )
    return found - {"</a>"}


def hostile(folder: Path) -> Path:
    """A comparison with such a text wherever one can be: in the manifest and in the cells of its
    tables.
    """

    def bait(manifest: dict[str, Any]) -> None:
        configuration = manifest["configuration"]
        kept = {"folder", "type", "robot", "solver", "blend", "rows"}
        for at, key in list(everywhere(manifest)):
            if key not in kept:
                at[key] = HOSTILE
        for scenario in configuration["scenarios"].values():
            scenario["tables"].update(title=HOSTILE, description=HOSTILE)
            scenario["tables"]["disturbances"] = {HOSTILE: HOSTILE}
            scenario["tables"]["limits"] = {HOSTILE: HOSTILE}
            scenario["tables"]["plant"] = {HOSTILE: HOSTILE}
            scenario["tables"]["robot"] = {"name": HOSTILE}
        manifest["packages"] = {HOSTILE: HOSTILE}

    changed(folder, bait)
    for name, columns, texts in (
        ("results.csv", result_columns(), ("suite", "reason", "violated", "within_band")),
        ("constraints.csv", constraint_columns(), ("suite", "constraint", "kind", "unit")),
    ):
        lines = read_table(folder / name, columns)
        for i, line in enumerate(lines):
            line |= {
                text: f"{HOSTILE}{i}" if text == "constraint" else HOSTILE
                for text in texts
                if text in columns
            }
            line["trial"] = int(line["trial"])
            line["violation_depth"] = 0.5
            line |= (
                {"status": "failed"}
                if "status" in line
                else {"challenged": True, "held_time_s": 1.0, "usage_held": 0.5}
            )
        write_table(folder / name, columns, lines)
    return folder


def test_whatever_a_text_says_a_report_asks_nobody(real: Path, tmp_path: Path) -> None:
    folder = hostile(
        shutil.copytree(real, tmp_path / "results", ignore=shutil.ignore_patterns("trajectories"))
    )
    report = write_report(folder, figures=False)
    text = report.read_text(encoding="utf-8")
    assert text.count(BAIT) > 20
    found = addresses(text)
    assert not [address for address in found if BAIT in address], found
    page = page_of(report).read_text(encoding="utf-8")
    elements = html5lib.parse(page, namespaceHTMLElements=False).iter()
    asked = [
        str(one.get(name))
        for one in elements
        for name in ("src", "href", "srcset", "style")
        if one.get(name)
    ]
    assert not [address for address in asked if BAIT in address], asked
    assert "default-src 'none'" in page


@pytest.mark.skipif(
    program() is None, reason=f"no browser: none of {', '.join(NAMES)} is installed"
)
def test_a_page_fetches_nothing_even_where_it_says_so(real: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(real, tmp_path / "results")
    page_file = page_of(write_report(folder))
    page = page_file.read_text(encoding="utf-8")
    # what escaping may have missed
    bait = (
        f"<img src='{BAIT}'><link rel='stylesheet' href='{BAIT}'><iframe "
        f"src='{BAIT}'></iframe><script>x=1</script>"
    )
    page_file.write_text(page.replace("<main>", f"<main>{bait}"), encoding="utf-8")
    with browser(tmp_path / "browser") as opened:
        opened.open(page_file.as_uri())
        opened.wait("document.readyState === 'complete' && location.protocol === 'file:'")
        figures = opened.value(
            "[...document.images].filter(i => !i.src.includes('bait')).map(i => i.naturalWidth)"
        )
        blocked = [text for text in opened.complaints if "Content Security Policy" in text]
    assert figures
    assert all(width > 0 for width in figures)
    assert len(blocked) >= 4, opened.complaints


CELLS = {
    "run code": lambda did: any(
        text.startswith(("import", "os.system", "subprocess")) for text in did
    ),
    "write": lambda did: any(text.startswith(("open", "os.")) for text in did),
    "reach the network": lambda did: any(text.startswith("socket") for text in did),
}


def page_table() -> dict[str, dict[str, str]]:
    """The table of the page on trust, by kind of file."""
    text = (ROOT / "docs" / "trust.md").read_text(encoding="utf-8")
    lines = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in text.splitlines()
        if line.startswith("|")
    ]
    return {line[0]: dict(zip(lines[0], line, strict=True)) for line in lines[2:]}


KINDS: dict[str, Callable[[Path, Path], object]] = {
    "folder of a comparison": lambda real, drawn: write_report(real),
    "folder of a campaign": lambda real, drawn: write_evidence_report(drawn, figures=False),
    "trajectory (`.npz`)": lambda real, drawn: write_replay(
        [select_run(str(real / "trajectories" / NPZ))], real / "replay.html"
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_page_on_trust_says_what_readers_do(
    kind: str, real: Path, drawn: Path, tmp_path: Path, watch: Watch
) -> None:
    folders = (
        shutil.copytree(real, tmp_path / "in" / "real"),
        shutil.copytree(drawn, tmp_path / "in" / "drawn"),
    )
    with watch.over(tmp_path / "in") as did:
        KINDS[kind](*folders)
    cells = page_table()[kind]
    assert cells["may read"] == "itself, and files that its scenes name"
    for column, happens in CELLS.items():
        allowed = cells[f"may {column}"]
        assert allowed.startswith("no" if column != "write" else "its own folder")
        assert not happens(did), did


@pytest.mark.parametrize("kind", ["page of a report", "page of a replay"])
def test_the_page_on_trust_says_what_pages_do(kind: str) -> None:
    folder = "reports/templates" if "report" in kind else "view/replay"
    text = (ROOT / "src" / "vsconstraints" / folder / "page.html").read_text(encoding="utf-8")
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]+)"', text)
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert rules["default-src"] == "'none'"
    assert "http" not in policy
    assert "*" not in policy
    cells = page_table()[kind]
    assert cells["may reach the network"] == "no"
    assert cells["may run code"] == (
        "no" if "script-src" not in rules else "its own scripts, in the browser"
    )


def test_folders_without_checksums_are_read_with_a_line_that_says_so(tmp_path: Path) -> None:
    kept = shutil.copytree(
        ROOT / "reports" / "default", tmp_path / "kept", ignore=shutil.ignore_patterns(SUMS)
    )
    done = CliRunner().invoke(app, ["report", str(kept), "--no-figures"])
    assert done.exit_code == 0, done.output
    assert done.stderr.count("has no checksums") == 1


def test_what_a_file_expands_to_is_bounded_before_it_is_read(real: Path, tmp_path: Path) -> None:
    import tracemalloc

    import numpy as np

    folder = shutil.copytree(real, tmp_path / "results")
    (folder / SUMS).unlink()
    file = folder / "trajectories" / NPZ
    with np.load(file) as stored:
        arrays: dict[str, Any] = {name: stored[name] for name in stored.files}
    facts = json.loads(str(arrays.pop("facts")))
    arrays["phi"] = np.zeros((400, 1_000_000), dtype=np.bool_)  # 400 MB, where a run has 20 samples
    write_arrays(file, {**facts, **arrays})
    assert 100 * file.stat().st_size < arrays["phi"].nbytes
    tracemalloc.start()
    try:
        assert StoredComparison.load(folder).run("example-2d-fov", "sliding-mode") is None
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()
    assert issubclass(ConfigurationError, VsconstraintsError)
