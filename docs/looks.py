"""Pictures of each family's first environment in its looks, for the pages.

python -m docs.looks              # all, into docs/images/looks
python -m docs.looks key-door     # that of one
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

import jaxenstein
from docs.command import each, parser_of
from docs.families import FAMILIES
from docs.gallery import GLANCE, choose
from jaxenstein.errors import SettingError
from jaxenstein.files import make_folder
from jaxenstein.tasks.first_person import FirstPerson
from jaxenstein.view.recording import save_png

IMAGES = Path(__file__).parent / "images" / "looks"
# Width and height of a view in pixels, pixels between two, and from how many starts one is chosen.
VIEW, GAP, STARTS = (136, 102), 4, 48


def has_looks(name: str) -> bool:
    """Whether an environment has other looks than the plain one."""
    try:
        jaxenstein.make(name, look="random")
    except SettingError:
        return False
    return True


IDS = tuple(family.ids[0] for family in FAMILIES if has_looks(family.ids[0]))
"""The environments that are drawn: the first of each family."""


def strip(name: str) -> np.ndarray:
    """uint8[height, width, 3]: a start of an environment plain, patterned, and in two random looks.

    The start is the one, of some, from which most can be seen.
    """
    width, height = VIEW
    env, params = jaxenstein.make(name, look="random", height=height, width=width)
    assert isinstance(env, FirstPerson)
    glance, _ = jaxenstein.make(name, observation="labels", height=GLANCE[1], width=GLANCE[0])
    keys = jax.random.split(jax.random.key(0), STARTS)
    states = jax.jit(jax.vmap(env.first_state, (0, None)))(keys, params)
    labels = jax.jit(jax.vmap(glance.observe, (0, None)))(states, params)
    start, _ = choose(np.asarray(labels)[:, None], 1)[0]
    state = jax.tree.map(lambda leaf: leaf[start], states)
    plain, patterned = (
        jaxenstein.make(name, look=look, height=height, width=width)[0]
        for look in ("plain", "patterned")
    )
    seen = [(plain, state), (patterned, state)]
    seen += [(env, state.replace(look=np.uint32(seed))) for seed in (1, 6)]
    return _side_by_side([_frame(one, state, params) for one, state in seen])


def _frame(env: Any, state: Any, params: Any) -> np.ndarray:
    return np.asarray(jax.jit(env.observe)(state, params))


def _side_by_side(frames: Sequence[np.ndarray]) -> np.ndarray:
    gap = np.full((VIEW[1], GAP, 3), 255, np.uint8)
    return np.concatenate([part for frame in frames for part in (gap, frame)][1:], axis=1)


def main(argv: Sequence[str] | None = None) -> None:
    """Draw the pictures and write them."""
    options = parser_of("docs.looks", __doc__).parse_args(argv)
    folder = make_folder(IMAGES)
    for name in each(options.ids or IDS, "drawing"):
        save_png(strip(name), folder / f"{name}.png")


if __name__ == "__main__":
    main()
