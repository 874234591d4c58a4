"""The camera: image size and field of view, and the constants derived from them."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

# The vector width in 32-bit numbers for which CPU compilers generate code. The rest of a row is
# computed pixel by pixel; at 84 columns this costs half as much as everything else.
LANES = 8


@dataclasses.dataclass(frozen=True)
class Camera:
    """A pinhole camera that looks horizontally, and the heights of eye and walls.

    Attributes:
        height: image rows, in pixels.
        width: image columns, in pixels.
        field_of_view: horizontal angle of view in degrees, 30 to 120.
        extra: columns that are computed past the right edge of the image and then discarded.
        eye: height of the eye above the floor in tiles.
        wall: height of the walls in tiles.
        row_focal_share: None for square pixels. Otherwise, the vertical focal length at a field
            of view of 90 degrees, as a share of the image height: the image is that of a screen
            of fixed shape, resized to height x width.
        column: where rays pass a pixel, from 0 at its left edge to 1 at its right edge.
        row: the same from its upper edge to its lower edge.
        shift: how many columns farther to the right rays in the left half of the image pass.
        screen: rows and columns of a screen. Each pixel of the image shows the screen's pixel that
            contains its centre. None if each pixel shows what is at its own place.
    """

    height: int = 64
    width: int = 64
    field_of_view: float = 60.0
    extra: int = 0
    eye: float = 0.5
    wall: float = 1.0
    row_focal_share: float | None = None
    column: float = 0.5
    row: float = 0.5
    shift: float = 0
    screen: tuple[int, int] | None = None

    @property
    def half_plane(self) -> float:
        """Half the width of the image plane at distance 1."""
        return math.tan(math.radians(self.field_of_view) / 2)

    @property
    def focal(self) -> float:
        """The focal length in columns."""
        return self.width / (2 * self.half_plane)

    @property
    def row_focal(self) -> float:
        """The focal length in rows: a tile at depth `d` is `row_focal / d` rows high."""
        if self.row_focal_share is None:
            return self.focal
        return self.row_focal_share * self.height / self.half_plane

    @property
    def wall_drop(self) -> float:
        """How far the middle of a wall is below the eye, in half wall heights."""
        return 2 * self.eye / self.wall - 1

    def at(self, place: tuple[float, float]) -> Camera:
        """The camera with rays through another place of its pixels, (column, row)."""
        return dataclasses.replace(self, column=place[0], row=place[1])

    def halved(self) -> Camera:
        """The camera with two columns for each."""
        share = self.row_focal * self.half_plane / self.height
        return dataclasses.replace(self, width=2 * self.width, row_focal_share=share)

    def widened(self) -> Camera:
        """The camera with enough extra columns to fill the last vector of a row."""
        return dataclasses.replace(self, extra=-self.width % LANES)

    def column_slopes(self) -> np.ndarray:
        """float32[width + extra]: the sideways offset of each column at distance 1."""
        column = np.arange(self.width + self.extra)
        places = column + self.column + self.shift * (2 * column + 1 < self.width)
        if self.screen:
            places += _moved(column, self.screen[1] / self.width)
        centres = (2 * places / self.width - 1) * self.half_plane
        return centres.astype(np.float32)

    def row_offsets(self) -> np.ndarray:
        """float32[height]: how far each row is below the horizon, in pixels."""
        row = np.arange(self.height)
        places = row + self.row
        if self.screen:
            places += _moved(row, self.screen[0] / self.height)
        return (places - self.height / 2).astype(np.float32)

    def row_distances(self, lift: Any = None) -> Any:
        """float32[height]: the depth in tiles at which each row shows floor or ceiling.

        A host array unless the eye is lifted (`Scene.lift`, float32[]).

        The row on the horizon (images of odd height) would be infinitely far. It gets the depth
        for a hundredth of a pixel, which a wall always hides.
        """
        below = self.row_offsets()
        far = np.where(below > 0, self.eye, self.wall - self.eye) * self.row_focal
        rows = np.maximum(np.abs(below), np.float32(0.01))
        if lift is None:
            return far.astype(np.float32) / rows
        raised = np.where(below > 0, self.row_focal, -self.row_focal) * lift
        return (far + raised).astype(np.float32) / rows


def _moved(pixel: np.ndarray, share: float) -> np.ndarray:
    """The shift from a pixel's centre to that of the screen's pixel that contains it, in pixels.

    There are `share` pixels of the screen per pixel of the image.
    """
    centre = (pixel + 0.5) * share
    return (np.floor(centre) + 0.5 - centre) / share
