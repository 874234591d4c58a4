"""Levels held out by content: both splits compared with sets of levels on the host."""

import dataclasses
import functools
import itertools
import json
import math
import warnings
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein import level_counts
from jaxenstein.catalogue import ENTRIES
from jaxenstein.errors import LevelWarning, SettingError
from jaxenstein.settings import changed, spec_from
from jaxenstein.tasks import splits
from jaxenstein.tasks.first_person import GeneratedTask
from reliability import levels as counting

SIZE = {"height": 8, "width": 12}
CORRIDOR, DOORS, CROSSING = "key-corridor-s3r2", "minigrid-red-blue-doors-6x6", "minigrid-memory-s7"
# One id of each family that draws levels, with few and with very many levels.
FEW = (
    "key-corridor-s3r1", DOORS,
    *(pytest.param(name, marks=pytest.mark.variant) for name in (
        "miniworld-maze-s3", "minigrid-dynamic-obstacles-random-5x5")),
)  # fmt: skip
MANY = (
    CORRIDOR,
    *(pytest.param(name, marks=pytest.mark.variant) for name in (
        "dmlab-explore-goal-locations", "dmlab-explore-object-rewards", "memory-maze-9x9",
        "minigrid-obstructed-maze-1dlh", "miniworld-pickup-objects")),
)  # fmt: skip


def made(name: str, **settings: Any) -> Any:
    return jaxenstein.make(name, **SIZE, **settings)[0]


@functools.cache
def first_states(env: Any, count: int, seed: int = 0) -> Any:
    params = env.check_params()
    keys = jax.random.split(jax.random.key(seed), count)
    draw = jax.jit(lambda keys: jax.vmap(lambda key: env.first_state(key, params))(keys))
    return jax.device_get(draw(keys))


def visible_content(env: Any, states: Any, i: int) -> str:
    """The content of a level as a person sees it, independent of the package's own definition."""
    state = jax.tree.map(lambda leaf: leaf[i], states)
    level = state.level
    said: list[Any] = [level.walls.tolist(), level.row_bits.tolist()]
    if hasattr(state, "asked"):
        things = state.things
        rows = zip(*(x.tolist() for x in (things.kind, things.colour, things.tile)), strict=True)
        there = [(row, int(place)) for row, place in zip(rows, things.place, strict=True)]
        said += [sorted(row for row in there if row[1] != 3), state.asked.tolist()]
        if not env.name.startswith("miniworld"):
            said += [state.position.tolist(), round(float(state.heading), 3)]
    elif env.name.startswith("key-corridor"):
        said += [state.key.tolist(), state.goal.tolist(), int(state.key_colour)]
    elif env.name.startswith("memory-maze"):
        said += [state.things.tolist()]
    elif env.name == "dmlab-explore-object-rewards":
        said += [sorted(state.places.tolist()), state.good.tolist()]
    elif env.name.startswith("dmlab"):
        said += [state.things.tolist()]
    else:
        said += [[int(x // 4) for x in (state.goal - 1).tolist()]]
    return json.dumps(said)


def contents_of(env: Any, states: Any) -> list[str]:
    return [visible_content(env, states, i) for i in range(len(states.heading))]


def levels_of_splits(name: str, count: int, **settings: Any) -> list[set[str]]:
    """The visible content of training and test levels."""
    sides = []
    for split in ("train", "test"):
        env = made(name, split=split, test_fraction=0.4, **settings)
        sides.append(set(contents_of(env, first_states(env, count, seed=1))))
    return sides


@pytest.mark.parametrize("name", FEW)
def test_no_level_is_in_both_splits(name: str) -> None:
    """By visible content, over thousands of draws, in which most levels come several times."""
    train, test = levels_of_splits(name, 3000)
    assert not train & test
    every = level_counts.level_counts()[name].levels
    assert 0.9 * every < len(train | test) <= every


@pytest.mark.parametrize("name", MANY)
def test_no_level_of_given_seeds_is_in_both_splits(name: str) -> None:
    """With few seeds, so that each level repeats; both sides together are all levels."""
    train, test = levels_of_splits(name, 250, levels=(100, 130))
    assert not train & test
    env = made(name, levels=(100, 130))
    assert train | test == set(contents_of(env, first_states(env, 250)))


@pytest.mark.slow
@pytest.mark.parametrize("name", MANY)
def test_none_of_thousands_of_levels_is_in_both_splits(name: str) -> None:
    train, test = levels_of_splits(name, 2000)
    assert not train & test
    assert min(len(train), len(test)) > 100


def test_order_of_things_does_not_change_the_level() -> None:
    env = made("minigrid-fetch-8x8-n3")
    state = env.first_state(jax.random.key(0), env.check_params())
    turned = state.replace(things=jax.tree.map(lambda leaf: leaf[::-1], state.things))
    other = state.replace(things=state.things.replace(kind=1 - state.things.kind))
    words = [splits.fingerprint(env.level_parts(s)).tolist() for s in (state, turned, other)]
    assert words[0] == words[1] != words[2]


@pytest.mark.parametrize(
    "name", [CORRIDOR, pytest.param("memory-maze-9x9", marks=pytest.mark.variant), DOORS]
)
@pytest.mark.parametrize("fraction", [0.1, 0.5])
def test_share_of_test_levels_equals_test_fraction(name: str, fraction: float) -> None:
    env = made(name)
    states = first_states(env, 3000, seed=3)
    draw = jax.vmap(lambda state: splits.fingerprint(env.level_parts(state)))
    held = jax.jit(jax.vmap(lambda level: splits.is_in_split("test", fraction, level)))(
        draw(states)
    )
    sides = dict(zip(contents_of(env, states), np.asarray(held).tolist(), strict=True))
    count = len(sides)
    error = math.sqrt(fraction * (1 - fraction) / count)
    assert abs(sum(sides.values()) / count - fraction) < 4 * error


def test_hash_matches_its_definition() -> None:
    """Against the definition in Python integers."""
    most = 2**32 - 1

    def mixed(word: int) -> int:
        word = (word ^ word >> 16) * 0x7FEB352D & most
        word = (word ^ word >> 15) * 0x846CA68B & most
        return word ^ word >> 16

    rng = np.random.default_rng(0)
    parts = (
        rng.integers(-9, 9, (3, 5), np.int32),
        np.array([True, False]),
        np.array([255, 0, 7], np.uint8),
    )
    words = [x & most for part in parts for x in map(int, part.ravel())]
    halves = []
    for half in range(2):
        keys = [mixed((half * len(words) + i + 1) * 0x9E3779B9 & most) for i in range(len(words))]
        total = sum(mixed(w ^ key) for w, key in zip(words, keys, strict=True)) & most
        halves.append(mixed(total))
    assert splits.fingerprint([jnp.asarray(part) for part in parts]).tolist() == halves


def test_test_split_grows_with_the_fraction() -> None:
    levels = splits.sample_levels(made(DOORS), 500, 1)
    few, many = (np.asarray(splits.is_in_split("test", share, levels.T)) for share in (0.1, 0.6))
    assert few.any()
    assert not (few & ~many).any()
    np.testing.assert_array_equal(many, ~np.asarray(splits.is_in_split("train", 0.6, levels.T)))


@pytest.mark.parametrize("name", [CORRIDOR, DOORS])
def test_split_does_not_change_levels_it_accepts(name: str) -> None:
    """The same key gives the same level, alone and in a batch."""
    env, split = made(name), made(name, split="test", test_fraction=0.5)
    every, right = first_states(env, 200), first_states(split, 200)
    same = [a == b for a, b in zip(contents_of(env, every), contents_of(env, right), strict=True)]
    levels = jax.vmap(lambda state: splits.fingerprint(env.level_parts(state)))(every)
    held = np.asarray(splits.is_in_split("test", 0.5, levels.T))
    assert 60 < held.sum() < 140
    assert all(np.array(same)[held])
    for a, b in zip(jax.tree.leaves(every), jax.tree.leaves(right), strict=True):
        np.testing.assert_array_equal(a[held], b[held])
    alone = jax.jit(split.first_state)
    keys = jax.random.split(jax.random.key(0), 200)
    for i in np.flatnonzero(~held)[:8]:
        one = jax.device_get(alone(keys[i], split.check_params()))
        jax.tree.map(lambda a, b, i=i: np.testing.assert_array_equal(a, b[i]), one, right)


@pytest.mark.usefixtures("plain_frames")
def test_every_reset_of_a_batch_stays_in_its_split() -> None:
    """Inside steps and a scan, with old keys, and for a single environment."""
    name, sides = "key-corridor-s3r1", []
    for split in ("train", "test"):
        env = made(name, split=split, test_fraction=0.3)
        params = env.default_params.replace(max_steps_in_episode=2)

        def play(keys: jax.Array, env: Any = env, params: Any = params) -> Any:
            _, state = jax.vmap(env.reset, (0, None))(keys, params)

            def step(state: Any, turn: jax.Array) -> tuple[Any, Any]:
                step_keys = jax.vmap(jax.random.fold_in, (0, None))(keys, turn)
                act = jax.vmap(env.step, (0, 0, None, None))
                state = act(step_keys, state, jnp.int32(9), params)[1]
                return state, state

            return jax.lax.scan(step, state, jnp.arange(20))[1]

        keys = jax.random.split(jax.random.PRNGKey(5), 40)
        states = jax.device_get(jax.jit(play)(keys))
        firsts = jax.tree.map(lambda leaf, at=states.time == 0: leaf[at], states)
        assert len(firsts.heading) == 400
        sides.append(set(contents_of(env, firsts)))
        _, one = env.reset(keys[0], params)
        assert splits.is_in_split(split, 0.3, splits.fingerprint(env.level_parts(one)))
    assert not sides[0] & sides[1]
    assert sum(map(len, sides)) == 6 * 6


def test_split_of_given_seeds_has_only_their_levels() -> None:
    env = made(DOORS, levels=(5, 17))
    chosen = set(contents_of(env, first_states(env, 400)))
    found = []
    for split in ("train", "test"):
        part = made(DOORS, levels=(5, 17), split=split, test_fraction=0.5)
        found.append(set(contents_of(part, first_states(part, 400))))
    assert found[0] | found[1] == chosen
    assert not found[0] & found[1]


def test_rewards_are_differentiable_beside_resets() -> None:
    env, params = jaxenstein.make(DOORS, **SIZE, split="test")
    _, state = env.reset(jax.random.key(0), params)

    def paid(living_reward: Any) -> Any:
        changed_params = params.replace(living_reward=living_reward)
        return env.step(jax.random.key(1), state, 2, changed_params)[2]

    assert jax.grad(paid)(-0.5) == 1


def test_search_for_a_level_always_ends() -> None:
    def draw(key: jax.Array, given: Any) -> jax.Array:
        return jax.random.bits(key) + given

    never = jax.jit(
        lambda key: splits.first_accepted(
            draw, lambda _: jnp.bool_(False), jnp.bool_(True), key, jnp.uint32(0)
        )
    )
    assert never(jax.random.key(0)).shape == ()


def test_empty_splits_are_refused() -> None:
    for split, (empty, fraction) in itertools.product(
        ("train", "test"), (("test", 1e-6), ("train", 1 - 1e-6))
    ):
        with pytest.raises(SettingError, match=f"the {empty} split of 'minigrid-lava-gap-s5' has"):
            made("minigrid-lava-gap-s5", split=split, test_fraction=fraction)
    level = np.asarray(splits.sample_levels(made(CORRIDOR, levels=(3, 4)), 1, 0))[0]
    empty = "train" if splits.is_in_split("test", 0.2, level) else "test"
    with pytest.raises(SettingError, match="with levels=\\(3, 4\\) has no levels: 4096 draws"):
        made(CORRIDOR, levels=(3, 4), split=empty)
    made(CORRIDOR, levels=(3, 4), split="test" if empty == "train" else "train")
    with pytest.raises(SettingError, match="test_fraction needs a split"):
        made(CORRIDOR, test_fraction=0.3)
    with pytest.raises(SettingError, match="split must be one of 'train', 'test', None"):
        made(CORRIDOR, split="tets")
    with pytest.raises(SettingError, match="test_fraction must be a finite number above 0"):
        made(CORRIDOR, split="test", test_fraction=1.0)
    with pytest.raises(SettingError, match="unknown setting 'split'"):
        made("simple", split="test")


def test_warns_if_many_seeds_have_few_levels() -> None:
    with pytest.warns(LevelWarning, match="has 1,024 levels, and .* about 18% of them"):
        made(DOORS, levels=(0, 200))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made(DOORS, levels=(0, 20))
        made("memory-maze-9x9", levels=(0, 10_000))
        made("minigrid-lava-gap-s5", levels=(4, 5))
        # Its id has one level, but with this setting it has many.
        made("minigrid-empty-8x8", random_start=True, levels=(0, 20))
    with pytest.warns(LevelWarning, match="split='train' and split='test'"):
        spec_from({"env": DOORS, "settings": {"levels": (0, 200)}})


def test_flags_can_change_and_remove_a_split() -> None:
    given = {"env": DOORS, "settings": {"split": "train", "test_fraction": 0.5}}
    spec = spec_from(given)
    other: Any = changed(spec, {"settings": {"split": "test"}}).build()[0]
    assert (other.split, other.test_fraction) == ("test", 0.5)
    every: Any = changed(spec, {"settings": {"split": None}}).build()[0]
    assert (every.split, every.test_fraction) == (None, 0.2)


# Numbers of levels.


def _key_door(size: int) -> int:
    """Start tile and heading, key, door's row and wall's column of minigrid-door-key-NxN."""
    found = set()
    for wall, door in itertools.product(range(2, size - 2), range(1, size - 2)):
        near = list(itertools.product(range(1, wall), range(1, size - 1)))
        for start, heading, key in itertools.product(near, range(4), near):
            if key != start:
                found.add((wall, door, start, heading, key))
    return len(found)


def _memory(size: int) -> int:
    """The first thing, which of two ends it is at, and the start in the hall."""
    return len(set(itertools.product(range(2), range(2), range(1, size - 2))))


def _mazes(side: int) -> int:
    """The trees of corridors that recursive backtracking from a corner can dig."""
    cells = set(itertools.product(range(side), range(side)))
    found = set()

    def dig(way: tuple, met: frozenset, tree: frozenset) -> None:
        if not way:
            found.add(tree)
            return
        column, row = way[-1]
        around = {(column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)}
        ahead = around & cells - met
        for cell in ahead:
            dig((*way, cell), met | {cell}, tree | {frozenset((way[-1], cell))})
        if not ahead:
            dig(way[:-1], met, tree)

    dig(((0, 0),), frozenset([(0, 0)]), frozenset())
    return len(found)


SMALL = {
    # Places of the only gap in a stream that can be nowhere else.
    "minigrid-lava-gap-s5": 3,
    # The streams of two columns, and a gap of four rows.
    "minigrid-lava-gap-s6": 2 * 4,
    # Nine tiles less the goal's, four headings.
    "minigrid-empty-random-5x5": (9 - 1) * 4,
    "minigrid-empty-5x5": 1,
    # Sixteen tiles, four headings, four rows of either door.
    DOORS: 16 * 4 * 4 * 4,
    # Colours of the key with its door, and of the other door; all else has one place.
    "key-corridor-s3r1": 6 * 6,
    "minigrid-door-key-5x5": _key_door(5),
    CROSSING: _memory(7),
    "minigrid-door-key-6x6": _key_door(6),
    # Three places of a wall in either direction, with a gap of seven tiles.
    "minigrid-lava-crossing-s9n1": 2 * 3 * 7,
    # Two equal balls, on the tiles without the goal and the start.
    "minigrid-dynamic-obstacles-5x5": math.comb(7, 2),
    "minigrid-dynamic-obstacles-random-5x5": 8 * 4 * math.comb(7, 2),
    # The cell of the box, in all mazes.
    "miniworld-maze-s2": 4 * _mazes(2),
    "miniworld-maze-s3": 9 * _mazes(3),
    # As of key-corridor-s3r1, with the start's three headings and the ball's colour.
    "minigrid-key-corridor-s3r1": 6 * 6 * 3 * 6,
    # The two kinds that may be asked for, and three colours of the sign.
    "miniworld-sign": 2 * 3,
}


@pytest.mark.parametrize("name", SMALL)
def test_stored_level_counts_are_right_for_small_worlds(name: str) -> None:
    count = level_counts.level_counts()[name]
    assert (count.levels, count.exact) == (SMALL[name], True)


@pytest.mark.parametrize("name", ["minigrid-lava-gap-s5", "key-corridor-s3r1"])
def test_counting_finds_the_stored_number(name: str) -> None:
    assert counting.count_levels(made(name)) == (SMALL[name], True)


def test_every_generated_environment_is_counted() -> None:
    stored = level_counts.level_counts()
    assert list(stored) == counting.generated_ids()
    for name, count in stored.items():
        assert count.version == ENTRIES[name].version
        assert count.exact or count.levels >= 1000
    assert stored["memory-maze-9x9"].words == "at least 10,000"
    assert stored["key-corridor-s3r1"].short == "36"


def test_counting_stops_early_and_writes_one_line_per_task(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "counts.json"
    monkeypatch.setattr(counting, "FILE", file)
    monkeypatch.setattr(counting, "ENOUGH", 100)
    monkeypatch.setattr(counting, "BATCH", 256)
    monkeypatch.setattr(counting, "generated_ids", lambda: [DOORS])
    assert counting.main([DOORS]) == 0
    assert capsys.readouterr().out == f"{DOORS}: at least 100 (changed)\n"
    assert json.loads(file.read_text()) == {DOORS: {"levels": 100, "exact": False, "version": 0}}
    assert counting.main([DOORS, "--check"]) == 1


def test_custom_task_defines_its_levels() -> None:
    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Own(type(made(CORRIDOR))):  # type: ignore[misc]
        level_parts = GeneratedTask.level_parts

    env = Own(**SIZE, split="test")
    with pytest.raises(SettingError, match="Own has no split: define level_parts"):
        env.reset(jax.random.key(0))
