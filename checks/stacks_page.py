"""``python -m checks.stacks_page``: figure and tables of docs/stacks-in-view.md.

They are made without runs from ``comparisons/stacks.parquet``. With ``--of FOLDER``, that table is
first written from the folder of ``python -m checks.stacks run``; with ``--add FOLDER``, the runs of
the folder join those that it has. An entry that no list here names is shown, too.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from checks.stacks import (
    GAINS,
    SUITE,
    TIME_LIMIT,
    VIEW_GAINS,
    Group,
    Journal,
    Line,
    applies,
    chosen,
    feature_of,
    grid,
    is_stack,
    kind_of,
    score_of,
)
from vsconstraints.bench.evidence import Campaign, parquet
from vsconstraints.bench.evidence.parquet import KEYS, Column
from vsconstraints.bench.statistics import rate
from vsconstraints.comparisons.runs.folder import locked, manifest_of
from vsconstraints.comparisons.runs.spec import BASELINE
from vsconstraints.errors import ConfigurationError, VsconstraintsError
from vsconstraints.reports.plots import Figure, Sheet, logarithmic
from vsconstraints.reports.plots.style import COLOURS, Look, mark_of

TABLE = SUITE.with_suffix(".parquet")  #: The kept runs.
README = SUITE.parents[1] / "README.md"
PAGE = SUITE.parents[1] / "docs" / "stacks-in-view.md"
FIGURE = SUITE.parents[1] / "docs" / "stacks-in-view.png"
#: Marks in the page around the parts that are made from the table.
MARKS = {
    name: (f"<!-- {name}: begin -->", f"<!-- {name}: end -->")
    for name in ("answer", "tables", "stacks")
}
POSE = ("ur5", "panda")
#: Families of each feature, and how sentences say what their goals are given by.
FEATURES: Mapping[str, Sequence[str]] = {
    "by pose": POSE,
    "by image points": ("ur5-image", "panda-image"),
}
TITLES = {
    "ur5": "UR5, by pose",
    "panda": "Panda, by pose",
    "ur5-image": "UR5, by image points",
    "panda-image": "Panda, by image points",
}
COLUMNS = (
    *KEYS,
    *(Column(name, "number") for name in ("gain", "view_gain")),
    Column("success", "flag"),
    Column("status", "text", category=True),
    *(
        Column(name, "number")
        for name in ("settling_time_s", "margin_px", "other_rows", "unanswered")
    ),
)
#: Panels of the figure, and the entries in each; entries in grey know nothing of the image.
PANELS: Mapping[str, Mapping[str, str]] = {
    "stacks": {
        "pink": "blue o -",
        "pink-limited": "sky s --",
        "mink": "orange ^ -",
        "placo": "green D -",
        "robotics-toolbox": "purple v -",
        "cbfpy": "wine P -",
        "oink": "grey < :",
        "tsid": "grey > :",
        "visp": "grey X :",
    },
    "laws: velocities": {
        "velocity-qp": "blue o -",
        "velocity-qp-limited": "sky s --",
        "velocity-hierarchical-qp": "orange ^ -",
        "velocity-hierarchical-qp-limited": "green D --",
        "velocity-damper": "purple v -",
        "resolved-rate-avoidance": "wine P -",
        "resolved-rate": "grey X :",
    },
    "laws: accelerations": {
        "hierarchical-qp": "green D -",
        "sliding-mode": "blue s -",
        "predictive": "olive p -",
    },
}
#: Styles of entries that no panel names.
FURTHER_STYLES = ("vermillion * -", "brown h -", "teal * --", "black h --")
#: What entries with a constraint on the image command, and know of the arm; in the words of the
#: answer.
GROUPS: Mapping[str, Sequence[str]] = {
    "entries that command velocities without knowing the limit": (
        "pink",
        "mink",
        "placo",
        "robotics-toolbox",
        "cbfpy",
        "velocity-qp",
        "velocity-hierarchical-qp",
        "velocity-damper",
        "resolved-rate-avoidance",
    ),
    "entries that command velocities within it": (
        "pink-limited",
        "velocity-qp-limited",
        "velocity-hierarchical-qp-limited",
    ),
    "laws that command accelerations": ("hierarchical-qp", "sliding-mode", "predictive"),
}
WITHOUT_IMAGE = "entries without a constraint on the image"
BLIND = ("resolved-rate", "oink", "tsid", "visp", "machinevision-toolbox")
FAR_OUTSIDE = 1000  #: Distance outside the image beyond which no number is written [px].
SHORTEST_SAMPLE = 3  #: Successes below which no settling time is drawn.
HEIGHT, PANEL = 1.9, 1.26  #: Of a panel [in].
GAP, ABOVE = 0.2, 0.5  #: Between the panels of an arm, and above them [in].
BESIDE = (1.05, 1.55, 1.1)  #: Space for names right of the panels [in].
LABEL_GAP = 0.125  #: Least distance of labels beside lines [in].


def keep(folder: Path, add: bool = False) -> list[str]:
    """Write the table of the complete groups, and return a sentence on each that is left out.

    A group is an arm that servoes by one feature within one limit of accelerations. With ``add``,
    the entries that have runs in the folder join those of the kept table, in the same scenes.
    Raises ConfigurationError if the folder has no complete group.
    """
    manifest = manifest_of(folder)
    if "tuning" not in manifest or "scenes" not in manifest:
        raise ConfigurationError(f"{folder} has no runs of `python -m checks.stacks run`")
    with locked(folder, "a tuning"):
        lines = list(Journal(folder).values())
    facts: dict[str, Any] = {"made of": manifest["tuning"]}
    kept: list[Line] = []
    if add:
        before = parquet.facts_of(TABLE)
        facts = {**before, "added": [*before.get("added", ()), manifest["tuning"]]}
        kept = load().to_dict("records")
    joined = 0
    left_out = []
    for group in dict.fromkeys(Group(line["family"], line["condition"]) for line in lines):
        own = [line for line in lines if group.includes(line)]
        names = {line["controller"] for line in own}
        rest = [line for line in kept if not (group.includes(line) and line["controller"] in names)]
        beside = [line for line in rest if group.includes(line)]
        lacking = list(incomplete([*beside, *own], **manifest["scenes"]))
        if lacking:
            left_out.append(f"{group} is left out: {'; '.join(lacking)}")
        else:
            kept = rest + counted(own)
            joined += 1
    if not joined:
        raise ConfigurationError(f"{folder} has no complete group. {'. '.join(left_out)}")
    table = [
        {**line, "view_gain": line["view_gain"] or np.nan, "success": score_of(line)[0]}
        for line in kept
    ]
    parquet.write(TABLE, parquet.table(COLUMNS, table), facts)
    return left_out


def by_entry(lines: Sequence[Line]) -> dict[str, tuple[list[Line], list[Line]]]:
    """Return the training runs of each entry in a group, and its held-out runs that count.

    These have the gains that are chosen from the training runs.
    """
    entries: dict[str, tuple[list[Line], list[Line]]] = {}
    for name in dict.fromkeys(line["controller"] for line in lines):
        own = [line for line in lines if line["controller"] == name]
        training = [line for line in own if line["half"] == "training"]
        gains = chosen(training) if training else None
        tests = [
            line
            for line in own
            if line["half"] == "held-out" and (line["gain"], line["view_gain"]) == gains
        ]
        entries[name] = training, tests
    return entries


def counted(lines: Sequence[Line]) -> list[Line]:
    """Return the runs of a group that count."""
    return [line for both in by_entry(lines).values() for half in both for line in half]


def incomplete(lines: Sequence[Line], training: int, test: int) -> Iterator[str]:
    """Yield what is missing in a group with these numbers of scenes, for each entry that has runs.

    Each has all gains of its grid on all training scenes, and all held-out scenes with the gains
    that are chosen; these are the same for all.
    """
    suite = {entry.name: entry for entry in Campaign.load(SUITE).controllers}
    scenes: dict[str, set[int]] = {"training": set(), "held-out": set()}
    for line in counted(lines):
        scenes[line["half"]].add(line["scene"])
    for half, count in (("training", training), ("held-out", test)):
        if len(scenes[half]) > count:
            yield f"{len(scenes[half])} {half} scenes instead of {count}"
    for name, (tuned, tests) in by_entry(lines).items():
        if name not in suite:
            yield f"{name} is no entry of {SUITE.name}"
            continue
        needed = training * len(grid(suite[name]))
        if len(tuned) < needed:
            yield f"{name} has {len(tuned)} of {needed} training runs"
        if len(tests) < test:
            yield f"{name} has {len(tests)} of {test} held-out runs"


def load() -> Any:
    """Return the kept runs, with the limit of accelerations [rad/s²] as ``limit``.

    ``view_gain`` is None without one.
    """
    runs = pd.read_parquet(TABLE)
    views = runs["view_gain"].astype(object)
    runs = runs.assign(view_gain=views.where(views.notna(), None))
    return runs.assign(limit=runs["condition"].str.removeprefix("limit-").astype(float))


def entries(runs: Any) -> list[str]:
    """Return the entries of the kept runs in the order of the suite, and then all others."""
    there = dict.fromkeys(runs["controller"])
    suite = [each.name for each in Campaign.load(SUITE).controllers if each.name in there]
    return list(dict.fromkeys([*suite, *there]))


def further(runs: Any) -> list[str]:
    """Return the entries that have no group of the answer."""
    named = {name for names in (*GROUPS.values(), BLIND) for name in names}
    return [name for name in entries(runs) if name not in named]


def groups_of(runs: Any) -> dict[str, Sequence[str]]:
    """Return the entries of each group in the answer; those without a group are one by name."""
    groups = {**GROUPS, WITHOUT_IMAGE: BLIND}
    names = further(runs)
    if names:
        groups[f"further entries ({listed([f'`{name}`' for name in names])})"] = names
    return groups


def panels(runs: Any) -> dict[str, dict[str, str]]:
    """Return the styles of entries by panel, with those that no panel names."""
    suite = {entry.name: entry for entry in Campaign.load(SUITE).controllers}
    styles = {title: dict(own) for title, own in PANELS.items()}
    named = {name for own in PANELS.values() for name in own}
    others = [name for name in entries(runs) if name not in named]
    for number, name in enumerate(others):
        title = "stacks"
        if name in suite and not is_stack(suite[name]):
            of_speeds = kind_of(suite[name]).startswith(("velocity-", "resolved-rate"))
            title = "laws: velocities" if of_speeds else "laws: accelerations"
        styles[title][name] = FURTHER_STYLES[number % len(FURTHER_STYLES)]
    return styles


def tested(runs: Any, families: Sequence[str]) -> Any:
    """Return the runs in held-out scenes of families."""
    return runs[(runs["half"] == "held-out") & runs["family"].isin(families)]


def features(runs: Any) -> dict[str, Any]:
    """Return the runs in held-out scenes by feature, ``by pose`` first; those that there are."""
    every = {feature: tested(runs, families) for feature, families in FEATURES.items()}
    return {feature: own for feature, own in every.items() if len(own)}


def settling(own: Any) -> float:
    """Return the median settling time of successes [s]; NaN without one."""
    return float(own[own["success"]]["settling_time_s"].median())


# --- Figure ---


def draw(runs: Any) -> Sheet:
    """Draw success and settling time over the limit of accelerations, for each arm by pose.

    Without runs by pose, those by image points are drawn.
    """
    sheet = Sheet(left=0.5)
    feature, own = next(iter(features(runs).items()))
    limits = sorted(own["limit"].unique())
    cells = [cell for _, cell in own.groupby(["family", "controller", "limit"])]
    times = [settling(cell) for cell in cells if cell["success"].any()]
    longest = 1.1 * max(times, default=TIME_LIMIT)
    styles_by_panel = panels(own)
    arms = [family for family in FEATURES[feature] if (own["family"] == family).any()]
    for family in arms:
        top = sheet.bottom + ABOVE
        left = sheet.left
        for column, (title, styles) in enumerate(styles_by_panel.items()):
            upper = sheet.axes(left, top, PANEL, HEIGHT)
            lower = sheet.axes(left, top + HEIGHT + GAP, PANEL, HEIGHT)
            upper.set(ylim=(-3.0, 103.0))
            lower.set(ylim=(0.0, longest))
            _curves(upper, lower, own[own["family"] == family], styles, limits)
            upper.tick_params(labelbottom=False, labelleft=column == 0)
            lower.tick_params(labelleft=column == 0)
            arm = f"{TITLES[family].partition(',')[0]}, {title}"
            upper.set_title(arm, loc="left", fontsize=8.5, pad=4)
            if column == 0:
                upper.set_ylabel("success [% of scenes]")
                lower.set_ylabel("settling time [s]")
            elif column == 1 and family == arms[-1]:
                lower.set_xlabel("acceleration limit of the arm [rad/s²]")
            left += PANEL + BESIDE[column]
    sheet.bottom += 0.5
    return sheet


def _curves(
    upper: Any, lower: Any, own: Any, styles: Mapping[str, str], limits: Sequence[float]
) -> None:
    """Draw the success of entries with intervals above, and their settling time below."""
    shown = [name for name in styles if name in set(own["controller"])]
    success, times = {}, {}
    for k, name in enumerate(shown):
        colour, marker, dash = styles[name].split()
        look = Look(COLOURS[colour], marker, dash)
        style = {"color": look.colour, "linestyle": dash, "linewidth": 1.3, **mark_of(look)}
        mine = own[own["controller"] == name]
        there = sorted(mine["limit"].unique())
        cells = [mine[mine["limit"] == limit] for limit in there]
        x = np.array(there) * 1.035 ** (k - 0.5 * (len(shown) - 1))
        rates = [rate(cell["success"].to_numpy(dtype=bool)) for cell in cells]
        shares = 100.0 * np.array([each.share for each in rates])
        low = 100.0 * np.array([each.low for each in rates])
        high = 100.0 * np.array([each.high for each in rates])
        upper.vlines(x, low, high, color=look.colour, linewidth=0.7, alpha=0.45)
        upper.plot(x, shares, **style)
        enough = [cell["success"].sum() >= SHORTEST_SAMPLE for cell in cells]
        median = np.array([settling(cell) for cell in cells])
        median = np.where(enough, median, np.nan)
        lower.plot(x, median, **style)
        success[name] = shares[-1], look.colour
        if np.isfinite(median).any():
            times[name] = float(median[np.isfinite(median)][-1]), look.colour
    for ax, ends in ((upper, success), (lower, times)):
        logarithmic(ax.xaxis, limits)
        ax.set_xlim(limits[0] / 1.25, limits[-1] * 1.25)
        _labels(ax, ends)


def _labels(ax: Any, ends: Mapping[str, tuple[float, str]]) -> None:
    """Write the names of lines beside their ends, moved apart where they would overlap."""
    low, high = ax.get_ylim()
    names = sorted(ends, key=lambda name: ends[name][0])
    places = [(ends[name][0] - low) / (high - low) for name in names]
    heights = apart(places, LABEL_GAP / HEIGHT)
    for name, place, height in zip(names, places, heights, strict=True):
        colour = ends[name][1]
        ax.plot(
            (1.0, 1.05), (place, height), color=colour, linewidth=0.6, clip_on=False,
            transform=ax.transAxes, marker="",
        )  # fmt: skip
        ax.annotate(
            name.removeprefix("velocity-"), (1.06, height), xycoords="axes fraction",
            fontsize=7.5, color=colour, va="center", annotation_clip=False,
        )  # fmt: skip


def apart(places: Sequence[float], gap: float) -> list[float]:
    """Return sorted places from 0 to 1, moved as little as needed for a least gap."""
    heights = list(places)
    for _ in range(500):
        for k in range(len(heights) - 1):
            lack = gap - (heights[k + 1] - heights[k])
            if lack > 0.0:
                heights[k] -= 0.5 * lack
                heights[k + 1] += 0.5 * lack
        heights = [min(max(height, 0.0), 1.0) for height in heights]
    return heights


SHOWN = Figure("stacks-in-view", "success and settling time over the arm's agility", "", draw)


# --- Tables ---


def cell_of(own: Any) -> str:
    """Return successes of scenes with their settling time, ``7/8, 2.1 s``."""
    if own.empty:
        return "–"
    time = settling(own)
    count = f"{int(own['success'].sum())}/{len(own)}"
    return count if np.isnan(time) else f"{count}, {time:.1f} s"


def table_of(runs: Any, family: str) -> Iterator[str]:
    """Yield the lines of a family's table: successes and settling times by limit."""
    own = tested(runs, [family])
    limits = sorted(own["limit"].unique())
    heads = [f"{limit:g} rad/s²" for limit in limits]
    yield f"| entry | {' | '.join(heads)} | worst margin [px] | periods without answer |"
    yield f"|---|{'---:|' * (len(limits) + 2)}"
    for entry in entries(own):
        mine = own[own["controller"] == entry]
        cells = [cell_of(mine[mine["limit"] == limit]) for limit in limits]
        silent = 100.0 * mine["unanswered"].mean()
        worst = margin_text(float(mine["margin_px"].min()))
        share = "0" if silent == 0.0 else f"{silent:.1f} %"
        yield f"| `{entry}` | {' | '.join(cells)} | {worst} | {share} |"


def margin_text(margin: float) -> str:
    """Return a margin [px] in whole pixels.

    Beyond ``FAR_OUTSIDE`` its size says nothing: the marker comes near the plane of the camera.
    """
    if margin < -FAR_OUTSIDE:
        return f"< −{FAR_OUTSIDE}"
    return f"{margin:.0f}".replace("-", "−")


def without(family: str) -> Iterator[str]:
    """Yield the lines that name the entries that cannot servo by the feature of a family."""
    names = [
        f"`{each.name}`"
        for each in Campaign.load(SUITE).controllers
        if each.name != BASELINE and not applies(each, feature_of(family))
    ]
    feature = {"camera-pose": "the pose", "image-points": "image points"}[feature_of(family)]
    if names:
        yield f"Without a task by {feature}, and therefore not in this table: {listed(names)}.\n"


def gains_of(runs: Any) -> Iterator[str]:
    """Yield the lines of the table of chosen gains, λ/α by limit, for each family."""
    tests = runs[runs["half"] == "held-out"]
    for family in TITLES:
        own = tests[tests["family"] == family]
        if own.empty:
            continue
        limits = sorted(own["limit"].unique())
        yield f"\n**{TITLES[family]}**\n"
        yield f"| entry | {' | '.join(f'{limit:g} rad/s²' for limit in limits)} |"
        yield f"|---|{'---:|' * len(limits)}"
        for entry in entries(own):
            cells = []
            for limit in limits:
                mine = own[(own["controller"] == entry) & (own["limit"] == limit)]
                cells.append("–" if mine.empty else gains_text(mine.iloc[0]))
            yield f"| `{entry}` | {' | '.join(cells)} |"


def gains_text(run: Any) -> str:
    """Return the gains of a run, ``1.5 / 8``."""
    view = "–" if run["view_gain"] is None else f"{run['view_gain']:g}"
    return f"{run['gain']:g} / {view}"


def tables(runs: Any) -> str:
    """Return all tables of the page."""
    lines = [scenes_text(runs), ""]
    for family, title in TITLES.items():
        if len(tested(runs, [family])):
            lines += [f"**{title}**\n", *table_of(runs, family), "", *without(family)]
    tried = "{" + ", ".join(f"{gain:g}" for gain in GAINS) + "}"
    views = "{" + ", ".join(f"{gain:g}" for gain in VIEW_GAINS) + "}"
    lines += [f"Chosen gains λ / α [1/s], of λ in {tried} and α in {views}:", *gains_of(runs)]
    return "\n".join(lines)


# --- Sentences ---


def share(own: Any) -> float:
    """Return the success of runs in per cent."""
    return float(100.0 * own["success"].mean())


def between(values: Sequence[float], unit: str, digits: int = 0) -> str:
    """Return the least and greatest value, ``20 to 80 %``, or the only one."""
    low, high = (f"{value:.{digits}f}" for value in (min(values), max(values)))
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def listed(texts: Sequence[str]) -> str:
    """Return texts as an enumeration, ``a, b and c``."""
    return " and ".join(filter(None, (", ".join(texts[:-1]), texts[-1])))


def with_groups(texts: Mapping[str, str]) -> str:
    """Return texts by group as an enumeration, ``80 % with the first and 90 % with the second``."""
    return listed([f"{text} with {group}" for group, text in texts.items()])


def groups_at(own: Any, limit: float) -> dict[str, str]:
    """Return the range of successes of each group's entries in held-out runs at a limit."""
    at_limit = own[own["limit"] == limit]
    texts = {}
    for group, names in groups_of(at_limit).items():
        cells = [at_limit[at_limit["controller"] == name] for name in names]
        rates = [share(cell) for cell in cells if len(cell)]
        if rates:
            texts[group] = between(rates, "%")
    return texts


def times_at(own: Any, limit: float) -> dict[str, str]:
    """Return the range of median settling times of each group's entries at a limit.

    Entries without a constraint on the image are left out.
    """
    at_limit = own[own["limit"] == limit]
    texts = {}
    for group, names in groups_of(at_limit).items():
        cells = [at_limit[at_limit["controller"] == name] for name in names]
        times = [settling(cell) for cell in cells if cell["success"].sum() >= SHORTEST_SAMPLE]
        if times and group != WITHOUT_IMAGE:
            texts[group] = between(times, "s", 1)
    return texts


def answer(runs: Any) -> str:
    """Return the answer of the page: for goals by each feature, at the least and highest limit."""
    sentences = []
    for feature, own in features(runs).items():
        limits = list(dict.fromkeys((own["limit"].min(), own["limit"].max())))
        times = []
        for limit in limits:
            sentences.append(
                f"With goals {feature}, on arms with {limit:g} rad/s², every marker stays in the "
                f"image and the goal is reached in these shares of the scenes, from the least to "
                f"the most successful entry: {with_groups(groups_at(own, limit))}."
            )
            own_times = times_at(own, limit)
            if own_times:
                times.append(f"with {limit:g} rad/s² {with_groups(own_times)}")
        if times:
            sentences.append(
                f"With goals {feature}, successes settle within these median times: "
                f"{'; '.join(times)}."
            )
    return "\n".join(f"{k}. {sentence}" for k, sentence in enumerate(sentences, 1))


def scenes_text(runs: Any) -> str:
    """Return what the kept runs are, and what of the comparison is not among them."""
    tests = runs[runs["half"] == "held-out"]
    campaign = Campaign.load(SUITE)
    counts, missing = [], []
    for family in campaign.families:
        title = TITLES[family.name]
        own = tests[tests["family"] == family.name]
        limits = {name: name.removeprefix("limit-") for name in campaign.conditions}
        there = [text for name, text in limits.items() if name in set(own["condition"])]
        if own.empty:
            missing.append(title)
            continue
        scenes = own.groupby("condition")["scene"].nunique().to_numpy(dtype=float)
        number = between(list(scenes), "held-out scenes")
        counts.append(f"{title}, at {listed(there)} rad/s²: {number} each")
        rest = [text for text in limits.values() if text not in there]
        if rest:
            missing.append(f"{title}, at {listed(rest)} rad/s²")
    absent = [
        f"`{each.name}`"
        for each in campaign.controllers
        if each.name != BASELINE and each.name not in set(tests["controller"])
    ]
    rest_text = f" Not run yet: {'; '.join(missing + absent)}." if missing + absent else ""
    return f"{len(runs)} runs. {'; '.join(counts)}.{rest_text}"


def headline(runs: Any) -> str:
    """Return the sentence of the README, on goals by pose if there are such runs."""
    feature, own = next(iter(features(runs).items()))
    slow = own["limit"].min()
    scenes = len(own[own["limit"] == slow][["family", "scene"]].drop_duplicates())
    families = [family for family in FEATURES[feature] if (own["family"] == family).any()]
    arms = [TITLES[family].partition(",")[0] for family in families]
    return (
        f"On {listed(arms)} arms that accelerate by at most {slow:g} rad/s², with goals {feature}, "
        f"tuned entries keep all markers in the image and reach the goal in these shares of "
        f"{scenes} drawn scenes: {with_groups(groups_at(own, slow))}."
    )


def parts(runs: Any) -> Iterator[tuple[Path, str, str]]:
    """Yield the parts that are made from the table: page, name of the marks around it, text."""
    yield PAGE, "answer", answer(runs)
    yield PAGE, "tables", tables(runs)
    yield README, "stacks", headline(runs)


def part_of(page: Path, name: str) -> tuple[str, str, str]:
    """Return the text of a page up to the marks of a part, between them and after them."""
    begin, end = MARKS[name]
    before, _, rest = page.read_text(encoding="utf-8").partition(begin)
    made, _, after = rest.partition(end)
    return before + begin, made, end + after


def write_page(runs: Any) -> None:
    """Write the figure, and the parts of the pages between their marks."""
    SHOWN.write(FIGURE, runs)
    for page, name, made in parts(runs):
        before, _, after = part_of(page, name)
        page.write_text(f"{before}\n\n{made}\n\n{after}", encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    parser = ArgumentParser(prog="python -m checks.stacks_page", description=__doc__)
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--of", type=Path, help="folder of the runs, of which the table is made")
    source.add_argument("--add", type=Path, help="folder of runs that join those of the table")
    asked = parser.parse_args(arguments)
    folder = asked.of or asked.add
    if folder is not None:
        try:
            print(*keep(folder, add=asked.add is not None), sep="\n")
        except VsconstraintsError as error:
            parser.exit(2, f"{error}\n")
    write_page(load())
    return 0


if __name__ == "__main__":
    sys.exit(main())
