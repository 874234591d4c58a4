"""Playing one episode and keeping what pictures of it need."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..view.progress import Progress
from ..view.recording import Episode
from .frames import image_of, picture
from .policies import Policy

if TYPE_CHECKING:
    from ..maps.tilemap import TileMap
    from ..tasks.first_person import FirstPerson

# Events of `info` in words: for one, and for several where it is a count.
EVENTS: dict[str, tuple[str, str]] = {
    "picked_key": ("picked up a key", "picked up {} keys"),
    "opened_door": ("opened a door", "opened {} doors"),
    "ate_apple": ("ate an apple", "ate {} apples"),
    "took_medkit": ("took a medkit", "took {} medkits"),
    "reached_goal": ("reached the goal", "reached the goal"),
    "respawned": ("moved to a new start", "moved to a new start"),
    "died": ("died", "died"),
}
# What `describe` says of a state that the caption shows.
VARIABLES = ("health",)


def play(env: FirstPerson[Any, Any], params: Any, policy: Policy, steps: int, seed: int) -> Episode:
    """Play one episode, or the first `steps` steps of it.

    Args:
        env: an environment made with `autoreset=None`.
        params: its params.
        policy: chooses the actions.
        steps: the most steps to take, at least 1.
        seed: of the reset and the steps.
    """
    import jax

    key = jax.random.key(seed)
    key, reset_key = jax.random.split(key)
    obs, state = env.reset(reset_key, params)
    look = watcher(env, params)
    tape = Tape()
    tape.look(image_of(obs), look(state))
    tilemap = env.tilemap_of(state)
    with Progress(steps, "playing") as progress:
        for i in range(steps):
            key, step_key, policy_key = jax.random.split(key, 3)
            action = np.int32(policy.choose(policy_key, state))
            obs, state, reward, terminated, truncated, info = env.step(
                step_key, state, action, params
            )
            tape.look(image_of(obs), look(state))
            tape.act(float(reward), jax.device_get(info), over=bool(truncated & ~terminated))
            progress.update(i + 1)
            if bool(terminated) or bool(truncated):
                break
        progress.total = len(tape.rewards)
    return tape.episode(env.observation, tilemap)


def watcher(env: FirstPerson[Any, Any], params: Any) -> Callable[[Any], dict[str, Any]]:
    """A function of a state that gives what the map and the caption show of it, on the host.

    Its keys are those of `Episode` that it fills, by frame, and `"variables"`.
    """
    import jax
    import jax.numpy as jnp

    @jax.jit
    def look(state: Any, params: Any) -> dict[str, Any]:
        scene = env.scene(state, params)
        told = env.describe(state, params)
        return {
            "positions": state.position,
            "headings": state.heading,
            "closed": scene.closed,
            "sprites": scene.sprites.position,
            "labels": jnp.asarray(scene.theme.sprite_labels)[scene.sprites.look],
            "visible": scene.sprites.visible,
            "variables": {name: told[name] for name in VARIABLES if name in told},
        }

    return lambda state: jax.device_get(look(state, params))


@dataclasses.dataclass
class Tape:
    """Collects an episode step by step."""

    frames: list[np.ndarray] = dataclasses.field(default_factory=list)
    seen: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    rewards: list[float] = dataclasses.field(default_factory=list)
    events: list[str] = dataclasses.field(default_factory=list)

    def look(self, image: Any, seen: dict[str, Any]) -> None:
        """Add what the agent sees in a state, and what `watcher` tells of it."""
        self.frames.append(np.asarray(image))
        self.seen.append(seen)

    def act(self, reward: float, info: dict[str, Any], *, over: bool) -> None:
        """Add what a step brought."""
        self.rewards.append(reward)
        self.events.append(", ".join(in_words(info) + ["time is up"] * over))

    def episode(self, kind: str, tilemap: TileMap | None) -> Episode:
        """The finished episode; `kind` is the environment's `observation`."""

        def over_time(name: str, dtype: type) -> np.ndarray:
            return np.stack([np.asarray(seen[name]) for seen in self.seen]).astype(dtype)

        names = self.seen[0]["variables"]
        return Episode(
            frames=picture(np.stack(self.frames), kind),
            positions=over_time("positions", np.float32),
            headings=over_time("headings", np.float32),
            rewards=np.array(self.rewards, np.float32),
            closed=over_time("closed", bool),
            sprites=over_time("sprites", np.float32),
            labels=over_time("labels", np.int32),
            visible=over_time("visible", bool),
            events=tuple(self.events),
            tilemap=tilemap,
            variables={
                name: np.array([float(seen["variables"][name]) for seen in self.seen])
                for name in names
            },
        )


def in_words(info: dict[str, Any]) -> list[str]:
    """The events of a step that `EVENTS` knows, each in words."""
    words = []
    for name, (one, several) in EVENTS.items():
        count = int(info.get(name, 0))
        if count:
            words.append(one if count == 1 else several.format(count))
    return words
