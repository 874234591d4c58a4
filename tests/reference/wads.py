"""Write small WAD files with random pictures."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

Lumps = Iterable[tuple[str, bytes]]


def write_wad(lumps: Lumps, kind: bytes = b"PWAD") -> bytes:
    """A WAD file with these lumps and its directory at the end."""
    body, directory, count = b"", b"", 0
    for name, data in lumps:
        directory += struct.pack("<II8s", 12 + len(body), len(data), name.encode())
        body, count = body + data, count + 1
    return struct.pack("<4sII", kind, count, 12 + len(body)) + body + directory


def write_picture(pixels: np.ndarray, left: int = 0, top: int = 0) -> bytes:
    """Encode int16[height, width] with -1 in holes, at most 254 rows high."""
    height, width = pixels.shape
    columns, offsets = b"", []
    for column in pixels.T.tolist():
        offsets.append(8 + 4 * width + len(columns))
        row = 0
        while row < height:
            end = row
            while end < height and column[end] >= 0:
                end += 1
            if end > row:
                run = bytes(column[row:end])
                columns += bytes([row, len(run), run[0]]) + run + run[-1:]
            row = end + 1
        columns += b"\xff"
    return struct.pack(f"<4h{width}I", width, height, left, top, *offsets) + columns


def write_textures(
    textures: Mapping[str, tuple[tuple[int, int], Sequence[tuple[int, int, int]]]],
) -> bytes:
    """A lump TEXTURE1: the size of each texture, and (column, row, number) of its patches."""
    offset, offsets, body = 4 + 4 * len(textures), [], b""
    for name, ((height, width), patches) in textures.items():
        offsets.append(offset + len(body))
        body += struct.pack("<8sI2hIH", name.encode(), 0, width, height, 0, len(patches))
        for column, row, patch in patches:
            body += struct.pack("<5h", column, row, patch, 1, 0)
    return struct.pack(f"<{1 + len(offsets)}I", len(offsets), *offsets) + body


def write_names(names: Sequence[str]) -> bytes:
    """A lump PNAMES."""
    return struct.pack("<I", len(names)) + b"".join(
        struct.pack("8s", name.encode()) for name in names
    )


def pixels_with_holes(height: int, width: int, seed: int) -> np.ndarray:
    """int16[height, width]: random pixels with some holes."""
    draw = np.random.default_rng(seed)
    pixels = draw.integers(0, 256, (height, width)).astype(np.int16)
    pixels[draw.random((height, width)) < 0.3] = -1
    return pixels


PATCH, POST, MONSTER, TURNED = (
    pixels_with_holes(8, 6, 0),
    pixels_with_holes(12, 4, 1),
    pixels_with_holes(5, 3, 2),
    pixels_with_holes(4, 7, 3),
)
FLAT = np.arange(4096, dtype=np.uint8).reshape(64, 64)
PALETTE = np.arange(768, dtype=np.uint8).reshape(256, 3)
COLORMAP = np.arange(34 * 256, dtype=np.uint16).astype(np.uint8).reshape(34, 256)
WALL = {"WALL": ((16, 8), [(-2, 3, 0), (3, -4, 1), (2, 10, 0)]), "POLE": ((12, 4), [(0, 0, 1)])}


def small_lumps() -> list[tuple[str, bytes]]:
    """Lumps with one example of each kind that the reader knows."""
    sides = [write_picture(MONSTER + side % 2, side, 4) for side in range(4)]
    return [
        ("PLAYPAL", PALETTE.tobytes() * 2),
        ("COLORMAP", COLORMAP.tobytes()),
        ("TEXTURE1", write_textures(WALL)),
        ("PNAMES", write_names(["PATCH", "post"])),
        ("P_START", b""),
        ("PATCH", write_picture(PATCH)),
        ("POST", write_picture(POST)),
        ("P_END", b""),
        ("F_START", b""),
        ("F1_START", b""),
        ("FLOOR", FLAT.tobytes()),
        ("F1_END", b""),
        ("F_END", b""),
        ("S_START", b""),
        ("VESTA0", write_picture(TURNED, 2, 4)),
        ("TROOA1", sides[0]),
        ("TROOA5", sides[1]),
        ("TROOA2A8", sides[2]),
        ("TROOA3A7", sides[3]),
        ("TROOA4A6", write_picture(TURNED, 1, 2)),
        ("TROOB1", sides[0]),
        ("S_END", b""),
    ]
