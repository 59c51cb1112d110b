"""What a plan of accelerations makes of rows and task, to first order: loops that run as they are, or compiled.

A plan has H blocks for n joints; Q and V (N, H) say how q and q̇ at N instants change with it. Results are written to
the last arguments.
"""

from __future__ import annotations

import math
from typing import Any


def linearise(phi: Any, sigma: Any, Lg: Any, K: Any, now: Any, value: Any, gradient: Any) -> None:
    """Value (N, m) and gradient (N, m, n) of rows: φ by q̇ where K is 0, elsewhere σ by q, from predicted rows.

    Predicted values differ from those of ``now`` (m,) by what is taken to stay so.
    """
    N, m, n = Lg.shape
    for i in range(m):
        wrong = now[i] - (phi[0, i] if K[i] == 0.0 else sigma[0, i])
        by = 1.0 if K[i] == 0.0 else 1.0 / K[i]
        for t in range(N):
            value[t, i] = (phi[t, i] if K[i] == 0.0 else sigma[t, i]) + wrong
            for j in range(n):
                gradient[t, i, j] = by * Lg[t, i, j]


def exceed(value: Any, gradient: Any, K: Any, q: Any, qd: Any, falls: Any, left: Any, over: Any) -> None:
    """By how much rows of :func:`linearise` exceed what falls with them: σ(τ + Δτ) − fall σ(τ) − left, (N − 1, m).

    ``q`` and ``qd`` (N, n) are how far q and q̇ are from those that the values are of; ``falls`` is (N − 1,).
    """
    N, m, n = gradient.shape
    for i in range(m):
        before = 0.0
        for t in range(N):
            after = value[t, i]
            for j in range(n):
                after += gradient[t, i, j] * (qd[t, j] if K[i] == 0.0 else q[t, j])
            if t > 0:
                over[t - 1, i] = after - falls[t - 1] * before - left[t - 1, i]
            before = after


def differentiate(which: Any, gradient: Any, K: Any, Q: Any, V: Any, falls: Any, G: Any, largest: Any) -> None:
    """Gradients G (r, Hn) of r entries of :func:`exceed` by the plan, and the largest entries of each (r,)."""
    m, n = gradient.shape[1:]
    for r in range(len(which)):
        t, i = which[r] // m, which[r] % m
        largest[r] = 0.0
        for k in range(Q.shape[1]):
            after = V[t + 1, k] if K[i] == 0.0 else Q[t + 1, k]
            before = falls[t] * (V[t, k] if K[i] == 0.0 else Q[t, k])
            for j in range(n):
                entry = after * gradient[t + 1, i, j] - before * gradient[t, i, j]
                G[r, k * n + j] = entry
                # not a number is larger than all, and stays so
                if not (abs(entry) <= largest[r] or math.isnan(largest[r])):
                    largest[r] = abs(entry)


def normal_equations(C: Any, J: Any, b: Any, own: Any, square: Any, P: Any, q: Any) -> None:
    """P (Hn, Hn), its upper triangle in blocks, and q (Hn,) of ½uᵀPu − qᵀu = ½Σ‖J (C u − own) − b‖², but a constant.

    C (B, H) is what the plan does to each of B accelerations, ``own`` (B, n) what C u is of the plan that J (B, k, n)
    and b (B, k) are of; ``square`` (n, n) is scratch, P and q are zeros at first.
    """
    B, k, n = J.shape
    for a in range(B):
        for i in range(n):
            for j in range(n):
                square[i, j] = 0.0
                for r in range(k):
                    square[i, j] += J[a, r, i] * J[a, r, j]
        for g in range(C.shape[1]):
            for i in range(n):
                for r in range(k):
                    q[g * n + i] += C[a, g] * J[a, r, i] * b[a, r]
                for j in range(n):
                    q[g * n + i] += C[a, g] * square[i, j] * own[a, j]
            for h in range(g, C.shape[1]):
                both = C[a, g] * C[a, h]
                if both != 0.0:
                    for i in range(n):
                        for j in range(n):
                            P[g * n + i, h * n + j] += both * square[i, j]
