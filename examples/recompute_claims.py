"""Recompute every number of a campaign's claims.json from its Parquet files: python
recompute_claims.py FOLDER.
"""

import json
import sys
from itertools import permutations
from math import comb
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.special import expit
from scipy.stats import binom, norm, quantile_test, t
from statsmodels.stats.proportion import proportion_confint

folder = Path(sys.argv[1])
runs = pd.read_parquet(folder / "runs")
runs["violation"] = runs["violated"] != ""
runs["success"] = ~runs["violation"] & (runs["status"] == "converged")
runs["tolerant success"] = (runs["violation_fraction"] <= 0.01) & (runs["status"] == "converged")
names = ["family", "condition", "controller", "status"]
runs[names] = runs[names].astype(str)


def by_scene(column, condition, families=None):
    """One line per scene that every law ran, one column per law."""
    own = runs[(runs["condition"] == condition) & (runs["controller"] != "tracking")]
    own = own[own["family"].isin(families)] if families else own
    ran = (
        own.pivot(index=["family", "scene"], columns="controller", values="success")
        .notna()
        .all(axis=1)
    )
    return own.pivot(index=["family", "scene"], columns="controller", values=column)[ran]


def share(flags):
    flags = flags.astype(bool)
    return flags.mean(), *proportion_confint(flags.sum(), len(flags), method="beta")


def lowest(x, y, n, pairs):
    """The low end of Tango's interval of (x − y)/n, corrected for continuity, for one of so many
    pairs.
    """

    def beyond(d):
        linear = (2 * n - x + y) * d - x - y
        p = (np.sqrt(max(linear**2 + 8 * n * y * d * (1 - d), 0)) - linear) / (4 * n)
        return (
            x - y - 1 - n * d - norm.isf(0.025 / pairs) * np.sqrt(max(n * (2 * p + d * (1 - d)), 0))
        )

    return brentq(beyond, -1, (x - y - 1) / n - 1e-12, xtol=1e-14) if x - y - 1 > -n else -1.0


def difference(success, a, b):
    a = success[a].astype(bool)
    b = success[b].astype(bool)
    x = (a & ~b).sum()
    y = (b & ~a).sum()
    n = len(a)
    pairs = comb(success.shape[1], 2)
    return (x - y) / n, lowest(x, y, n, pairs), -lowest(y, x, n, pairs)


def distinguishable(success):
    """Pairs of distinguishable laws, the better one first."""
    if len(success) < 6:
        return set()
    return {(a, b) for a, b in permutations(success, 2) if difference(success, a, b)[1] > 0}


def in_a_further_family(flags):
    """Mixed logistic regression with families as random effects: the mean rate, and the ends of its
    profile.
    """
    counts, scenes = (
        flags.astype(int).groupby("family").agg(["sum", "size"]).to_numpy().T[..., None, None]
    )
    z = np.linspace(-8, 8, 801)
    means = np.linspace(-9, 9, 361)
    mean_rates = []
    likelihoods = []
    for spread in np.geomspace(0.04, 6, 30):
        rates = expit(means[:, None] * np.sqrt(1 + spread**2 / 3) + spread * z)
        weights = norm.pdf(z) * (z[1] - z[0])
        mean_rates.append(rates @ weights)
        likelihoods.append(np.log(binom.pmf(counts, scenes, rates) @ weights).sum(axis=0))
    rate = np.array(mean_rates)
    likelihood = np.array(likelihoods)
    near = rate[likelihood >= likelihood.max() - t.ppf(0.975, len(counts) - 1) ** 2 / 2]
    return rate.flat[likelihood.argmax()], near.min(), near.max()


def recompute(claim):
    """The numbers of a sentence."""
    about = claim["about"]
    condition = claim["condition"]
    laws = claim["laws"]
    if about == "nowhere":
        return {"runs": (runs["controller"] == laws[0]).sum()}
    if about == "attainable":
        own = runs[(runs["condition"] == condition) & (runs["controller"] == "tracking")]
        return dict(
            zip(("reached", "low", "high"), share(own["status"] == "converged"), strict=True)
        ) | {"scenes": len(own)}
    if about == "holds":  # each by itself: python -m checks.conclusions FOLDER
        own = [one["outcome"] for one in claims["conclusions"] if one["condition"] == condition]
        both = [
            runs[(runs["condition"] == name) & (runs["controller"] != "tracking")]
            for name in ("nominal", condition)
        ]
        scenes = both[1][both[1]["family"].isin(both[0]["family"])][
            ["family", "scene"]
        ].drop_duplicates()
        found = {
            "conclusions": len(own),
            "scenes": len(scenes),
            "families": scenes["family"].nunique(),
        }
        found |= {name: own.count(name) for name in ("holds", "reversed", "inconclusive")}
        every = [one for one in claims["conclusions"] if one["condition"] == condition]
        found["reversal_excluded"] = sum(
            one["reversal_excluded"] for one in every if one["outcome"] == "inconclusive"
        )
        power = [
            one
            for one in claims["power"]
            if (one["condition"], one["measure"]) == (condition, "success")
        ]
        return found | ({"detectable": power[0]["detectable"]} if power else {})
    success = by_scene(
        "tolerant success" if claim["standard"] == "tolerant" else "success", condition
    )
    found = {"scenes": len(success), "families": success.index.get_level_values(0).nunique()}
    if about == "across":
        each = success.astype(int).groupby("family").mean()
        sums = each.sum() - each
        stays = (sums[laws[0]] >= sums.max(axis=1) - 1e-9).sum()
        ends = dict(
            zip(("success", "low", "high"), in_a_further_family(success[laws[0]]), strict=True)
        )
        return {f"{name}[{laws[0]}]": value for name, value in ends.items()} | {
            "families": len(each),
            "stays": stays,
        }
    if about == "turned":
        first = runs["condition"].iloc[0] if "nominal" not in set(runs["condition"]) else "nominal"
        both = [set(runs.loc[runs["condition"] == name, "family"]) for name in (first, condition)]
        before, after = (
            by_scene("success", name, both[0] & both[1]) for name in (first, condition)
        )
        for name, flags, (a, b) in ((first, before, laws), (condition, after, laws[::-1])):
            ends = difference(flags, a, b)
            found |= {
                f"{key}[{name}]": value
                for key, value in zip(("difference", "low", "high"), ends, strict=True)
            }
        turned = {(a, b) for a, b in distinguishable(before) if (b, a) in distinguishable(after)}
        return found | {
            "pairs": len(turned),
            "scenes": len(before),
            "families": len(both[0] & both[1]),
        }
    if about == "tuned":
        for law in laws:
            ends = difference(success, f"{law}-tuned", law)
            found |= {
                f"{key}[{law}]": value
                for key, value in zip(("difference", "low", "high"), ends, strict=True)
            }
    elif about == "calmest":
        every = by_scene("acceleration_variation", condition)[success[laws].all(axis=1)].astype(
            float
        )
        ratios = every[laws[0]] / every[laws[1]]
        logs = np.log(ratios[ratios != 1])
        ends = quantile_test(logs, q=0, p=0.5).confidence_interval(1 - 0.05 / comb(len(laws), 2))
        found = dict(
            zip(("ratio", "ratio_low", "ratio_high"), np.exp([logs.median(), *ends]), strict=True)
        )
        return found | {"ratio_scenes": len(ratios)}
    else:
        what = "violation" if about == "violations" else "success"
        flags = by_scene(what, condition) if about == "violations" else success
        for law in laws:
            ends = share(flags[law])
            found |= {
                f"{key}[{law}]": value
                for key, value in zip((what, "low", "high"), ends, strict=True)
            }
        a, b = (laws[0], laws[-1]) if about in ("best", "tolerant") else (laws[-1], laws[0])
        ends = difference(success, a, b)
        found |= dict(zip(("difference", "difference_low", "difference_high"), ends, strict=True))
    return found


claims = json.loads((folder / "claims.json").read_text())
for claim in claims["sentences"]:
    found = recompute(claim)
    print(claim["text"])
    for name, value in claim["numbers"].items():
        print(f"    {name}: {value:.6g}, recomputed: {found[name]:.6g}")
        # those of families as random effects are found on a grid
        assert np.isclose(value, found[name], atol=0.02 if claim["about"] == "across" else 1e-9)

for line in claims["table"]:
    own = runs[runs["controller"] == line["law"]]
    clean = own[(own["condition"] == "nominal") & own["success"]]
    found = {
        "call": own["step_time_median_us"].median(),
        "variation": clean["acceleration_variation"].median(),
    }
    found |= {name: by_scene("success", name)[line["law"]].mean() for name in set(own["condition"])}
    for name in set(line) - {"law"}:
        assert line[name] is None or np.isclose(line[name], found[name]), (line["law"], name)

for line in claims["answers"]:
    success = by_scene("success", line["condition"])
    assert np.isclose(success[line["law"]].mean(), success.mean().max())
    for name in {"second", "median", "worst"} & set(line):
        ends = difference(success, line["law"], line[name])
        assert np.allclose(
            ends, [line[f"{key}[{name}]"] for key in ("loss", "low", "high")], atol=1e-9
        ), (line, name)

for line in claims["situations"]:
    flags = by_scene("success", line["condition"], [line["family"]])[line["law"]]
    assert np.allclose(share(flags), [line[key] for key in ("success", "low", "high")])
    own = runs[
        (
            runs[["family", "condition", "controller"]]
            == [line["family"], line["condition"], line["law"]]
        ).all(axis=1)
    ]
    assert line["endings"]["success"] == own["success"].sum()
    assert line["endings"]["violated"] == own["violation"].sum()
    assert sum(line["endings"].values()) == len(own)
