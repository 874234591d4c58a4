"""Your own kinds of things, with their own pictures."""

from __future__ import annotations

import dataclasses
import numbers
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from ..engine.art import MARKS, SIZE
from ..errors import SettingError, quoted
from .symbols import LABEL_NAMES
from .things import COLOURS, RGB, THING_OF, Thing, enter

OWN_LABELS = range(192, 256)
"""Labels that this package does not use."""
# In images of a thing in several colours, light pixels are the shape and dark ones the detail.
_LIGHT, _DARK = (255, 255, 255), (0, 0, 0)


def register_thing(
    name: str,
    label: int,
    picture: str | Path | np.ndarray,
    *,
    colour: RGB | None,
    detail: RGB | None = None,
    radius: float = 0.25,
    drop: float | None = None,
) -> Thing:
    """Register a new kind of thing; `build_theme` and top-down maps then draw it by its label.

    A second call with the same name and label replaces the picture in everything that is built
    later, and JAX compiles its programs again. Stop using equal environments that were built
    before.

    Args:
        name: the name of the thing.
        label: its label id, 192 to 255; with `colour=None` the first of its six labels.
        picture: 32 by 32 pixels in one of three forms. Text has 32 lines of 32 characters: `.` is
            empty, `#` is the first colour and `o` the second; common indentation is removed. An
            array int[32, 32] has 0, 1 and 2 instead. An image is a file name or an array
            uint8[32, 32, 3 or 4]: pixels with an alpha below 128 are empty, and the others take
            `colour` or `detail`, whichever is closer in RGB.
        colour: RGB, 0 to 255, of the shape in full light, of the label and on maps. None for all
            six colours of keys; light pixels of an image are then the shape, dark ones the detail.
        detail: RGB of the second colour; None for a darker shade of the first.
        radius: half the billboard's side in tiles, above 0 to 0.5.
        drop: tiles from eye height down to the billboard's centre; None to stand on the floor.

    Returns:
        The thing, with its `labels`.

    Raises:
        SettingError: the picture has the wrong size or form, its file cannot be read, a value is
            invalid, or another thing has the name or a label.
    """
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise SettingError(f"the name of a thing must be one line of text, not {quoted(name)}")
    _check_rgb(name, "colour", colour)
    _check_rgb(name, "detail", detail)
    radius, drop = _checked_size(name, radius, drop)
    whole = isinstance(label, int | np.integer) and not isinstance(label, bool)
    last = OWN_LABELS[-len(COLOURS) if colour is None else -1]
    if not whole or not OWN_LABELS[0] <= label <= last:
        raise SettingError(
            f"the label of {quoted(name)} must be a whole number from {OWN_LABELS[0]} to {last}, "
            f"not {quoted(label)}"
        )
    thing = Thing(name, int(label), colour, "", radius, drop, detail)
    others = {one for other in THING_OF.values() if other.name != name for one in other.names}
    if taken := set(thing.names) & ({*LABEL_NAMES} | others):
        raise SettingError(
            f"{min(taken)!r} is already the name of a label: choose another name than "
            f"{quoted(name)}"
        )
    before = THING_OF.get(thing.label)
    thing = enter(dataclasses.replace(thing, art=_art(thing, picture)))
    if before not in (None, thing):
        # Programs of equal environments hold the picture that there was.
        import jax  # Maps alone do not need it.

        jax.clear_caches()
    return thing


def _art(thing: Thing, picture: Any) -> str:
    """The picture as text, in the format of the files in `engine/art`."""
    place = f"the picture of {quoted(thing.name)}"
    if isinstance(picture, str) and ("\n" in picture or not picture):
        text = textwrap.dedent(picture).strip("\n")
        rows = [line.rstrip() for line in text.split("\n")]
    elif isinstance(picture, str | Path):
        rows = _rows(thing, _read(place, Path(picture)), place)
    else:
        rows = _rows(thing, _array(place, picture), place)
    _check_rows(place, rows)
    return "\n".join(rows)


def _check_rows(place: str, rows: list[str]) -> None:
    if len(rows) != SIZE:
        raise SettingError(f"{place} must have {SIZE} rows, not {len(rows)}")
    for number, row in enumerate(rows, start=1):
        if len(row) != SIZE:
            raise SettingError(f"{place}: row {number} must have {SIZE} pixels, not {len(row)}")
        if wrong := set(row) - set(MARKS):
            raise SettingError(
                f"{place}: row {number} has {min(wrong)!r}, which is not one of "
                f"{', '.join(map(repr, MARKS))}"
            )
    if not set("".join(rows)) - {MARKS[0]}:
        raise SettingError(f"{place} is empty: it needs at least one visible pixel")


def _read(place: str, path: Path) -> np.ndarray:
    """uint8[H, W, 4]: the image in a file."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            # Checked before decoding, which may take any amount of memory.
            _check_size(place, image.height, image.width)
            return np.asarray(image.convert("RGBA"))
    except SettingError:
        raise
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise SettingError(
            f"{place}: {quoted(str(path))} cannot be read as an image ({error})"
        ) from None


def _check_size(place: str, rows: int, columns: int) -> None:
    if (rows, columns) != (SIZE, SIZE):
        raise SettingError(
            f"{place} must have {SIZE} rows and {SIZE} columns, not {rows} and {columns}"
        )


def _array(place: str, picture: Any) -> np.ndarray:
    try:
        return np.asarray(picture)
    except (TypeError, ValueError) as error:
        raise SettingError(f"{place} is not an array ({error})") from None


def _rows(thing: Thing, array: np.ndarray, place: str) -> list[str]:
    """The lines of text for an array."""
    coloured = array.ndim == 3 and array.shape[-1] in (3, 4) and array.dtype == np.uint8
    if not coloured and (array.ndim != 2 or array.dtype.kind not in "iub"):
        raise SettingError(
            f"{place} must be text, the name of an image file, int[{SIZE}, {SIZE}] or "
            f"uint8[{SIZE}, {SIZE}, 3 or 4], not {array.dtype}{list(array.shape)}"
        )
    _check_size(place, *array.shape[:2])
    marks = _marks_of(thing, array) if coloured else array.astype(np.int64)
    low, high = marks.min(), marks.max()
    if low < 0 or high >= len(MARKS):
        raise SettingError(f"{place} must hold only 0, 1 and 2, not {low} to {high}")
    return ["".join(MARKS[mark] for mark in row) for row in marks]


def _marks_of(thing: Thing, image: np.ndarray) -> np.ndarray:
    """int[32, 32]: 0 where an image is empty, 1 for the first colour and 2 for the second."""
    paints = (_LIGHT, _DARK) if thing.coloured else thing.paints(thing.label)
    offset = image[:, :, None, :3] - np.array(paints, float)
    marks = 1 + np.argmin((offset**2).sum(axis=-1), axis=-1)
    return np.where(image[..., 3] >= 128, marks, 0) if image.shape[-1] == 4 else marks


def _check_rgb(name: str, what: str, value: Any) -> None:
    parts = value if isinstance(value, tuple) else ()
    whole = all(isinstance(p, int | np.integer) and not isinstance(p, bool) for p in parts)
    if value is None or (len(parts) == 3 and whole and all(0 <= p <= 255 for p in parts)):
        return
    raise SettingError(
        f"the {what} of {quoted(name)} must be (red, green, blue), whole numbers from 0 to 255, or "
        f"None, not {quoted(value)}"
    )


def _checked_size(name: str, radius: Any, drop: Any) -> tuple[float, float]:
    """Radius and drop as Python numbers; for drop None, the thing stands on the floor."""
    if not _is_number(radius) or not 0 < radius <= 0.5:
        raise SettingError(
            f"the radius of {quoted(name)} must be above 0 and at most 0.5 tiles, not "
            f"{quoted(radius)}"
        )
    radius = float(radius)
    if drop is None:
        return radius, 0.5 - radius
    if not _is_number(drop) or not abs(drop) <= 0.5 - radius + 1e-9:
        raise SettingError(
            f"the drop of {quoted(name)} must be from {radius - 0.5:g} to {0.5 - radius:g} with a "
            f"radius of {radius:g}, between floor and ceiling, not {quoted(drop)}"
        )
    return radius, float(drop)


def _is_number(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)
