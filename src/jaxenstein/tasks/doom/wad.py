"""Read pictures from Doom's WAD files: palette, light, wall textures, flats and sprites.

A WAD file has a header (kind, number of lumps, offset of the directory), the lumps, and a directory
with 16 bytes per lump (offset, size, name). Lumps between the markers `F_START` and `F_END` are
flats, those between `S_` markers are sprites, and those between `P_` markers are patches.
`TEXTURE1` composes textures from patches.

No package fits: omgifol 0.5.1 (MIT, 2023, no dependencies) opens files for writing and raises
arbitrary errors for damaged ones, and wadlib needs Python 3.12.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import WadError, nearest, quoted
from ...files import reason_of

# The largest side and number of patches; in Doom itself, 1024 pixels and 64 patches per texture.
LARGEST, MOST_PATCHES = 2048, 256
ROTATIONS = 8
_ENTRY = np.dtype([("offset", "<u4"), ("size", "<u4"), ("name", "S8")])
_MARKER = re.compile(r"([FSP])\1?_(START|END)")
_INNER = re.compile(r"[FSP]\d_(START|END)")


@dataclass(frozen=True)
class WadPicture:
    """A picture with holes.

    Attributes:
        pixels: int16[height, width], palette indices, -1 in holes; already mirrored if `mirrored`.
        left: columns from the picture's left edge to the thing's position.
        top: rows from the picture's upper edge down to the thing's feet.
        mirrored: whether the file has the mirror image.
    """

    pixels: np.ndarray
    left: int
    top: int
    mirrored: bool = False

    def mirror(self) -> WadPicture:
        """The mirror image about the column of the thing's position."""
        left = self.pixels.shape[1] - self.left - 1
        return WadPicture(self.pixels[:, ::-1], left, self.top, not self.mirrored)


class Wad:
    """A WAD file, whose lumps are read and decoded on demand.

    Names are case-insensitive. If several lumps have the same name, the last one counts.
    """

    def __init__(self, path: str | Path) -> None:
        """Read the directory.

        Raises:
            WadError: the file does not exist, is not a WAD file, or is damaged.
        """
        self.path = Path(path)
        if not os.path.isfile(path):
            raise self._error("it is a folder" if os.path.isdir(path) else "there is no such file")
        size = os.path.getsize(path)
        kind, count, start = struct.unpack("<4sII", self._read(0, 12).ljust(12, b"\0"))
        if kind not in (b"IWAD", b"PWAD"):
            raise self._error("not a WAD file: it does not begin with IWAD or PWAD")
        if size < 12 or start + count * _ENTRY.itemsize > size:
            raise self._error(f"cut off: its directory ends after the file's {size} bytes")
        entries = np.frombuffer(self._read(start, count * _ENTRY.itemsize), _ENTRY)
        names = [_text(name) for name in entries["name"].tolist()]
        ends = entries["offset"].astype(np.int64) + entries["size"]
        outside = (ends > size) & (entries["size"] > 0)
        if outside.any():
            name = quoted(names[int(outside.argmax())])
            raise self._error(f"damaged: lump {name} lies outside of the file's {size} bytes")
        self._places: dict[str, dict[str, tuple[int, int]]] = {key: {} for key in ("", *"FSP")}
        section = ""
        for name, offset, size in zip(names, entries["offset"], entries["size"], strict=True):
            marker = _MARKER.fullmatch(name)
            if marker:
                section = marker[1] if marker[2] == "START" else ""
            elif not _INNER.fullmatch(name):
                self._places[section][name] = int(offset), int(size)

    def names(self, section: str = "") -> tuple[str, ...]:
        """The names of the lumps between the markers `F`, `S` or `P`, or of all other lumps."""
        return tuple(self._places[section])

    def textures(self) -> tuple[str, ...]:
        """The names of the wall textures."""
        return tuple(self._textures)

    def lump(self, name: str, *sections: str) -> bytes:
        """The bytes of a lump.

        Args:
            name: the name of the lump.
            sections: the sections to search, in order; by default, outside of markers.

        Raises:
            WadError: the lump does not exist.
        """
        sections, name = sections or ("",), name.upper()
        for section in sections:
            if name in self._places[section]:
                offset, size = self._places[section][name]
                return self._read(offset, size)
        known = [name for section in sections for name in self.names(section)]
        raise self._missing({"F": "flat", "P": "patch"}.get(sections[0], "lump"), name, known)

    def palette(self) -> np.ndarray:
        """uint8[256, 3]: red, green and blue of the first palette."""
        return self._table("PLAYPAL", 256, 3)

    def colormap(self) -> np.ndarray:
        """uint8[34, 256]: the palette index under each light: 32 from bright to dark, 2 others."""
        return self._table("COLORMAP", 34, 256)

    def flat(self, name: str) -> np.ndarray:
        """uint8[64, 64]: the palette indices of a floor or ceiling."""
        data = self.lump(name, "F")
        if len(data) != 64 * 64:
            raise self._error(f"flat {quoted(name)} has {len(data)} bytes, not 4096")
        return np.frombuffer(data, np.uint8).reshape(64, 64)

    def texture(self, name: str) -> np.ndarray:
        """int16[height, width]: the palette indices of a wall texture, -1 in holes.

        As in the game, a wall may also have a flat as its texture.
        """
        if name.upper() not in self._textures:
            if name.upper() in self._places["F"]:
                return self.flat(name).astype(np.int16)
            raise self._missing("texture", name, [*self._textures, *self.names("F")])
        data, at = self._textures[name.upper()]
        what = f"texture {quoted(name)}"
        _, width, height, _, count = self._unpack("<12s2h4sH", data, at, what)
        self._check_size(what, width, height)
        if count > MOST_PATCHES:
            raise self._error(f"{what} has {count} patches, more than {MOST_PATCHES}")
        numbers = np.array(self._unpack(f"<{5 * count}h", data, at + 22, what)).reshape(-1, 5)
        canvas, known = np.full((height, width), -1, np.int16), dict[int, np.ndarray]()
        for x, y, number in numbers[:, :3].tolist():
            if not 0 <= number < len(self._patch_names):
                raise self._error(f"{what} has patch {number} of {len(self._patch_names)}")
            if number not in known:
                known[number] = self.patch(self._patch_names[number]).pixels
            part = known[number][max(0, -y) : max(0, height - y), max(0, -x) : max(0, width - x)]
            place = canvas[max(0, y) :, max(0, x) :][: part.shape[0], : part.shape[1]]
            np.copyto(place, part, where=part >= 0)
        return canvas

    def patch(self, name: str) -> WadPicture:
        """A patch of textures; any other picture can be a patch too."""
        return self._decode(name, self.lump(name, "P", "", "S"))

    def sprite(self, name: str, frame: str) -> tuple[WadPicture, ...]:
        """The eight views of a thing, starting at the front, clockwise as seen from above.

        Args:
            name: its four letters, such as `"TROO"`.
            frame: the letter of the frame.

        Raises:
            WadError: the sprite does not exist, or one of its views is missing.
        """
        views: dict[str, tuple[str, bool]] = {}
        name, frame = name.upper(), frame.upper()
        for lump in self.names("S"):
            if lump[:4] == name:
                views |= {
                    lump[i + 1 : i + 2]: (lump, i > 4) for i in (4, 6) if lump[i:][:1] == frame
                }
        if not views:
            raise self._missing("sprite", name + frame, self.names("S"))
        pictures = {lump: self._decode(lump, self.lump(lump, "S")) for lump, _ in views.values()}
        found = []
        for side in map(str, range(1, ROTATIONS + 1)):
            if not views.keys() & {side, "0"}:
                raise self._error(f"sprite {quoted(name + frame)} lacks its view {side}")
            lump, mirrored = views.get(side) or views["0"]
            found.append(pictures[lump].mirror() if mirrored else pictures[lump])
        return tuple(found)

    @cached_property
    def _textures(self) -> dict[str, tuple[bytes, int]]:
        """For each texture, the lump that defines it and the offset in that lump."""
        found = {}
        for lump in ("TEXTURE1", "TEXTURE2"):
            if lump in self._places[""]:
                data = self.lump(lump)
                (count,) = self._unpack("<I", data, 0, lump)
                for at in self._unpack(f"<{count}I", data, 4, lump):
                    found[_text(self._unpack("<8s", data, at, lump)[0])] = data, at
        return found

    @cached_property
    def _patch_names(self) -> list[str]:
        data = self.lump("PNAMES")
        (count,) = self._unpack("<I", data, 0, "PNAMES")
        (names,) = self._unpack(f"<{8 * count}s", data, 4, "PNAMES")
        return [_text(names[at : at + 8]) for at in range(0, len(names), 8)]

    def _decode(self, name: str, data: bytes) -> WadPicture:
        """Decode a picture: columns of runs of pixels (row, length, pixels), each ended by 255."""
        what = f"picture {quoted(name)}"
        width, height, left, top = self._unpack("<4h", data, 0, what)
        self._check_size(what, width, height)
        pixels = np.full((height, width), -1, np.int16)
        for column, at in enumerate(self._unpack(f"<{width}I", data, 8, what)):
            row = -1
            for _ in range(height + 1):
                (step,) = self._unpack("B", data, at, what)
                if step == 255:
                    break
                (length,) = self._unpack("B", data, at + 1, what)
                (run,) = self._unpack(f"{length}s", data, at + 3, what)
                # In pictures higher than 254 rows, a step that is not below the last run goes on.
                row = step if step > row else row + step
                if row + length > height:
                    raise self._error(f"column {column} of {what} leaves its {height} rows")
                pixels[row : row + length, column] = np.frombuffer(run, np.uint8)
                at += length + 4
            else:
                raise self._error(f"column {column} of {what} has more runs than rows")
        return WadPicture(pixels, left, top)

    def _table(self, name: str, rows: int, columns: int) -> np.ndarray:
        (data,) = self._unpack(f"{rows * columns}s", self.lump(name), 0, f"lump {name}")
        return np.frombuffer(data, np.uint8).reshape(rows, columns)

    def _read(self, offset: int, size: int) -> bytes:
        try:
            with self.path.open("rb") as file:
                file.seek(offset)
                return file.read(size)
        except OSError as error:
            raise self._error(f"cannot be read: {reason_of(error)}") from error

    def _unpack(self, form: str, data: bytes, at: int, what: str) -> tuple[Any, ...]:
        if at + struct.calcsize(form) > len(data):
            raise self._error(f"{what} is cut off: it has only {len(data)} bytes")
        return struct.unpack_from(form, data, at)

    def _check_size(self, what: str, width: int, height: int) -> None:
        if not (1 <= width <= LARGEST and 1 <= height <= LARGEST):
            raise self._error(f"{what} is {width} by {height} pixels, not 1 to {LARGEST}")

    def _error(self, message: str) -> WadError:
        return WadError(f"{self.path}: {message}")

    def _missing(self, kind: str, name: str, known: Sequence[str]) -> WadError:
        return self._error(f"has no {kind} {quoted(name)}{nearest(name, known)}")


def _text(name: bytes) -> str:
    return name.split(b"\0")[0].decode("latin-1").upper()


def find_iwad(path: str | Path | None = None) -> Path:
    """The WAD file with the game's pictures.

    Args:
        path: a file of your own, such as DOOM2.WAD; by default Freedoom's, which comes with
            ViZDoom.

    Raises:
        MissingViZDoomError: no path is given, and ViZDoom, which has the file, is not installed.
    """
    if path is not None:
        return Path(path)
    from ...adapters.vizdoom_buffers import load_vizdoom

    return Path(load_vizdoom().__file__).parent / "freedoom2.wad"
