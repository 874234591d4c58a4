"""Images of your own for walls, floor, ceiling and things: the setting `textures`."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .errors import SettingError, nearest, quoted
from .files import reason_of

SUFFIXES = (".bmp", ".gif", ".jpeg", ".jpg", ".png", ".webp")
"""Suffixes of image files; other files of a folder are ignored."""
MOST_SIDE = 128
"""The maximum side of a texture in texels; larger images are resized."""
LARGEST_SIDE = 4096
"""The maximum side in pixels of an image that can be read."""


class Picture(NamedTuple):
    """One image.

    Attributes:
        pixels: uint8[height, width, 4] in RGBA, both sides a power of two up to `MOST_SIDE`.
        shape: the aspect ratio, width over height, of the original image.
    """

    pixels: np.ndarray
    shape: float


@dataclasses.dataclass(frozen=True)
class Images:
    """Images by name. Two objects are equal if their images are, wherever those come from.

    Attributes:
        digest: a digest of names and images.
        folder: the absolute path of the folder they were read from; None for arrays.
        pictures: the images by name.
    """

    digest: str
    folder: str | None = dataclasses.field(compare=False)
    pictures: Mapping[str, Picture] = dataclasses.field(compare=False, repr=False)

    def of_labels(self) -> dict[int, Picture]:
        """The image of each label that has one; the most specific name takes precedence."""
        labels = labels_of_names()
        found: dict[int, Picture] = {}
        for name in sorted(self.pictures, key=lambda name: -len(labels[name])):
            found |= dict.fromkeys(labels[name], self.pictures[name])
        return found


def labels_of_names() -> dict[str, tuple[int, ...]]:
    """The labels to which an image of each name applies: one, or several of a kind.

    `wall` applies to all walls, `door` to all doors, and `key` to keys of all colours.
    """
    from .maps.symbols import DOOR_LABELS, LABEL_NAMES, WALL_LABELS, label_name
    from .maps.things import THING_OF

    every = {*range(len(LABEL_NAMES)), *THING_OF}
    names = {label_name(label): (label,) for label in sorted(every)}
    half = len(DOOR_LABELS) // 2
    names |= {thing.name: tuple(thing.labels) for thing in THING_OF.values()}
    names |= {"wall": tuple(WALL_LABELS), "door": tuple(DOOR_LABELS)}
    return names | {
        "unlocked door": tuple(DOOR_LABELS[:half]), "locked door": tuple(DOOR_LABELS[half:])
    }  # fmt: skip


def read_images(given: Any) -> Images:
    """Read the images of a folder, or of a dict from names to arrays.

    Args:
        given: the path of a folder with files such as `wall.png` and `red-key.png`; or a mapping
            from names such as `"wall"` to arrays uint8[height, width, 3 or 4]; or `Images`.

    Raises:
        SettingError: the argument is something else, a name is unknown, or an image cannot be read
            or has a side of more than `LARGEST_SIDE` pixels.
    """
    if isinstance(given, Images):
        return given
    if isinstance(given, str | Path):
        folder = Path(os.path.expanduser(given))
        pictures = {
            _known(file.stem, str(file)): _picture(_read(file), quoted(str(file)))
            for file in _files(folder)
        }
        where = str(folder.resolve())
    elif isinstance(given, Mapping):
        pictures = {
            _known(name, "textures"): _picture(_array(name, array), f"the image {quoted(name)}")
            for name, array in given.items()
        }
        where = None
    else:
        raise SettingError(
            "textures must be a folder of images, or a table of names with arrays, not a "
            f"{type(given).__name__}"
        )
    if not pictures:
        raise SettingError(
            f"textures must be at least one image, not {quoted(given)} without one: name files "
            "wall.png, floor.png, ceiling.png and so on"
        )
    return Images(_digest(pictures), where, pictures)


def _files(folder: Path) -> list[Path]:
    try:
        files = sorted(folder.iterdir())
    except (OSError, ValueError) as error:  # A null character is a ValueError.
        reason = f"cannot be read ({reason_of(error)})"
        if isinstance(error, FileNotFoundError):
            reason = "does not exist"
        elif isinstance(error, NotADirectoryError):
            reason = "is a file or is below one"
        raise SettingError(
            f"textures must be a folder of images, not {quoted(str(folder))}, which {reason}"
        ) from None
    images = [f for f in files if f.suffix.lower() in SUFFIXES and not f.name.startswith(".")]
    return [file for file in images if os.path.isfile(file)]


def _known(name: Any, where: str) -> str:
    """The known name; hyphens and underscores count as spaces."""
    known = {_folded(one): one for one in labels_of_names()}
    if isinstance(name, str) and _folded(name) in known:
        return known[_folded(name)]
    close = nearest(_folded(name), known) if isinstance(name, str) else ""
    raise SettingError(
        f"{where}: no image can be called {quoted(name)}{close}; names are wall, floor, ceiling, "
        "door and what observation='labels' tells apart, such as 'red wall' and 'goal'"
    )


def _folded(name: str) -> str:
    return " ".join(name.replace("-", " ").replace("_", " ").split()).casefold()


def _read(file: Path) -> np.ndarray:
    """Read uint8[height, width, 4] from a file."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(file) as image:
                _check_size(image.height, image.width, quoted(str(file)))
                return np.asarray(image.convert("RGBA"))
    except SettingError:
        raise
    # Pillow's decoders raise many types of errors for damaged files.
    except Exception as error:
        raise SettingError(
            f"textures: {quoted(str(file))} cannot be read as an image ({error})"
        ) from None


def _array(name: str, given: Any) -> np.ndarray:
    """Check an array, and add alpha: uint8[height, width, 4]."""
    found = hasattr(given, "__array__")
    array: np.ndarray = np.asarray(given) if found else np.zeros(0)
    if array.ndim != 3 or array.shape[-1] not in (3, 4) or array.dtype != np.uint8:
        what = f"{array.dtype}{list(array.shape)}" if found else quoted(given)
        raise SettingError(
            f"textures: the image {quoted(name)} must be an array uint8[height, width, 3 or 4], "
            f"not {what}"
        )
    height, width, _ = array.shape
    _check_size(height, width, f"the image {quoted(name)}")
    if array.shape[-1] == 4:
        return array
    return np.concatenate([array, np.full((*array.shape[:2], 1), 255, np.uint8)], axis=-1)


def _check_size(height: int, width: int, what: str) -> None:
    if not (0 < height <= LARGEST_SIDE and 0 < width <= LARGEST_SIDE):
        raise SettingError(
            f"textures: {what} must have sides of 1 to {LARGEST_SIDE} pixels, not {width} by "
            f"{height}"
        )


def _picture(rgba: np.ndarray, what: str) -> Picture:
    """Resize an image to powers of two; transparent pixels do not blend into opaque ones."""
    from PIL import Image

    height, width = rgba.shape[:2]
    if max(height, width) > 64 * min(height, width):
        raise SettingError(
            f"textures: {what} must not be more than 64 times as long as wide, as {width} by "
            f"{height} pixels are"
        )
    sides = [min(1 << (side - 1).bit_length(), MOST_SIDE) for side in (width, height)]
    if sides != [width, height]:
        image = Image.fromarray(rgba).convert("RGBa")
        image = image.resize((sides[0], sides[1]), Image.Resampling.BOX)
        rgba = np.asarray(image.convert("RGBA"))
    pixels = np.array(rgba)
    pixels.setflags(write=False)
    return Picture(pixels, width / height)


def _digest(pictures: Mapping[str, Picture]) -> str:
    found = hashlib.sha256()
    for name, picture in sorted(pictures.items()):
        height, width = picture.pixels.shape[:2]
        found.update(f"{name} {height} {width} {picture.shape!r}\n".encode())
        found.update(picture.pixels.tobytes())
    return found.hexdigest()


def power_of_two(value: float) -> float:
    """The nearest power of two, by ratio."""
    return 2.0 ** round(math.log2(value))
