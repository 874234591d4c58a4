"""How the arrays of any environment's observations are classified and scaled."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.observations import ObservationSpec, Part, observation_spec
from jaxenstein.errors import SettingError
from jaxenstein.spaces import Box, Dict, Discrete


class Sensors:
    """An environment with only an observation and its space."""

    def __init__(self, obs: Any, space: Any, observation: str = "") -> None:
        self.obs, self.space, self.observation = obs, space, observation

    def reset(self, key: jax.Array, params: Any) -> tuple[Any, None]:
        return jax.tree.map(jnp.zeros_like, self.obs), None

    def observation_space(self, params: Any) -> Any:
        return self.space


def parts(obs: Any, space: Any, observation: str = "") -> tuple[Part, ...]:
    return observation_spec(Sensors(obs, space, observation), None).parts


@pytest.mark.parametrize(
    ("array", "space", "part"),
    [
        (np.zeros((9, 8), np.uint8), None, Part((9, 8), True, "bounds", 0, 255)),
        (np.zeros((9, 7), np.uint8), None, Part((9, 7), False, "bounds", 0, 255)),
        (np.zeros((), np.int32), Discrete(5), Part((), False, "bounds", 0, 4)),
        # A space of one value has no width to scale by.
        (np.zeros((), np.int32), Discrete(1), Part((), False, "log")),
        (np.zeros(2, bool), None, Part((2,), False, "bounds", 0, 1)),
        (np.zeros(3, np.float32), Box(-1, 2, (3,), np.dtype(np.float32)),
         Part((3,), False, "bounds", -1, 2)),
        (np.zeros((8, 8), np.float32), Box(0, math.inf, (8, 8), np.dtype(np.float32)),
         Part((8, 8), True, "distance")),
        (np.zeros(3, np.float32), None, Part((3,), False, "log")),
    ],
)  # fmt: skip
def test_kinds_of_arrays(array: np.ndarray, space: Any, part: Part) -> None:
    assert parts(array, space) == (part,)


def test_labels_get_distinct_bits() -> None:
    spec = ObservationSpec((Part((8, 8), True, "bits"),))
    ids = jnp.arange(128, dtype=jnp.uint8).reshape(2, 8, 8)
    (bits,), _ = spec.prepare(ids, jnp.float32)
    assert len(np.unique(np.asarray(bits).reshape(128, 8), axis=0)) == 128


def test_unbounded_numbers_are_scaled_near_one() -> None:
    spec = ObservationSpec((Part((8, 8), True, "distance"), Part((3,), False, "log")))
    far = jnp.array([0, 1, 3, jnp.inf] * 16, jnp.float32).reshape(8, 8)
    numbers = jnp.array([-1e6, 0, math.e - 1], jnp.float32)
    (near,), vector = spec.prepare([far, numbers], jnp.float32)
    np.testing.assert_allclose(near[0, :4, 0], [1, 0.5, 0.25, 0])
    np.testing.assert_allclose(vector, [-math.log(1e6 + 1), 0, 1], rtol=1e-6)


def test_only_label_images_become_bits() -> None:
    ids = np.zeros((8, 8), np.uint8)
    assert parts(ids, None, "labels") == (Part((8, 8), True, "bits"),)
    assert parts(ids[:4], None, "labels") == (Part((4, 8), False, "bounds", 0, 255),)


def test_parts_of_a_dict_keep_their_own_bounds() -> None:
    obs = {"image": np.zeros((8, 8, 3), np.uint8), "health": np.zeros((), np.float32)}
    space = Dict({
        "health": Box(0, 100, (), np.dtype(np.float32)),
        "image": Box(0, 255, (8, 8, 3), np.dtype(np.uint8)),
    })  # fmt: skip
    spec = ObservationSpec(parts(obs, space))
    assert spec.images == ((8, 8, 3),)
    assert spec.vector == 1
    batch = {"image": jnp.full((5, 8, 8, 3), 255, jnp.uint8), "health": jnp.full(5, 25.0)}
    (image,), vector = spec.prepare(batch, jnp.float32)
    np.testing.assert_array_equal(image, np.ones((5, 8, 8, 3)))
    np.testing.assert_allclose(vector, np.full((5, 1), 0.25))


@pytest.mark.parametrize("array", [np.zeros((2, 3, 4, 5), np.float32), np.zeros(2, np.complex64)])
def test_error_names_unsupported_observation(array: np.ndarray) -> None:
    with pytest.raises(SettingError, match=r"\['far'\] must be an array of numbers with at most"):
        parts({"far": array}, None)
