"""Custom shooters: maps, pickups, wins and losses."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.errors import MapError, MapWarning, SettingError
from jaxenstein.maps.things import THINGS, ZOMBIE
from jaxenstein.tasks.doom.fixed import ONE
from jaxenstein.tasks.doom.maps import DoomMap, outline, rasterise
from jaxenstein.tasks.shooter import KINDS, ROCKET_LAUNCHER, Shooter
from tests.tasks.doom.cases import player

SIZE: dict[str, Any] = {"height": 12, "width": 16, "autoreset": None}
# The way east: a medkit, ammunition, the goal; a zombie behind a wall.
LANE = """
##########
#S..+.=.G#
########.#
#......z.#
##########
"""
DEN = "#########\n#S....z.#\n#########"


@pytest.mark.parametrize("seed", range(4))
def test_outline_encloses_the_open_tiles(seed: int) -> None:
    """Against the way by which the maps of the game become tiles, which also checks the sides."""
    solid = np.random.default_rng(seed).random((9, 12)) < 0.4
    walls = outline(solid, 64)
    tiles = rasterise(DoomMap(walls, (), 0, 128, 255), 64)
    found = np.ones((11, 14), bool)
    row, column = 10 - tiles.north // 64, tiles.west // 64 + 1
    rows, columns = tiles.solid.shape
    found[row : row + rows, column : column + columns] = tiles.solid
    np.testing.assert_array_equal(found, np.pad(solid, 1, constant_values=True))
    padded = np.pad(~solid, 1).astype(int)
    borders = np.abs(np.diff(padded, axis=0)).sum() + np.abs(np.diff(padded, axis=1)).sum()
    assert sum(abs(w.x1 - w.x0) + abs(w.y1 - w.y0) for w in walls) == 64 * borders
    # Each is as long as possible: no other one continues at its end.
    starts, ends = ({p[i : i + 2] for p in map(_points, walls)} for i in (0, 2))
    straight = [
        (one, other)
        for one in walls
        for other in walls
        if _points(one)[2:] == _points(other)[:2] and _way(one) == _way(other)
    ]
    assert not straight
    assert starts == ends


def _points(wall: Any) -> tuple[int, int, int, int]:
    return wall.x0, wall.y0, wall.x1, wall.y1


def _way(wall: Any) -> tuple[int, int]:
    return int(np.sign(wall.x1 - wall.x0)), int(np.sign(wall.y1 - wall.y0))


def test_every_monster_symbol_has_a_kind_and_pictures() -> None:
    rows = [thing for thing in THINGS if thing.role == "monster"]
    assert {thing.symbols for thing in rows} == set(KINDS)
    for thing in rows:
        assert KINDS[thing.symbols].label == thing.label


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("####\n#Sz?\n####", r"line 2, column 4: unknown symbol '\?'.* G \+ d m i z s c = # 1"),
        ("####\n#SzR\n####", r"line 2, column 4: 'R' \(locked red door\) is not allowed here"),
        ("####\n#Sza\n####", r"line 2, column 4: 'a' \(apple\) is not allowed here"),
        ("####\n#zz#\n####", "no spawn"),
        ("####\n#SG#\n####", r"1 to 64 monsters \(z s c i d m\), but this map has 0"),
        ("S" + "z" * 65, "66 columns and 1 rows is too large for a shooter"),
        ("S" + "z" * 32 + "\n" + "z" * 33, "1 to 64 monsters .* has 65"),
        (3, "not int"),
    ],
)
def test_invalid_maps_are_refused(text: Any, message: str) -> None:
    with pytest.raises(MapError, match=f"(?s){message}"):
        Shooter(text=text)


def test_monsters_are_refused_in_other_maps() -> None:
    with pytest.raises(
        MapError, match=r"line 1, column 3: 'z' \(zombie\) is only allowed in shooters"
    ):
        jaxenstein.from_ascii("SGz")
    with pytest.warns(MapWarning, match="no path reaches this goal"):
        Shooter(text="Sz#G")


def test_impossible_settings_are_refused() -> None:
    with pytest.raises(SettingError, match="a kind for 'x', which is not one of the symbols 'z'"):
        Shooter(text=DEN, monsters={"x": KINDS["z"]})
    with pytest.raises(SettingError, match="ammo must be a whole number from 0"):
        Shooter(text=DEN, ammo=-1)
    with pytest.raises(SettingError, match="heading must be"):
        Shooter(text=DEN, heading=4000)
    with pytest.raises(SettingError, match="wad is only for Doom's scenarios"):
        Shooter(text=DEN, wad="a.wad")
    with pytest.raises(SettingError, match="samples is only for Doom's scenarios"):
        Shooter(text=DEN, samples=2)
    assert repr(Shooter(text=DEN, heading=90)) == "Shooter('custom', heading=90)"


def opened(text: str, **settings: Any) -> Any:
    """A shooter, its first state, and a function that plays it."""
    env = Shooter(text=text, heading=0, **SIZE, **settings)
    params = env.check_params()
    return env, env.first_state(jax.random.key(0), params), player(env, params)


@pytest.fixture(scope="module")
def lane() -> Any:
    """The way east, its first state, and a function that runs along it for 110 tics."""
    env, state, play = opened(LANE)
    return env, state, lambda state: play(state, [env.index_of("forward")] * 110)


def test_initial_state_matches_the_map(lane: Any) -> None:
    env, state, _ = lane
    # The second column and row of five, from the south-western corner.
    assert (np.asarray(state.fixed_position) / ONE).tolist() == [96, 3.5 * 64]
    assert state.position.tolist() == [1.5, 1.5]
    assert int(state.angle) == 0
    assert (np.asarray(state.monsters.position) / ONE).tolist() == [[7.5 * 64, 1.5 * 64]]
    assert state.monsters.health.tolist() == [20]
    assert env.fireballs.count == 0
    assert env.horde.kinds == (KINDS["z"],)
    assert (env.goal_part.places / ONE / 64).tolist() == [[8.5, 3.5]]


def test_touching_takes_supplies_and_goal_ends_the_episode(lane: Any) -> None:
    _, state, run = lane
    hurt = state.replace(health=jnp.int32(90))
    reward, ends, info, after = run(hurt)
    x, left = after.fixed_position[:, 0] / ONE, after.supplies
    for event, column, slot in (("took_medkit", 4.5, 0), ("took_ammunition", 6.5, 1)):
        first = int(np.flatnonzero(info[event])[0])
        assert info[event].sum() == 1
        assert first == np.flatnonzero(x > 64 * column - 36)[0]
        assert left[:, slot].tolist() == [True] * first + [False] * (110 - first)
    won = int(np.flatnonzero(info["won"])[0])
    assert (int(info["health"][won]), int(info["ammo"][won])) == (100, 60)
    assert won == np.flatnonzero(x > 64 * 8.5 - 36)[0] == np.flatnonzero(ends)[0]
    assert info["success"][won]
    assert reward[: won + 1].tolist() == [0] * won + [10]


def test_unneeded_supplies_stay(lane: Any) -> None:
    env, state, run = lane
    full = state.replace(trigger=state.trigger.replace(ammo=jnp.int32(env.most_ammo)))
    _, _, info, after = run(full)
    assert after.supplies.all()
    assert not info["took_medkit"].any()
    assert not info["took_ammunition"].any()


@pytest.fixture(scope="module")
def den() -> Any:
    """One zombie ahead."""
    return opened(DEN)


def test_last_kill_wins_without_a_goal(den: Any) -> None:
    env, state, play = den
    weak = state.replace(monsters=state.monsters.replace(health=jnp.ones(1, jnp.int32)))
    reward, ends, info, _ = play(weak, [env.index_of("attack")] * 150)
    # The pistol's first bullet leaves in tic 4, exactly ahead.
    assert np.flatnonzero(ends).tolist()[:1] == [4]
    assert reward[:5].tolist() == [0, 0, 0, 0, 11]
    assert (int(info["killed"][4]), bool(info["success"][4]), int(info["ammo"][4])) == (1, True, 49)


def test_idle_player_dies_and_does_not_win(den: Any) -> None:
    _, state, play = den
    awake = state.monsters.replace(alarmed=jnp.ones(1, bool))
    state = state.replace(health=jnp.int32(1), monsters=awake)
    died = 0
    for seed in range(12):
        reward, ends, info, _ = play(state, [0] * 150, seed)
        if ends.any():
            tic = int(ends.argmax())
            died += bool(info["died"][tic])
            assert reward[tic] == -1
            assert not info["success"][tic]
            assert info["health"][tic] == 0
    assert 0 < died <= 12


def test_params_change_health_of_monsters(den: Any) -> None:
    env, *_ = den
    params = env.check_params().replace(monster_health=2.5)
    assert env.first_state(jax.random.key(0), params).monsters.health.tolist() == [50]
    assert env.first_state(jax.random.key(0), params.replace(monster_health=0)).monsters.living


def test_monster_ahead_is_visible() -> None:
    env = Shooter(text=DEN, heading=0, observation="labels", height=48, width=64)
    obs, _ = env.reset(jax.random.key(0), env.check_params())
    # Its trunk, straight ahead and just below the eye; the walls on either side are nearer.
    assert (np.asarray(obs)[24:26, 31:33] == ZOMBIE.label).all()
    assert (np.asarray(obs)[:, [0, 63]] != ZOMBIE.label).all()


def test_random_looks_work_as_on_other_maps() -> None:
    env = Shooter(text=DEN, heading=0, look="random", height=24, width=32)
    reset = jax.jit(jax.vmap(lambda key: env.reset(key, env.check_params())))
    obs, states = reset(jax.random.split(jax.random.key(0), 3))
    assert len(set(np.asarray(states.look).tolist())) == 3
    seen = np.asarray(obs)
    assert (seen[0] != seen[1]).any()
    assert (seen[1] != seen[2]).any()
    # The zombie has its own colours.
    np.testing.assert_array_equal(seen[0, 12, 15:17], seen[1, 12, 15:17])


@pytest.fixture(scope="module")
def gallery() -> Any:
    """Two zombies asleep ahead, one behind a wall; a function that fires once and waits."""
    text = "#########\n#S...zz.#\n#########\n#....z..#\n#########"
    env, state, play = opened(text, weapon=ROCKET_LAUNCHER)
    # Nobody looks, moves or hears before the rocket is there.
    asleep = state.monsters.replace(tics=jnp.full(3, 1000, jnp.int32))
    strong = asleep.replace(health=jnp.full(3, 1000, jnp.int32))
    actions = [env.index_of("attack")] + [0] * 39
    return state.replace(monsters=strong), lambda state: play(state, actions)


def test_rocket_damages_everything_around_but_not_behind_walls(gallery: Any) -> None:
    state, play = gallery
    _, _, info, after = play(state)
    rockets, health, own = after.rockets, after.monsters.health, after.health
    # It leaves in tic 8, half a tic ahead, and flies 20 units a tic.
    assert np.flatnonzero(info["shots"]).tolist() == [8]
    x = rockets.position[8:, 0, 0] / ONE
    assert x[:5].tolist() == [96 + 30 + 20 * tic for tic in range(5)]
    # The first zombie's middle is at 352: the boxes meet nearer than 20 + 11, in thirds of a tic.
    path = 96 + 10 + 20 / 3 * np.arange(1, 60)
    end = path[np.flatnonzero(path > 352 - 31)[0]]
    tic = int(np.flatnonzero(~rockets.flies[8:, 0])[0]) + 8
    assert rockets.position[tic, 0, 0] / ONE == pytest.approx(end, abs=0.01)
    assert (health[:tic] == 1000).all()
    lost = 1000 - health[tic]
    # A hit is 20 times a die of eight; the blast is 128 less the distance to a body's side.
    hit, rest = divmod(lost[0] - (128 - int(352 - 20 - end)), 20)
    assert 1 <= hit <= 8
    assert rest == 0
    assert lost[1] == 128 - int(416 - 20 - end)
    assert lost[2] == 0
    assert (health[tic : tic + 8] == health[tic]).all()
    assert (own[: tic + 1] == 100).all()


def test_rocket_at_a_near_wall_hurts_the_player(gallery: Any) -> None:
    state, play = gallery
    _, _, info, after = play(state.replace(angle=jnp.uint32(1 << 31)))
    rockets, own = after.rockets, after.health
    # The wall is 32 units behind the start, 16 from the player's side.
    tic = int(np.flatnonzero(~rockets.flies[8:, 0])[0]) + 8
    assert tic == 8
    end = rockets.position[tic, 0, 0] / ONE
    assert own[tic] == max(100 - (128 - max(int(abs(96 - end) - 16), 0)), 0) == 0
    assert info["died"][tic]
