"""How far two valleys are apart, and where they cross."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import eigh


@dataclass(frozen=True, eq=False)
class Approach:
    """The closest approach of two lines.

    distance : sqrt((a - b)^T C^-1 (a - b)), in units of the covariance C
    first, second : a and b (k,), the points where it is met
    crossing : (k,) where the lines cross, or None; only lines in a plane can
    """

    distance: float
    first: Array
    second: Array
    crossing: Array | None


def closest_approach(first: Array, second: Array, covariance: Array) -> Approach:
    """The least distance of the polylines ``first`` (M, k) and ``second`` (P, k), each of one point at least.

    It is exact for the polylines: every piece of one against every piece of the other (C. Ericson, Real-Time Collision
    Detection, 2005, 5.1.9). Directions that the covariance (k, k) leaves without spread count as infinitely far.
    """
    values, axes = eigh(0.5 * (covariance + covariance.T))
    spread = np.sqrt(np.maximum(values, 1e-30 * max(float(np.max(values)), 1e-300)))
    white = axes / spread
    a, b = first @ white, second @ white
    s, t, distance, i, j = _nearest(*_pieces(a), *_pieces(b))
    one, two = _on(first, i, s), _on(second, j, t)
    cross = first.shape[1] == 2 and distance < 1e-9 * (1 + float(np.linalg.norm(one @ white)))
    return Approach(0.0 if cross else distance, one, two, one if cross else None)


def _pieces(line: Array) -> tuple[Array, Array]:
    """Starts (M, k) and directions (M, k) of the pieces; one piece of length zero for a single point."""
    if len(line) == 1:
        return line, np.zeros_like(line)
    return line[:-1], np.diff(line, axis=0)


def _on(line: Array, i: int, s: float) -> Array:
    return np.asarray(line[i] if len(line) == 1 else line[i] + s * (line[i + 1] - line[i]))


def _nearest(p: Array, u: Array, q: Array, v: Array) -> tuple[float, float, float, int, int]:
    """(s, t, distance, i, j): the nearest points p_i + s u_i and q_j + t v_j with s, t in [0, 1]."""
    w = p[:, None, :] - q[None, :, :]
    a, e = np.sum(u * u, axis=1)[:, None], np.sum(v * v, axis=1)[None, :]
    b = u @ v.T
    c, f = np.einsum("ik,ijk->ij", u, w), np.einsum("jk,ijk->ij", v, w)
    with np.errstate(all="ignore"):
        denominator = a * e - b * b
        s = np.where(denominator > 1e-14 * a * e, np.clip((b * f - c * e) / denominator, 0, 1), 0.0)
        s = np.where((e == 0) & (a > 0), np.clip(-c / a, 0, 1), s)
        t = np.where(e > 0, (b * s + f) / e, 0.0)
        bounded = np.clip(t, 0, 1)
        s = np.where(t != bounded, np.where(a > 0, np.clip((bounded * b - c) / a, 0, 1), 0.0), s)
    gap = w + s[:, :, None] * u[:, None, :] - bounded[:, :, None] * v[None, :, :]
    distance = np.linalg.norm(gap, axis=2)
    i, j = np.unravel_index(int(np.argmin(distance)), distance.shape)
    return float(s[i, j]), float(bounded[i, j]), float(distance[i, j]), int(i), int(j)


def arc_length(points: Array) -> Array:
    """(M,) length of the polyline ``points`` (M, k) from its start."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
