"""Write a copy of the game's WAD file in other colours: the game with its palette exchanged.

    python -m fidelity.doom_palette FILE.wad [--channels gbr] [--wad DOOM2.WAD]
    jaxenstein evaluate RUN --set look=game --set wad=FILE.wad --in vizdoom

All palettes of the copy have their red, green and blue in another order, so the whole game has,
weapon and flashes included. The second command tests an agent on them, here and in the game.
"""

from __future__ import annotations

import argparse
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fidelity.commands import run_command
from jaxenstein.files import atomic, check_apart, check_writable
from jaxenstein.tasks.doom.wad import Wad, find_iwad

ORDERS = "gbr", "brg", "rbg", "grb", "bgr"


def exchanged(wad: Path, channels: str) -> bytes:
    """The file with its palettes' channels in an order such as `"gbr"`: red becomes green.

    Raises:
        WadError: it is not a WAD file, is damaged, or has no palette.
    """
    # This checks the file.
    Wad(wad).palette()
    data = bytearray(wad.read_bytes())
    count, start = struct.unpack_from("<II", data, 4)
    for offset, size, name in struct.iter_unpack("<II8s", data[start : start + 16 * count]):
        if name.rstrip(b"\0").upper() == b"PLAYPAL":
            colours = np.frombuffer(data, np.uint8, size, offset).reshape(-1, 3)
            order = ["rgb".index(channel) for channel in channels]
            data[offset : offset + size] = colours[:, order].tobytes()
    return bytes(data)


def main(argv: Sequence[str] | None = None) -> int:
    """Read, exchange, write."""
    parser = argparse.ArgumentParser(description="Write the game's WAD file in other colours.")
    parser.add_argument("file", type=Path, help="the file to write")
    help = "the channels that are shown as red, green and blue (default %(default)s)"
    parser.add_argument("--channels", choices=ORDERS, default=ORDERS[0], help=help)
    help = "the file to read (default: Freedoom's, which comes with ViZDoom)"
    parser.add_argument("--wad", type=Path, help=help)
    options = parser.parse_args(argv)
    wad = find_iwad(options.wad)
    check_apart([options.file], [wad])
    check_writable(options.file)
    data = exchanged(wad, options.channels)
    with atomic(options.file) as temporary:
        temporary.write_bytes(data)
    print(f"wrote {options.file}")
    return 0


if __name__ == "__main__":
    run_command(main)
