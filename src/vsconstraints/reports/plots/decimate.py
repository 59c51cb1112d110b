"""Fewer points for long lines, without losing a peak."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...rows import Array

IndexArray = npt.NDArray[np.int64]


def edges(samples: int, bins: int) -> IndexArray:
    """Where each of up to ``bins`` runs of neighbouring samples begins."""
    return np.unique(np.linspace(0, samples, min(bins, samples), endpoint=False).astype(np.int64))


def extremes(t: Array, y: Array, bins: int) -> tuple[Array, Array, Array]:
    """Least and greatest value in each bin, and the bin's middle time.

    Parameters
    ----------
    t
        (N,) times.
    y
        (N, ...) values; those that are not numbers are left out.
    bins
        How many at most.

    Returns
    -------
    tuple
        (B,) times, (B, ...) least and (B, ...) greatest values; NaN where a bin has none.
    """
    starts = edges(len(t), bins)
    ends = np.append(starts[1:], len(t)) - 1
    middle = 0.5 * (t[starts] + t[ends])
    return middle, np.fmin.reduceat(y, starts, axis=0), np.fmax.reduceat(y, starts, axis=0)


def zigzag(t: Array, y: Array, bins: int) -> tuple[Array, Array]:
    """A line through the least and the greatest value of each bin, in the order in which they occur.

    The line itself if it is short enough.
    """
    if len(t) <= 4 * bins:
        return t, y
    starts = edges(len(t), bins)
    ends = np.append(starts[1:], len(t)) - 1
    # the bins as lines of a table; a short one ends with its last sample again, which is no first extreme
    table = np.minimum(starts[:, None] + np.arange((ends - starts).max() + 1), ends[:, None])
    values = y[table]
    some = np.isfinite(values).any(axis=1)
    least = np.where(np.isnan(values), np.inf, values).argmin(axis=1)
    greatest = np.where(np.isnan(values), -np.inf, values).argmax(axis=1)
    line = np.arange(len(starts))
    extreme = np.concatenate([table[line, k][some] for k in (least, greatest)])
    chosen = np.unique(np.concatenate([starts, ends, extreme]))
    return t[chosen], y[chosen]


def window_means(t: Array, y: Array, bins: int) -> tuple[Array, Array]:
    """(B,) middle time and (B, ...) mean of each bin; NaN where a bin has no number."""
    starts = edges(len(t), bins)
    ends = np.append(starts[1:], len(t)) - 1
    exist = np.isfinite(y)
    total = np.add.reduceat(np.where(exist, y, 0.0), starts, axis=0)
    count = np.add.reduceat(exist.astype(np.int64), starts, axis=0)
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return 0.5 * (t[starts] + t[ends]), mean
