"""Frames of the running game and the states they show, for `fidelity.doom_picture`.

A state of the game has the camera's pose and the positions of things. It does not say which picture
a thing or the weapon shows, or whether a shot flashes. Of the few candidates, `fitted` takes those
with the most equal pixels.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fidelity.doom_recording import LONGEST_HOLD, pick
from jaxenstein.adapters.vizdoom_buffers import load_vizdoom, running
from jaxenstein.adapters.vizdoom_state import turns_of
from jaxenstein.tasks.doom.fixed import ONE, to_fixed
from jaxenstein.tasks.doom.game_weapon import WEAPON_LOOKS
from jaxenstein.tasks.doom.maps import load_map, rasterise
from jaxenstein.tasks.doom.wad import Wad, WadPicture
from jaxenstein.tasks.doom.weapons import SLOTS
from tests.reference.doom import cosine, sine, times
from tests.reference.doom_picture import Pose, Renderer
from tests.reference.doom_things import Blend, Thing, Weapon

VARIABLES = (
    *("CAMERA_POSITION_X", "CAMERA_POSITION_Y", "CAMERA_POSITION_Z", "CAMERA_ANGLE"),
    *("POSITION_Z", "SELECTED_WEAPON", "VELOCITY_X", "VELOCITY_Y"),
)
EPISODES = 10
# The least and the largest number of tics between two frames.
APART = 3, 40
# Every fourth frame is taken near a thing: at most this many map units away.
BESIDE = 256
# The share of gold, in 256ths, in the frame in which the vest is taken.
GOLD = 48
# The light that a shot can add, and the number of tics in which a weapon is raised.
FLASHES, RAISING = (0, 16, 32), 20
REST = 32 * ONE + ONE * 3 // 8
# What the player gets in Deathmatch, so that frames have all weapons that we have.
GIFTS = "Chainsaw", "Shotgun", "SuperShotgun", "Chaingun", "RocketLauncher", "ammo"
UNARMED = "my_way_home", "health_gathering", "health_gathering_supreme", "take_cover"

# Copies of the player: the marines' pictures, in green.
PLAYER = "PLAY+"
SPRITES = {
    "GreenArmor": "ARM1",
    "Medikit": "MEDI",
    "CustomMedikit": "MEDI",
    "Poison": "BON1",
    "DoomImp": "TROO",
    "DoomImpBall": "BAL1",
    "Demon": "SARG",
    "Cacodemon": "HEAD",
    "MarineChainsawVzd": "PLAY",
    "Zombieman": "POSS",
    "ShotgunGuy": "SPOS",
    "ChaingunGuy": "CPOS",
    "BulletPuff": "PUFF",
    "Blood": "BLUD",
    "Clip": "CLIP",
    "Shotgun": "SHOT",
    "Chaingun": "MGUN",
    "Rocket": "MISL",
    "HellKnight": "BOS2",
    "BaronBall": "BAL7",
    "TeleportFog": "TFOG",
    "Stimpack": "STIM",
    "HealthBonus": "BON1",
    "ArmorBonus": "BON2",
    "BlueArmor": "ARM2",
    "ClipBox": "AMMO",
    "ShellBox": "SBOX",
    "RocketBox": "BROK",
    "CellPack": "CELP",
    "Chainsaw": "CSAW",
    "SuperShotgun": "SGN2",
    "RocketLauncher": "LAUN",
    "PlasmaRifle": "PLAS",
    "DoomPlayer": PLAYER,
}
"""The sprites of things by their names in the game, without the prefix `Dead` of corpses."""
BLENDS: dict[str, Blend] = {"BAL1": "add", "BAL7": "add", "TFOG": "add", "PUFF": "mean"}
LIFELESS = (
    *("MEDI", "BON1", "BON2", "STIM", "AMMO", "SBOX", "BROK", "CELP", "CSAW", "SGN2", "LAUN"),
    *("PLAS", "CLIP", "SHOT", "MGUN"),
)
BRIGHT = "BAL1", "BAL7", "TFOG", "MISL"


class Look(NamedTuple):
    """A picture of a thing: sprite, frame, side, and whether the picture is bright."""

    sprite: str
    frame: str
    side: int
    bright: bool


class Seen(NamedTuple):
    """A thing, and the position of its feet in 16.16."""

    look: Look
    x: int
    y: int
    z: int


class Held(NamedTuple):
    """A picture of a weapon, and its position."""

    sprite: str
    frame: str
    x: int
    y: int
    bright: bool


@dataclass(frozen=True)
class View:
    """What a frame of the game shows, and the frame.

    Attributes:
        pose: the pose of the camera.
        things: all things.
        held: the pictures of the weapon.
        gold: the share of gold in the frame, in 256ths.
        flash: the light that a shot adds.
        frame: uint8[height, width, 3], the game's frame.
        weapons: the candidates for `held`.
    """

    pose: Pose
    things: tuple[Seen, ...]
    held: tuple[Held, ...]
    gold: int
    flash: int
    frame: np.ndarray
    weapons: tuple[tuple[Held, ...], ...] = ()


def views(
    scenario: str, size: tuple[int, int], frames: int, seed: int, particles: bool = False
) -> Iterator[View]:
    """Views of episodes, with or without particles and decals; equal seeds give equal poses.

    In scenarios without monsters, every second view is at a random place.
    """
    draw, places = random.Random(seed), open_places(scenario)

    def prepare(game: Any) -> None:
        game.set_screen_format(load_vizdoom().ScreenFormat.RGB24)
        game.set_objects_info_enabled(True)
        game.set_render_particles(particles)
        game.set_render_decals(particles)
        if places:
            # The hardest level does not allow the command `warp`.
            game.set_doom_skill(3)

    with running(scenario, seed=seed, variables=VARIABLES, size=size, prepare=prepare) as game:
        # The last buttons of some scenarios turn by an angle.
        binary = sum("DELTA" not in button.name for button in game.get_available_buttons())
        buttons = [1 << i for i in range(binary)]

        def begin() -> None:
            game.new_episode()
            if scenario == "deathmatch":
                for gift in GIFTS:
                    game.send_game_command(f"give {gift}")

        for number in range(frames):
            if number % max(2, frames // EPISODES) == 0:
                begin()
            if places and number % 2:
                near = places
                if number % 4 == 3 and (things := look(scenario, game.get_state()).things):
                    thing = draw.choice(things)
                    place = thing.x / ONE, thing.y / ONE
                    near = [other for other in places if math.dist(other, place) < BESIDE] or places
                game.send_game_command("warp {} {}".format(*draw.choice(near)))
            for held in buttons_held(draw, len(buttons)):
                game.make_action([int(held & bit > 0) for bit in buttons])
                if game.is_episode_finished():
                    begin()
                elif look(scenario, game.get_state()).gold:
                    break
            yield look(scenario, game.get_state())


def buttons_held(draw: random.Random, count: int) -> Iterator[int]:
    """Random buttons for some tics, as bits."""
    tics = draw.randint(*APART)
    while tics > 0:
        hold, held = draw.randint(1, LONGEST_HOLD), pick(draw, count)
        yield from [held] * min(hold, tics)
        tics -= hold


@functools.cache
def open_places(scenario: str) -> list[tuple[float, float]]:
    """Free places in map units: the middles of open tiles whose neighbours are all open."""
    if scenario not in ("my_way_home", "health_gathering", "health_gathering_supreme"):
        return []
    tiles = rasterise(load_map(scenario.replace("_", "-")))
    free = np.lib.stride_tricks.sliding_window_view(~tiles.solid, (3, 3)).all(axis=(2, 3))
    rows, columns = np.nonzero(free)
    x = tiles.west + (columns + 1.5) * tiles.unit
    y = tiles.north - (rows + 1.5) * tiles.unit
    return list(zip(x.tolist(), y.tolist(), strict=True))


def look(scenario: str, state: Any) -> View:
    """The view of a state of the game, with the first picture of each thing."""
    x, y, z, angle, floor, slot, *speed = (float(value) for value in state.game_variables)
    # Heights are those above the player's floor.
    pose = Pose(to_fixed(x), to_fixed(y), to_fixed(z) - to_fixed(floor), turns_of(angle))
    things = []
    for o in state.objects:
        sprite = SPRITES.get(o.name.removeprefix("Dead"))
        if sprite and math.dist((o.position_x, o.position_y), (x, y)) > 1:
            towards = math.degrees(math.atan2(o.position_y - y, o.position_x - x))
            side = int((towards - o.angle + 202.5) % 360 // 45)
            feet = map(to_fixed, (o.position_x, o.position_y, o.position_z - floor))
            things.append(Seen(Look(sprite, "A", side, sprite in BRIGHT), *feet))
    armed = scenario not in UNARMED
    weapons = guns(int(slot), state.tic, *speed) if armed else ()
    taken = scenario == "my_way_home" and not things
    frame = np.array(state.screen_buffer)
    return View(pose, tuple(things), (), GOLD if taken else 0, 0, frame, weapons)


def guns(slot: int, tic: int, dx: float, dy: float) -> tuple[tuple[Held, ...], ...]:
    """The candidates for a weapon: at rest, bobbing or being raised, with or without a flash.

    Args:
        slot: the variable SELECTED_WEAPON.
        tic: the game's count of tics.
        dx: the player's velocity along x, in map units.
        dy: likewise along y.
    """
    # It bobs by the square of the speed before friction, and is at rest while it fires.
    fast = [round(to_fixed(speed) * ONE / 59392) for speed in (dx, dy)]
    bob = min(sum(speed * speed for speed in fast) >> 18, 16 * ONE)
    phase = 128 * tic % 8192
    swing = times(bob, cosine(phase)), REST + times(bob, sine(phase % 4096))
    found = []
    for look in (WEAPON_LOOKS[one.weapon.name] for one in SLOTS if one.button == slot):
        for x, y in ((0, REST), swing):
            for letter in {*look.ready, *(one.letter for one in look.fires)}:
                gun = Held(look.sprite, letter, x, y, False)
                flashes = [Held(look.flash, one.letter, x, y, True) for one in look.flashes]
                found += [(gun,), *((gun, flash) for flash in flashes)]
        for y in range(122, 32, -6):
            lower = (REST & (ONE - 1), 0) if tic >= RAISING else (0,)
            found += [(Held(look.sprite, look.ready[0], 0, y * ONE + n, False),) for n in lower]
    return tuple(dict.fromkeys(found))


def drawn(renderer: Renderer, pictures: Wad, view: View) -> np.ndarray:
    """uint8[height, width, 3]: a view as the renderer draws it."""
    things = []
    for (sprite, frame, side, bright), x, y, z in view.things:
        blend = BLENDS.get(sprite, "cover")
        things.append(Thing(picture(pictures, sprite, frame, side), x, y, z, bright, blend))
    weapons = [Weapon(picture(pictures, h.sprite, h.frame, 0), *h[2:]) for h in view.held]
    return renderer.draw(view.pose, things, weapons, gold=view.gold, flash=view.flash)


@functools.cache
def picture(pictures: Wad, sprite: str, frame: str, side: int) -> WadPicture:
    """A picture of a sprite; marines get their own colour."""
    found = pictures.sprite(sprite[:4], frame)[side]
    if sprite != "PLAY":
        return found
    green = (found.pixels >= 112) & (found.pixels < 128)
    return dataclasses.replace(found, pixels=found.pixels - 16 * green.astype(np.int16))


@functools.cache
def looks(pictures: Wad, sprite: str, side: int) -> tuple[Look, ...]:
    """All pictures of a thing from one side."""
    names = [name for name in pictures.names("S") if name[:4] == sprite[:4]]
    frames = sorted({name[i] for name in names for i in (4, 6) if name[i:]})
    if sprite in LIFELESS:
        return tuple(Look(sprite, frame, side, False) for frame in frames)
    bright = (True,) if sprite in BRIGHT else (False, True)
    return tuple(Look(sprite, frame, side, b) for b in bright for frame in frames)


def ahead(pose: Pose, seen: Seen) -> bool:
    """Whether a thing may be in the view of an eye."""
    way = math.atan2(seen.y - pose.y, seen.x - pose.x) - pose.angle * (2 * math.pi / 2**32)
    near = math.dist((seen.x, seen.y), (pose.x, pose.y)) < BESIDE * ONE
    return near or math.cos(way) > math.cos(math.radians(60))


def fitted(renderers: Sequence[Renderer], pictures: Wad, views: Sequence[View]) -> tuple[View, ...]:
    """A view at several sizes, with the pictures that give the most equal pixels over all sizes."""

    def changed(**change: Any) -> list[View]:
        return [dataclasses.replace(view, **change) for view in current]

    def wrong(tried: Sequence[View]) -> int:
        pairs = zip(renderers, tried, strict=True)
        return sum(int((drawn(r, pictures, v) != v.frame).any(axis=-1).sum()) for r, v in pairs)

    current = list(views)
    for _ in range(2):
        if views[0].weapons:
            current = min([current, *(changed(flash=flash) for flash in FLASHES)], key=wrong)
            held = [changed(held=held) for held in views[0].weapons]
            current = min([current, *held], key=wrong)
        for number, seen in enumerate(views[0].things):
            tries, options = [current], looks(pictures, seen.look.sprite, seen.look.side)
            if options == (current[0].things[number].look,) or not ahead(views[0].pose, seen):
                continue
            for one in options:
                things = list(current[0].things)
                things[number] = seen._replace(look=one)
                tries.append(changed(things=tuple(things)))
            current = min(tries, key=wrong)
        if wrong(current) == 0:
            break
    return tuple(current)
