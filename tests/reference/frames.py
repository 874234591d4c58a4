"""Comparing frames that different programs drew of the same scene."""

import numpy as np


def differing(one, two) -> float:
    """Share of the pixels of two rgb frames that differ.

    Compilers round differently, so a pixel whose centre lies on an edge (of a floor tile, say,
    for an eye that looks along an axis) may fall on either side of it.
    """
    return float((np.asarray(one) != np.asarray(two)).any(axis=-1).mean())
