"""The scene of a scenario with `look="game"`: its walls, its things and its weapon."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from ...engine.level import Level
from ...engine.scene import Scene, Sprites, Theme
from ...errors import SettingError, quoted
from .fixed import ONE, direction
from .game_look import game_pictures, sampling
from .game_things import Look, Views
from .game_walls import free_walls
from .game_weapon import WeaponLook, held
from .maps import DoomMap, TileGrid
from .parts import Part
from .physics import bob_swing
from .pose import DoomState, game_tic, to_tiles
from .wad import find_iwad


def check_game_look(
    look: str, wad: str | None, samples: int, *, takes_patterns: bool, takes_game_look: bool
) -> None:
    """Raise if a scenario cannot have a look, or has settings of another look.

    Args:
        look: the setting.
        wad: the setting.
        samples: the setting.
        takes_patterns: whether the tiles are large enough for patterns.
        takes_game_look: whether the scenario has the game's pictures.

    Raises:
        SettingError: `look`, `wad` or `samples` does not fit.
    """
    if look == "patterned" and not takes_patterns:
        raise SettingError(
            "look must be 'plain', 'random' or 'game' in Doom's scenarios, whose tiles are too "
            f"small for patterns, not {look!r}"
        )
    game = ("game",) if takes_game_look else ()
    on_screen = game if takes_patterns else (*game, "random")
    for name, given, default, looks in (
        ("wad", wad, None, game),
        ("samples", samples, 1, on_screen),
    ):
        if given != default and not looks:
            raise SettingError(
                f"{name} is only for Doom's scenarios, not for shooters: leave it out"
            )
        if given != default and look not in looks:
            raise SettingError(
                f"{name} needs look={' or '.join(map(repr, looks))}: set that too, not "
                f"{name}={quoted(given)} with look={quoted(look)}"
            )


@dataclasses.dataclass(frozen=True, eq=False)
class GameLook:
    """What a scenario shows with `look="game"`.

    Attributes:
        parts: the parts of the scenario.
        tiles: the map as tiles.
        level: the map for the renderer, with walls where the game has them.
        theme: the look of the map, with a row for each picture of each thing.
        looks: the game's pictures of the things, part by part; each `picture` is a row of the
            plain theme.
        views: the rows of `theme` that each look has.
        weapons: the game's pictures of the player's weapons, if the game shows any.
        first_tic: the game's count of tics at the first observation.
    """

    parts: Sequence[Part]
    tiles: TileGrid
    level: Level
    theme: Theme
    looks: tuple[Look, ...]
    views: Views
    weapons: tuple[WeaponLook, ...]
    first_tic: int

    def dressed(self, scene: Scene, state: DoomState) -> Scene:
        """The plain scene of a state, as the game shows it."""
        cosine, sine = direction(state.angle)
        heading = jnp.stack([cosine, -sine]).astype(jnp.float32) * np.float32(1 / ONE)
        scene = scene.replace(
            level=self.level, heading=heading, sprites=self.sprites(state), theme=self.theme
        )
        if not self.weapons:
            return scene
        assert state.gait is not None
        trigger, swing = getattr(state, "trigger"), bob_swing(state.gait[1])  # noqa: B009
        selected = getattr(state, "arms").selected if len(self.weapons) > 1 else None  # noqa: B009
        tic = game_tic(state, self.first_tic)
        over, glare = held(self.weapons, trigger, swing, tic, selected)
        return scene.replace(held=over, glare=glare)

    def sprites(self, state: DoomState) -> Sprites:
        """The billboards of all parts."""
        tic, eye = game_tic(state, self.first_tic), state.fixed_position
        places, rows, visible, first = [], [], [], 0
        for part in self.parts:
            if shown := part.shown(state, tic):
                places.append(shown.places)
                visible.append(shown.visible)
                shown = shown._replace(looks=shown.looks + np.int32(first))
                rows.append(self.views.rows(shown, eye))
            first += len(part.looks)
        position = to_tiles(jnp.concatenate(places), self.tiles)
        return Sprites(position, jnp.concatenate(rows), jnp.concatenate(visible))


def read_game_look(
    parts: Sequence[Part],
    tiles: TileGrid,
    level: Level,
    theme: Theme,
    *,
    walls: tuple[str, DoomMap],
    wad: str | None,
    screen: tuple[int, int, int],
    first_tic: int,
) -> GameLook:
    """The look of a scenario in the game.

    Args:
        parts: the parts of the scenario.
        tiles: the map as tiles.
        level: the map for the renderer with other looks.
        theme: its plain look.
        walls: the name of the map, and the map.
        wad: the WAD file; None for the file of Freedoom.
        screen: rows and columns of the view, and samples for each pixel.
        first_tic: the game's count of tics at the first observation.

    Raises:
        WadError: the file is not a WAD file, is damaged, or lacks a picture.
    """
    map_name, doom_map = walls
    looks, weapons = _looks(parts), tuple(one for part in parts for one in part.weapon_looks)
    textures, views = game_pictures(str(find_iwad(wad)), map_name, looks, weapons, tiles.unit)
    rows = np.array([look.picture for look in looks])
    return GameLook(
        parts=parts,
        tiles=tiles,
        level=level.replace(free_walls=free_walls(doom_map, tiles)),
        theme=views.themed(theme, rows).replace(
            textures=textures.replace(sampling=sampling(*screen))
        ),
        looks=looks,
        views=views,
        weapons=weapons,
        first_tic=first_tic,
    )


def _looks(parts: Sequence[Part]) -> tuple[Look, ...]:
    looks, first = [], 0
    for part in parts:
        looks += [
            one if one.picture < 0 else dataclasses.replace(one, picture=one.picture + first)
            for one in part.looks
        ]
        first += sum(len(thing.pictures) for thing in part.objects)
    return tuple(looks)
