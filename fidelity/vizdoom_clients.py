"""One client of ViZDoom's Gymnasium environments, in ViZDoom and here.

    python -m fidelity.vizdoom_clients [--episodes N] [--seed N] [--only NAME]
    python -m fidelity.vizdoom_clients --record FILE

Needs the extras `gymnasium` and `vizdoom`. Each episode starts in a state of the game, which is put
into ours, and holds the same buttons in both: in every second one random buttons, in the others
those of the scripted player that is best. It stops where a reward, an end or a game variable
differs. Printed are the episodes and steps that agree, and the shares of equal pixels of the first
observations and of all others. The game draws monsters, things and damage from random numbers of
its own, so episodes with these differ sooner or later.

`--record` writes what the wrapper says of its environments, for a test: spaces, the buttons of each
action, and an episode without buttons that runs out of time.
"""

from __future__ import annotations

import argparse
import importlib
import json
import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium
import jax
import numpy as np

from fidelity.commands import run_command
from fidelity.doom_recording import LONGEST_HOLD, pick
from jaxenstein.adapters.registration import NAMESPACE, VIZDOOM_SCENARIOS, VIZDOOM_VERSION
from jaxenstein.adapters.vizdoom_buffers import VARIABLES, load_vizdoom
from jaxenstein.adapters.vizdoom_state import told_by, with_pose
from jaxenstein.cli.arguments import add_seed, whole
from jaxenstein.files import atomic, check_writable
from jaxenstein.players import player_of

FORMS: dict[str, tuple[str, dict[str, Any]]] = {
    "one": ("", {}),
    "two": ("", {"max_buttons_pressed": 2}),
    "each": ("-MultiBinary", {}),
    "old": (
        "-MultiBinary",
        {
            "use_multi_binary_action_space": False,
            "treat_episode_timeout_as_truncation": False,
            "screen_resolution": "RES_160X120",
        },
    ),
}
"""The ends of ids and the keyword arguments that are recorded."""
PLAYED = "one", "old"
SHORT = {"frame_skip": 4, "episode_timeout": 10}
FRAME_SKIP = 4


def name_of(scenario: str, form: str = "one", *, ours: bool) -> str:
    """The id of a form of a scenario."""
    start = f"{NAMESPACE}/" if ours else ""
    return f"{start}Vizdoom{scenario}{FORMS[form][0]}-v{VIZDOOM_VERSION}"


def described(space: Any) -> Any:
    """A space in JSON."""
    if isinstance(space, gymnasium.spaces.Dict):
        return {name: described(part) for name, part in space.spaces.items()}
    kind = type(space).__name__
    if isinstance(space, gymnasium.spaces.Discrete):
        return [kind, int(space.n)]
    if isinstance(space, gymnasium.spaces.Box):
        low, high = float(space.low.min()), float(space.high.max())
        return [kind, low, high, list(space.shape), str(space.dtype)]
    counts = np.broadcast_to(getattr(space, "nvec", 2), space.shape)
    return [kind, counts.tolist(), str(space.dtype)]


def nothing(space: Any) -> Any:
    """The action without buttons."""
    return (
        jax.tree.map(np.zeros_like, space.sample())
        if hasattr(space, "spaces")
        else 0 * space.sample()
    )


def short_episode(env: Any) -> dict[str, Any]:
    """The first values of an episode without buttons, and its steps until time is up."""
    first, _ = env.reset(seed=0)
    steps = []
    while not steps or not any(steps[-1][1:3]):
        seen, reward, terminated, truncated, _ = env.step(nothing(env.action_space))
        black = not any(np.any(part) for part in (*seen.values(), env.render()))
        steps.append([round(reward, 6), terminated, truncated, black])
    values = first.get("gamevariables", np.zeros(0)).tolist()
    return {"keys": sorted(first), "variables": values, "steps": steps}


def facts(scenario: str) -> dict[str, Any]:
    """What the wrapper says of the forms of a scenario."""
    told: dict[str, Any] = {}
    for form, (_, settings) in FORMS.items():
        chosen: dict[str, Any] = {"render_mode": "rgb_array"} | settings
        chosen |= SHORT if form in PLAYED else {}
        with gymnasium.make(name_of(scenario, form, ours=False), **chosen) as env:
            plain: Any = env.unwrapped
            game = plain.game
            told["buttons"] = [
                button.name
                for button in game.get_available_buttons()
                if not load_vizdoom().is_delta_button(button)
            ]
            told[form] = {
                "action": described(env.action_space),
                "observation": described(env.observation_space),
                "fps": env.metadata["render_fps"],
            }
            if hasattr(plain, "button_map"):
                held = ["".join(map(str, row)) for row in plain.button_map]
                told[form]["held"] = held
            if form in PLAYED:
                told[form] |= short_episode(env)
    return told


@dataclass
class Agreement:
    """How far episodes agree.

    Attributes:
        episodes: the number of episodes.
        whole: how many of them agree to the end.
        early: how many of these the task ended, not the time limit.
        steps: steps that agree.
        first: shares of equal pixels of the first observations.
        later: of the observations that follow, as long as the episode agrees.
    """

    episodes: int = 0
    whole: int = 0
    early: int = 0
    steps: int = 0
    first: list[float] = field(default_factory=list)
    later: list[float] = field(default_factory=list)

    def __str__(self) -> str:
        """In words."""
        later = f"{np.mean(self.later):.3%}" if self.later else "none"
        return (
            f"{self.whole} of {self.episodes} episodes agree to the end, {self.early} of them "
            f"before the time limit; {self.steps / self.episodes:.0f} steps an episode agree; "
            f"equal pixels: first {np.mean(self.first):.3%}, later {later}"
        )


class Pair:
    """A scenario in ViZDoom and here."""

    def __init__(self, scenario: str, **settings: Any) -> None:
        settings = {"frame_skip": FRAME_SKIP} | settings
        theirs, ours = (name_of(scenario, "each", ours=ours) for ours in (False, True))
        self.theirs = gymnasium.make(theirs, objects_info_enabled=True, **settings)
        self.ours = gymnasium.make(ours, **settings)
        plain: Any = self.ours.unwrapped
        env, params = plain.env, plain.params
        self.plain, self._env, self._batch = plain, env, plain._batch
        self._first = jax.device_get(env.first_state(jax.random.key(0), params))
        self._choose = jax.jit(player_of(env)(env, params))

    def reset(self, seed: int) -> tuple[Any, Any]:
        """Start an episode in the game, and here in its state; returns both observations."""
        seen, _ = self.theirs.reset(seed=seed)
        self.ours.reset(seed=seed)
        source: Any = self.theirs.unwrapped
        kinds = load_vizdoom().GameVariable
        names = (*VARIABLES, *self._env.game_variables)
        values = {name: source.game.get_game_variable(getattr(kinds, name)) for name in names}
        told = told_by(self._env, self._first, source.state.objects, values, 0)
        state = jax.tree.map(lambda leaf: leaf[None], with_pose(self._env, told))
        keys, drawn = self._batch._streams()
        pack = self._batch._layout[0].pack
        self._batch._kept = jax.vmap(pack)((keys, drawn.replace(state=state)))
        self.plain._observation = self._batch.observe(self._batch.env)
        return seen, self.plain._told()

    def play(self, seed: int, agreement: Agreement) -> None:
        """Play an episode until it ends, or differs."""
        draw = random.Random(seed)
        agreement.episodes += 1
        agreement.first.append(equal(*self.reset(seed)))
        hold, action, ends = 0, None, [False, False]
        while not any(ends):
            if seed % 2:
                action = self.best(seed)
            elif hold == 0:
                hold, action = draw.randint(1, LONGEST_HOLD // FRAME_SKIP + 1), self.random(draw)
            hold -= 1
            theirs, reward, *ends, _ = self.theirs.step(action)
            ours, own_reward, *own_ends, _ = self.ours.step(action)
            agrees = abs(float(own_reward) - float(reward)) < 1e-4 and own_ends == ends
            agrees &= np.array_equal(*(seen.get("gamevariables", 0) for seen in (theirs, ours)))
            if not agrees:
                return
            agreement.steps += 1
            if not any(ends):
                agreement.later.append(equal(theirs, ours))
        agreement.whole += 1
        agreement.early += not ends[1]

    def random(self, draw: random.Random) -> Any:
        """At most one button, or any of them."""
        return self.holding(pick(draw, len(self._env.button_names)))

    def best(self, seed: int) -> Any:
        """The buttons of the scripted player."""
        state = jax.tree.map(lambda leaf: leaf[0], self._batch.states)
        chosen = int(self._choose(jax.random.key(seed), state))
        return self.holding(int(self._env.action_buttons[chosen]) if chosen >= 0 else 0)

    def holding(self, held: int) -> Any:
        """The action that holds these buttons, bit i for button i."""
        count = len(self._env.button_names)
        chosen = np.array([held >> i & 1 for i in range(count)], np.int8)
        space: Any = self.theirs.action_space
        if not hasattr(space, "spaces"):
            return chosen
        return {"binary": chosen, "continuous": np.zeros(space["continuous"].shape, np.float32)}

    def close(self) -> None:
        """Close both."""
        self.theirs.close()
        self.ours.close()


def equal(theirs: Any, ours: Any) -> float:
    """The share of pixels with three equal bytes."""
    return float((theirs["screen"] == ours["screen"]).all(axis=-1).mean())


def compare(scenario: str, episodes: int, seed: int = 0, **settings: Any) -> Agreement:
    """Play episodes of a scenario in both."""
    agreement = Agreement()
    pair = Pair(scenario, **settings)
    for number in range(episodes):
        pair.play(seed + number, agreement)
    pair.close()
    return agreement


def main(argv: Sequence[str] | None = None) -> int:
    """Compare and print, or record."""
    parser = argparse.ArgumentParser(description="Compare ViZDoom's environments with ours.")
    parser.add_argument(
        "--episodes", type=whole(), default=20, help="of each (default %(default)s)"
    )
    add_seed(parser)
    parser.add_argument("--only", choices=VIZDOOM_SCENARIOS, help="one scenario")
    parser.add_argument("--record", type=Path, metavar="FILE", help="record the wrapper")
    options = parser.parse_args(argv)
    load_vizdoom()
    importlib.import_module("vizdoom.gymnasium_wrapper")
    names = [options.only] if options.only else list(VIZDOOM_SCENARIOS)
    if options.record:
        check_writable(options.record)
        rows = [f"{json.dumps(name)}: {json.dumps(facts(name))}" for name in names]
        with atomic(options.record) as temporary:
            temporary.write_text("{\n" + ",\n".join(rows) + "\n}\n")
        return 0
    for name in names:
        print(f"{name}: {compare(name, options.episodes, options.seed)}", flush=True)
    return 0


if __name__ == "__main__":
    run_command(main)
