"""Observations of any kind as pictures."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..maps.symbols import LABEL_COLOURS

# Depth in tiles at which a depth image is at half brightness.
HALF_DEPTH = 1.3


def image_of(obs: Any) -> Any:
    """The image of an observation: the one of a `dict`, or the observation itself."""
    return obs["image"] if isinstance(obs, dict) else obs


def picture(image: np.ndarray, kind: str) -> np.ndarray:
    """An image observation as uint8[..., H, W, 3].

    Args:
        image: images of any number, with their leading axes.
        kind: the environment's `observation`. Depth becomes brightness, near is bright; labels
            become the colours that the maps give them.
    """
    if kind in ("rgb", "dict"):
        return image
    if kind == "labels":
        return np.asarray(LABEL_COLOURS, np.uint8)[image]
    if kind == "depth":
        image = np.round(255 * HALF_DEPTH / (HALF_DEPTH + image)).astype(np.uint8)
    return np.repeat(image[..., None], 3, axis=-1)
