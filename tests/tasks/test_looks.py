"""Looks of a world: their differences and what they share."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxenstein
from jaxenstein.engine.shade import ImageKind
from jaxenstein.environment import outcome_of
from jaxenstein.errors import SettingError
from jaxenstein.maps.symbols import DOOR_LABELS
from jaxenstein.tasks.first_person import FirstPerson
from jaxenstein.tasks.looks import patterned, randomised

SIZE = {"height": 16, "width": 16}


def made(id: str = "key-door", **settings: Any) -> tuple[FirstPerson[Any, Any], Any]:
    env, params = jaxenstein.make(id, **(SIZE | settings))
    assert isinstance(env, FirstPerson)
    return env, params


def begun(count: int, id: str = "key-door", **settings: Any) -> Any:
    """First states of episodes with the keys 0, 1, ..."""
    env, params = made(id, **settings)
    keys = jax.vmap(jax.random.key)(np.arange(count, dtype=np.uint32))
    return jax.device_get(jax.jit(jax.vmap(lambda key: env.first_state(key, params)))(keys))


def test_only_random_looks_are_part_of_the_state() -> None:
    plain, patterns, drawn = (begun(2, look=look) for look in ("plain", "patterned", "random"))
    assert jax.tree.structure(plain) == jax.tree.structure(patterns)
    assert plain.look is patterns.look is None
    assert (drawn.look.dtype, drawn.look.shape) == (np.uint32, (2,))
    assert drawn.look[0] != drawn.look[1]
    rest = jax.tree.leaves(drawn.replace(look=None))
    for one, other in zip(jax.tree.leaves(plain), rest, strict=True):
        np.testing.assert_array_equal(one, other)


DRAWN: dict[str, tuple[dict[str, Any], ImageKind]] = {
    "plain": ({}, "rgb"),
    "plain labels": ({}, "labels"),
    "plain depth": ({}, "depth"),
    "patterned": ({"look": "patterned"}, "rgb"),
    "random": ({"look": "random"}, "rgb"),
    "random gray": ({"look": "random"}, "gray"),
    "random labels": ({"look": "random"}, "labels"),
    "random depth": ({"look": "random"}, "depth"),
    "no range": ({"look": "random", "look_range": 0}, "rgb"),
}


@pytest.fixture(scope="module")
def images() -> dict[str, np.ndarray]:
    """Two starts, as `DRAWN` says."""
    environments = {name: made(**settings) for name, (settings, _) in DRAWN.items()}

    @jax.jit
    @jax.vmap
    def draw(state: Any) -> dict[str, jax.Array]:
        return {n: env.draw(state, p, DRAWN[n][1]) for n, (env, p) in environments.items()}

    return jax.device_get(draw(begun(2, look="random")))


def test_looks_differ_in_colours_alone(images: dict[str, np.ndarray]) -> None:
    for one, other in itertools.combinations(("plain", "patterned", "random"), 2):
        assert (images[one] != images[other]).any(axis=(1, 2, 3)).all()
    for kind in ("labels", "depth"):
        np.testing.assert_array_equal(images[f"plain {kind}"], images[f"random {kind}"])
    luma = images["random"].astype(float) @ [0.299, 0.587, 0.114]
    assert np.abs(luma - images["random gray"]).max() <= 1


def test_range_begins_at_the_patterned_look(images: dict[str, np.ndarray]) -> None:
    np.testing.assert_array_equal(images["patterned"], images["no range"])


def test_range_bounds_colours_and_patterns() -> None:
    theme = made()[0].theme  # type: ignore[attr-defined]
    own, walls = patterned(theme).wall_colours, slice(2, DOOR_LABELS.start)
    seeds = np.arange(64, dtype=np.uint32)
    for share in (0.25, 1.0):
        looks = jax.vmap(lambda seed, s=share: randomised(theme, seed, s))(seeds)
        away = np.asarray(looks.wall_colours) - own
        full = np.maximum(own - 32, 248 - own)
        assert (np.abs(away[:, walls]) <= share * full[walls] + 1e-3).all()
        assert np.abs(away[:, walls]).max() > 0.8 * share * full[walls].max()
        changed = np.asarray(looks.wall_panels)[:, walls] != patterned(theme).wall_panels[walls]
        # Of the drawn ones, one in five is the wall's own.
        assert abs(changed.mean() - 0.8 * share) < 0.03


def test_colours_are_drawn_uniformly_and_doors_keep_theirs() -> None:
    theme = made()[0].theme  # type: ignore[attr-defined]
    seeds = np.arange(2000, dtype=np.uint32)
    looks = jax.vmap(lambda seed: randomised(theme, seed, 1.0))(seeds)
    red = np.sort(np.asarray(looks.wall_colours)[:, 5, 0])
    expected = 32 + 216 * (np.arange(2000) + 0.5) / 2000
    # Kolmogorov's bound for 2,000 values, at one in a hundred thousand.
    assert np.abs(red - expected).max() < 216 * 2.47 / np.sqrt(2000)
    pair = np.asarray(looks.wall_colours)[:, 5:7, 1]
    assert abs(np.corrcoef(pair.T)[0, 1]) < 0.1
    assert abs(np.corrcoef(pair[1:, 0], pair[:-1, 0])[0, 1]) < 0.1
    for name in ("wall_colours", "wall_panels"):
        table = np.asarray(getattr(looks, name))[:, list(DOOR_LABELS)]
        own = np.asarray(getattr(theme, name))[list(DOOR_LABELS)]
        np.testing.assert_array_equal(table, np.broadcast_to(own, table.shape))


def test_look_seeds_limit_the_looks() -> None:
    few = begun(64, look="random", look_seeds=(5, 8))
    assert set(few.look.tolist()) == {5, 6, 7}
    one = begun(4, "key-corridor-s3r1", look="random", look_seeds=range(9, 10), levels=(0, 1))
    assert set(one.look.tolist()) == {9}
    walls = np.asarray(one.level.walls)
    assert (walls == walls[:1]).all()


@pytest.mark.parametrize("id", ["simple", "key-corridor-s3r1"])
def test_each_episode_has_its_own_look(id: str) -> None:
    """With resets of the whole batch, and with resets of only the members that need one."""
    env, params = made(id, look="random")
    limit = params.replace(max_steps_in_episode=3)
    step = jax.jit(jax.vmap(functools.partial(outcome_of, env), (0, 0, 0, 0, None)))
    states, seen = begun(2, id, look="random"), []
    for i in range(6):
        seen.append(np.asarray(states.look))
        keys = jax.random.split(jax.random.key(i), 4)
        states = step(keys[:2], keys[2:], states, jnp.zeros(2, jnp.int32), limit).state
    seen.append(np.asarray(states.look))
    for number, (before, after) in enumerate(itertools.pairwise(seen), 1):
        assert ((before == after) == (number % 3 != 0)).all()


def test_doom_has_no_patterns_on_its_small_tiles() -> None:
    with pytest.raises(SettingError, match="look must be 'plain', 'random' or 'game' in Doom's"):
        made("doom-basic", look="patterned")


def test_state_without_a_look_is_refused() -> None:
    env, params = made(look="random")
    with pytest.raises(SettingError, match="a state from reset or first_state"):
        env.observe(env.init_state(jax.random.key(0), params), params)
