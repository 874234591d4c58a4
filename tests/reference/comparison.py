"""Compare the hits of rays with the reference."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from hypothesis import note

from jaxenstein.engine.camera import Camera
from jaxenstein.engine.raycast import Hits

from . import raycaster
from .worlds import World


@dataclasses.dataclass
class Tally:
    """The number of rays that were compared, and of those with more than one valid answer."""

    rays: int = 0
    excused: int = 0


def rays_of(world: World, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Eyes and directions float64[poses * width, 2] of all columns of all poses."""
    eyes = np.repeat(world.positions.astype(np.float64), camera.width, axis=0)
    rays = [
        raycaster.directions(float(heading), camera.width, camera.field_of_view)
        for heading in world.headings
    ]
    return eyes, np.concatenate(rays)


def flat(hits: Hits) -> dict[str, np.ndarray]:
    """The hits of a batch of poses as arrays over all rays."""
    rays = hits.depth.size
    return {
        "depth": np.asarray(hits.depth, np.float64).reshape(rays),
        "along": np.asarray(hits.along, np.float64).reshape(rays),
        "wall": np.asarray(hits.wall).reshape(rays),
        "horizontal": np.asarray(hits.horizontal).reshape(rays),
        "tile": np.asarray(hits.tile).reshape(rays, 2),
    }


def wall_ids(world: World, tile: np.ndarray, face: np.ndarray) -> np.ndarray:
    """The wall ids of faces on the map; -1 outside the map."""
    faces = world.walls.reshape(-1, *world.walls.shape[-2:])
    column, row = tile[:, 0], tile[:, 1]
    inside = (column >= 0) & (row >= 0) & (column < faces.shape[2]) & (row < faces.shape[1])
    inner = faces[face * (len(faces) == 4), row * inside, column * inside].astype(int)
    return np.where(inside, inner, -1)


def compare(world: World, camera: Camera, hits: Hits, tally: Tally) -> None:
    """Compare hits with the reference; rays within rounding of an edge must only be plausible."""
    eyes, rays = rays_of(world, camera)
    solid = world.solid
    sight = raycaster.march(solid, eyes, rays)
    got = flat(hits)
    rounding = raycaster.rounding_of_depth(eyes, rays, sight)
    wrong = np.abs(got["depth"] - sight.depth) > 1e-4 * sight.depth + 1e-6 + rounding
    wrong |= (got["tile"] != sight.tile).any(axis=1)
    wrong |= got["horizontal"] != (sight.face >= raycaster.NORTH)
    wrong |= np.abs(got["along"] - sight.along) > 1e-3 + rounding
    ids = wall_ids(world, sight.tile, sight.face)
    wrong |= np.where(ids >= 0, got["wall"] != ids, got["wall"] < 2)

    unsure = sight.clearance < 0
    tally.rays += len(wrong)
    tally.excused += int(unsure.sum())
    for i in np.flatnonzero(wrong & unsure):
        wrong[i] = not excusable(world, solid, eyes[i], rays[i], got, int(i))
    for i in np.flatnonzero(wrong)[:3]:
        note(describe(world, camera, sight, got, int(i)))
    assert not wrong.any(), f"{wrong.sum()} of {wrong.size} rays differ"


def excusable(
    world: World, solid: np.ndarray, eye: np.ndarray, ray: np.ndarray, got: dict[str, Any], i: int
) -> bool:
    """Whether all of hit `i` is right for a ray that is off by a rounding error."""
    if got["horizontal"][i]:
        face = raycaster.NORTH if ray[1] > 0 else raycaster.SOUTH
    else:
        face = raycaster.WEST if ray[0] > 0 else raycaster.EAST
    tile, depth = got["tile"][i], got["depth"][i]
    wall = wall_ids(world, tile[None], np.array([face]))[0]
    right_id = got["wall"][i] == wall if wall >= 0 else got["wall"][i] >= 2
    right_along = 0 <= got["along"][i] <= 1
    return bool(
        right_id and right_along and raycaster.is_plausible(solid, eye, ray, depth, tile, face)
    )


def describe(
    world: World, camera: Camera, sight: raycaster.Sight, got: dict[str, Any], i: int
) -> str:
    """One failing ray in full precision."""
    pose, column = divmod(i, camera.width)
    x, y = (float(v).hex() for v in world.positions[pose])
    wanted = {
        field.name: getattr(sight, field.name)[i].tolist() for field in dataclasses.fields(sight)
    }
    heading = float(world.headings[pose]).hex()
    return (
        f"eye ({x}, {y}) = {world.positions[pose]}, heading {heading}, "
        f"column {column} of {camera}\n"
        f"  reference {wanted}\n"
        f"  engine    { {name: value[i].tolist() for name, value in got.items()} }"
    )
