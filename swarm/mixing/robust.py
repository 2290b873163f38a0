"""Mixing that a poisoner cannot drag away, by option.

A neighbour adds ``W_ij (theta_j - theta_i)`` to the mean.  ``clip`` bounds the length of each such
difference (self-centred clipping, He, Karimireddy & Jaggi 2022); ``trimmed-mean`` drops, in each
coordinate, the largest and the smallest of the differences, one's own zero included (Yin et al.
2018), and needs more neighbours than it trims.  Both cost honest swarms some speed of agreement.
"""

from collections.abc import Mapping
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.floating]


class Robust(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How far to trust neighbours.

    Attributes:
        kind: ``none`` takes what they say.
        radius: of ``clip``: longest difference that counts in full, Euclidean.
        trim: of ``trimmed-mean``: how many poisoners to stand, dropped at either end.
    """

    kind: Literal["none", "clip", "trimmed-mean"] = "none"
    radius: Annotated[float, msgspec.Meta(gt=0)] = 1.0
    trim: Annotated[int, msgspec.Meta(ge=1)] = 1


def shares(
    robust: Robust, differences: Mapping[str, Vector], weights: Mapping[str, float]
) -> dict[str, Vector]:
    """What each neighbour adds to the mean, in the order of ``differences``.

    Args:
        robust: how far to trust.
        differences: (d,) ``theta_j - theta_i`` by neighbour.
        weights: W_ij by neighbour.
    """
    if not differences:
        return {}
    kind = next(iter(differences.values())).dtype.type
    match robust.kind:
        case "none":
            return {n: kind(weights[n]) * delta for n, delta in differences.items()}
        case "clip":
            return {
                n: kind(weights[n] * _shrink(delta, robust.radius)) * delta
                for n, delta in differences.items()
            }
        case "trimmed-mean":
            total = sum(weights[n] for n in differences)
            kept, count = _trim(np.stack(list(differences.values())), robust.trim)
            factor = kind(total / count)
            return {n: factor * delta for n, delta in zip(differences, kept, strict=True)}


def _shrink(delta: Vector, radius: float) -> float:
    length = float(np.linalg.norm(delta))
    return 1.0 if length <= radius else radius / length


def _trim(deltas: Vector, trim: int) -> tuple[Vector, int]:
    """``deltas`` (n, d) with what is trimmed set to 0, and how many values a mean has left."""
    stacked = np.vstack([np.zeros((1, deltas.shape[1]), deltas.dtype), deltas])
    trim = min(trim, (len(stacked) - 1) // 2)
    rank = stacked.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable")
    keep = (rank >= trim) & (rank < len(stacked) - trim)
    return np.where(keep[1:], deltas, deltas.dtype.type(0)), len(stacked) - 2 * trim
