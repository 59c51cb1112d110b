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
from vsconstraints.reports.markdown import enumeration
from vsconstraints.reports.plots import WIDTH, Figure, Sheet, logarithmic
from vsconstraints.reports.plots.style import COLOURS, Look, mark_of

TABLE = SUITE.with_suffix(".parquet")  #: The kept runs.
README = SUITE.parents[1] / "README.md"
PAGE = SUITE.parents[1] / "docs" / "stacks-in-view.md"
#: File of the figure of each feature, beside the page.
FIGURES: Mapping[str, str] = {
    "by pose": "stacks-in-view.png",
    "by image points": "stacks-in-view-points.png",
}
#: Marks in the page around the parts that are made from the table.
MARKS = {
    name: (f"<!-- {name}: begin -->", f"<!-- {name}: end -->")
    for name in ("answer", "figures", "tables", "stacks")
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
        "oink-limited": "grey p --",
        "tsid": "grey > :",
        "visp": "grey X :",
        "machinevision-toolbox": "grey D :",
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
FURTHER_STYLES = ("vermillion s -", "brown h -", "teal * --", "black h --")
#: What entries with a constraint on the image command; of velocities, also if the limit of
#: accelerations is known. In the words of the answer.
GROUPS: Mapping[str, Sequence[str]] = {
    "velocities (limit unknown)": (
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
    "velocities (limit known)": (
        "pink-limited",
        "velocity-qp-limited",
        "velocity-hierarchical-qp-limited",
    ),
    "accelerations": ("hierarchical-qp", "sliding-mode", "predictive"),
}
WITHOUT_IMAGE = "no constraint on the image"
BLIND = ("resolved-rate", "oink", "oink-limited", "tsid", "visp", "machinevision-toolbox")
FURTHER = "further entries"
NO_BREAK = "\N{NO-BREAK SPACE}"  #: Before units in narrow cells.
FAR_OUTSIDE = 1000  #: Distance outside the image beyond which no number is written [px].
SHORTEST_SAMPLE = 3  #: Successes below which no settling time is drawn.
HEIGHT, WIDEST = 1.45, 3.6  #: Of a panel, and its greatest width [in].
GAP, ABOVE, BESIDE = 0.14, 0.3, 0.16  #: Between the panels of an arm, above them, beside one [in].
#: How to read the figure.
READING = (
    "grey: no constraint on the image · dashed: “-limited”, the limit is known\n"
    "bars: 95 % intervals · times: median of three or more successes"
)
LEGEND_LINE = 0.148  #: Height of an entry in a legend [in].
APART = 1.03  #: Ratio of the limits at which entries beside each other are drawn.


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
    """Return the entries of each group in the answer; those without a group are the last one."""
    return {**GROUPS, WITHOUT_IMAGE: BLIND, FURTHER: further(runs)}


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


def draw(own: Any) -> Sheet:
    """Draw success and settling time over the limit of accelerations, for the arms of a feature.

    ``own`` are the runs in held-out scenes by that feature. Each column of panels has entries of
    one kind, with a legend above.
    """
    sheet = Sheet(left=0.52, right=0.1)
    limits = sorted(own["limit"].unique())
    cells = [cell for _, cell in own.groupby(["family", "controller", "limit"])]
    times = times_of(cells)
    longest = 1.1 * max(times, default=TIME_LIMIT)
    columns = shown_panels(own)
    room = WIDTH - sheet.left - sheet.right - BESIDE * (len(columns) - 1)
    width = min(room / len(columns), WIDEST)
    lefts = [sheet.left + k * (width + BESIDE) for k in range(len(columns))]
    most_entries = max(len(styles) for styles in columns.values())
    for left, (title, styles) in zip(lefts, columns.items(), strict=True):
        sheet.text(left, 0.2, title, fontsize=9.0, fontweight="bold", va="center")
        shown = [{"label": name, **style} for name, style in styles.items()]
        sheet.legend(shown, 1, (left, 0.34), labelspacing=0.3)
    for legend in sheet.figure.legends:
        for text in legend.get_texts():
            text.set_fontsize(8.0)
    sheet.bottom = 0.34 + LEGEND_LINE * most_entries
    arms = list(dict.fromkeys(own["family"]))
    for family in [name for name in TITLES if name in arms]:
        top = sheet.bottom + ABOVE
        arm = TITLES[family].partition(",")[0]
        for left, styles in zip(lefts, columns.values(), strict=True):
            upper = sheet.axes(left, top, width, HEIGHT)
            lower = sheet.axes(left, top + HEIGHT + GAP, width, HEIGHT)
            upper.set(ylim=(-4.0, 104.0))
            lower.set(ylim=(0.0, longest))
            _curves(upper, lower, own[own["family"] == family], styles, limits)
            upper.tick_params(labelbottom=False, labelleft=left == lefts[0])
            lower.tick_params(labelleft=left == lefts[0])
            if left == lefts[0]:
                upper.set_ylabel(f"{arm}: success [%]")
                lower.set_ylabel(f"{arm}: settling time [s]")
    middle = 0.5 * (lefts[0] + lefts[-1] + width)
    axis = sheet.bottom + 0.34
    sheet.text(middle, axis, "acceleration limit of the arm [rad/s²]", fontsize=8.5, ha="center")
    if len(columns) > 1:  # below one panel there is no room for the sentence
        sheet.text(middle, axis + 0.1, READING, fontsize=8.0, ha="center", va="top")
    sheet.bottom = axis + 0.42
    return sheet


def shown_panels(own: Any) -> dict[str, dict[str, dict[str, Any]]]:
    """Return the style of lines of the entries that have runs, by panel that has any."""
    there = set(own["controller"])
    shown: dict[str, dict[str, dict[str, Any]]] = {}
    for title, styles in panels(own).items():
        for name, text in styles.items():
            if name in there:
                colour, marker, dash = text.split()
                mark = mark_of(Look(COLOURS[colour], marker, dash)) | {"markersize": 4.5}
                style = {"color": COLOURS[colour], "linestyle": dash, "linewidth": 1.3, **mark}
                shown.setdefault(title, {})[name] = style
    return shown


def _curves(
    upper: Any,
    lower: Any,
    own: Any,
    styles: Mapping[str, Mapping[str, Any]],
    limits: Sequence[float],
) -> None:
    """Draw the success of entries with intervals above, and their settling time below."""
    for k, (name, style) in enumerate(styles.items()):
        mine = own[own["controller"] == name]
        there = sorted(mine["limit"].unique())
        cells = [mine[mine["limit"] == limit] for limit in there]
        x = np.array(there) * APART ** (k - 0.5 * (len(styles) - 1))
        rates = [rate(cell["success"].to_numpy(dtype=bool)) for cell in cells]
        shares = 100.0 * np.array([each.share for each in rates])
        low = 100.0 * np.array([each.low for each in rates])
        high = 100.0 * np.array([each.high for each in rates])
        upper.vlines(x, low, high, color=style["color"], linewidth=0.8, alpha=0.5)
        upper.plot(x, shares, **style)
        enough = [cell["success"].sum() >= SHORTEST_SAMPLE for cell in cells]
        median = np.array([settling(cell) for cell in cells])
        lower.plot(x, np.where(enough, median, np.nan), **style)
    for ax in (upper, lower):
        logarithmic(ax.xaxis, limits)
        ax.set_xlim(limits[0] / 1.3, limits[-1] * 1.3)


# --- Tables ---


def cell_of(own: Any) -> str:
    """Return successes of scenes, their settling time and interval, ``7/8, 2.1 s<br>47–100 %``."""
    if own.empty:
        return "–"
    success = rate(own["success"].to_numpy(dtype=bool))
    time = settling(own)
    count = f"{success.count}/{success.of}"
    if not np.isnan(time):
        count += f", {time:.1f} s"
    text = f"{count}<br>{100.0 * success.low:.0f}–{100.0 * success.high:.0f} %"
    return text.replace(" ", NO_BREAK)


def table_of(runs: Any, family: str) -> Iterator[str]:
    """Yield the lines of a family's table: successes and settling times by limit."""
    own = tested(runs, [family])
    limits = sorted(own["limit"].unique())
    heads = [f"{limit:g} rad/s²" for limit in limits]
    yield f"| entry | {' | '.join(heads)} | worst margin [px] |"
    yield f"|---|{'---:|' * (len(limits) + 1)}"
    for entry in entries(own):
        mine = own[own["controller"] == entry]
        cells = [cell_of(mine[mine["limit"] == limit]) for limit in limits]
        worst = margin_text(float(mine["margin_px"].min()))
        yield f"| `{entry}` | {' | '.join(cells)} | {worst} |"


def unanswered(runs: Any, family: str) -> str:
    """Return the shares of periods without an answer of the entries in a family's table."""
    own = tested(runs, [family])
    shares = []
    for entry in entries(own):
        silent = 100.0 * own[own["controller"] == entry]["unanswered"].mean()
        if silent > 0.0:
            text = "less than 0.1" if silent < 0.1 else f"{silent:.1f}"
            shares.append(f"`{entry}` {text} %")
    if not shares:
        return "No period was without an answer."
    return f"Periods without an answer: {enumeration(shares)}; none of the others."


def margin_text(margin: float) -> str:
    """Return a margin [px] in whole pixels.

    Beyond ``FAR_OUTSIDE`` its size says nothing: the marker comes near the plane of the camera.
    """
    if margin < -FAR_OUTSIDE:
        return f"< −{FAR_OUTSIDE}"
    return f"{margin:.0f}".replace("-", "−")


def without(family: str) -> Iterator[str]:
    """Yield the sentence that names the entries that cannot servo by the feature of a family."""
    names = [
        f"`{each.name}`"
        for each in Campaign.load(SUITE).controllers
        if each.name != BASELINE and not applies(each, feature_of(family))
    ]
    feature = {"camera-pose": "the pose", "image-points": "image points"}[feature_of(family)]
    if names:
        yield f"Without a task by {feature}, and therefore not in this table: {enumeration(names)}."


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
            lines += [f"**{title}**\n", *table_of(runs, family), ""]
            lines += [" ".join([unanswered(runs, family), *without(family)]), ""]
    tried = "{" + ", ".join(f"{gain:g}" for gain in GAINS) + "}"
    views = "{" + ", ".join(f"{gain:g}" for gain in VIEW_GAINS) + "}"
    lines += [f"Chosen gains λ / α [1/s], of λ in {tried} and α in {views}:", *gains_of(runs)]
    return "\n".join(lines)


def figures(runs: Any) -> str:
    """Return the figures of the page, one for each feature that has runs."""
    shown = [
        f"![Success and settling time {feature} over the arm's limit of accelerations]({file})"
        for feature, file in FIGURES.items()
        if feature in features(runs)
    ]
    return "\n\n".join(shown)


# --- Sentences ---


def share(own: Any) -> float:
    """Return the success of runs in per cent."""
    return float(100.0 * own["success"].mean())


def between(values: Sequence[float], unit: str, digits: int = 0) -> str:
    """Return the least and greatest value, ``20 to 80 %``, or the only one."""
    low, high = (f"{value:.{digits}f}" for value in (min(values), max(values)))
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def extreme_limits(own: Any) -> list[float]:
    """Return the least and the greatest limit [rad/s²] that all arms have; one if they are equal.

    Arms without a common limit give those of any.
    """
    by_arm = [set(arm["limit"]) for _, arm in own.groupby("family")]
    limits = set.intersection(*by_arm) or set.union(*by_arm)
    return list(dict.fromkeys((min(limits), max(limits))))


def cells_of(own: Any, names: Sequence[str], limit: float) -> list[Any]:
    """Return the runs of each of these entries at a limit, of those that have any."""
    at_limit = own[own["limit"] == limit]
    return [cell for name, cell in at_limit.groupby("controller", sort=False) if name in names]


def times_of(cells: Sequence[Any]) -> list[float]:
    """Return the median settling times of entries with enough successes [s]."""
    return [settling(cell) for cell in cells if cell["success"].sum() >= SHORTEST_SAMPLE]


def success_sentence(feature: str, own: Any) -> str:
    """Return the success of the median entry of each group, at the least and greatest limit."""
    limits = extreme_limits(own)
    texts = []
    for group, names in groups_of(own).items():
        shares = []
        for limit in limits:
            cells = cells_of(own, names, limit)
            middle = f"{np.median([share(cell) for cell in cells]):.0f}" if cells else "–"
            shares.append(middle)
        entries_text = group
        if group == FURTHER:
            entries_text += f" ({enumeration([f'`{name}`' for name in names])})"
        if any(text != "–" for text in shares):
            texts.append(f"{enumeration(shares)} % with {entries_text}")
    families = [family for family in FEATURES[feature] if (own["family"] == family).any()]
    arms = enumeration([TITLES[family].partition(",")[0] for family in families])
    both = enumeration([f"{limit:g}" for limit in limits])
    return (
        f"**{feature.capitalize()}**, on {arms} arms, the median entry succeeds in these shares of "
        f"the scenes at {both} rad/s²: {'; '.join(texts)}."
    )


def times_sentence(own_by_feature: Mapping[str, Any]) -> str:
    """Return the ranges of settling times for each feature; empty without any."""
    texts = []
    for feature, own in own_by_feature.items():
        ranges = {}
        for limit in extreme_limits(own):
            times = times_of(cells_of(own, entries(own), limit))
            if times:
                ranges[f"{limit:g}"] = between(times, "s", 1)
        if ranges:
            texts.append(
                f"{enumeration([*ranges.values()])} {feature} ({enumeration([*ranges])} rad/s²)"
            )
    if not texts:
        return ""
    return (
        f"Successes settle after median times of {', and '.join(texts)}; slower gains "
        "can raise success, so read success and time together."
    )


def ranges_of(runs: Any) -> Iterator[str]:
    """Yield the lines of the table of groups: ranges of the success and time of their entries."""
    columns = [
        (feature, own, limit)
        for feature, own in features(runs).items()
        for limit in extreme_limits(own)
    ]
    heads = [f"{feature}, {limit:g} rad/s²" for feature, _, limit in columns]
    yield f"| entries | {' | '.join(heads)} |"
    yield f"|---|{'---:|' * len(columns)}"
    there = entries(tested(runs, [*TITLES]))
    for group, names in groups_of(runs).items():
        cells = [range_text(cells_of(own, names, limit)) for _, own, limit in columns]
        members = [f"`{name}`" for name in there if name in names]
        if members:
            yield f"| {group}: {', '.join(members)} | {' | '.join(cells)} |"


def range_text(cells: Sequence[Any]) -> str:
    """Return the ranges of success and settling times, ``42–72 %<br>4.2–8.1 s``."""
    if not cells:
        return "–"
    times = times_of(cells)
    lines = [between([share(cell) for cell in cells], "%")]
    if times:
        lines.append(between(times, "s", 1))
    return "<br>".join(lines).replace(" to ", "–").replace(" ", NO_BREAK)


def answer(runs: Any) -> str:
    """Return the answer of the page: success by each feature, settling times, and the ranges."""
    own_by_feature = features(runs)
    sentences = [success_sentence(feature, own) for feature, own in own_by_feature.items()]
    sentences.append(times_sentence(own_by_feature))
    numbered = [f"{k}. {sentence}" for k, sentence in enumerate(filter(None, sentences), 1)]
    return "\n".join([*numbered, "", *ranges_of(runs)])


def scenes_text(runs: Any) -> str:
    """Return what the kept runs are, and what of the comparison is not among them."""
    tests = runs[runs["half"] == "held-out"]
    campaign = Campaign.load(SUITE)
    made, missing = [], []
    for family in campaign.families:
        title = TITLES[family.name]
        own = tests[tests["family"] == family.name]
        limits = {name: name.removeprefix("limit-") for name in campaign.conditions}
        there = [text for name, text in limits.items() if name in set(own["condition"])]
        if own.empty:
            missing.append(title)
            continue
        made.append(f"{title}, at {enumeration(there)} rad/s²")
        rest = [text for text in limits.values() if text not in there]
        if rest:
            missing.append(f"{title}, at {enumeration(rest)} rad/s²")
    absent = [
        f"`{each.name}`"
        for each in campaign.controllers
        if each.name != BASELINE and each.name not in set(tests["controller"])
    ]
    rest_text = f" Not run yet: {'; '.join(missing + absent)}." if missing + absent else ""
    groups = tests.groupby(["family", "condition"], observed=True)
    number = between(list(groups["scene"].nunique()), "held-out scenes")
    return f"{len(runs)} runs, with {number} in each of: {'; '.join(made)}.{rest_text}"


def headline(runs: Any) -> str:
    """Return the sentence of the README, on goals by pose if there are such runs."""
    feature, own = next(iter(features(runs).items()))
    return success_sentence(feature, own)


def parts(runs: Any) -> Iterator[tuple[Path, str, str]]:
    """Yield the parts that are made from the table: page, name of the marks around it, text."""
    yield PAGE, "answer", answer(runs)
    yield PAGE, "figures", figures(runs)
    yield PAGE, "tables", tables(runs)
    yield README, "stacks", headline(runs)


def part_of(page: Path, name: str) -> tuple[str, str, str]:
    """Return the text of a page up to the marks of a part, between them and after them."""
    begin, end = MARKS[name]
    before, _, rest = page.read_text(encoding="utf-8").partition(begin)
    made, _, after = rest.partition(end)
    return before + begin, made, end + after


def write_page(runs: Any) -> None:
    """Write the figures, and the parts of the pages between their marks."""
    for feature, own in features(runs).items():
        figure = Figure(feature, "success and settling time over the arm's agility", "", draw)
        figure.write(PAGE.with_name(FIGURES[feature]), own)
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
