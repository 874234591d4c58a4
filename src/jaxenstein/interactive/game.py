"""The game logic for playing by hand or watching an agent, independent of the display."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np

from ..episodes.policies import Policy
from ..episodes.recorder import EpisodeBuilder, event_text, longest_step, snapshots
from ..episodes.session import Session
from ..maps.things import COLOUR_NAMES
from ..tasks.first_person import FirstPerson
from ..tasks.levels import closed_doors
from ..view.episode import Episode
from ..view.frames import image_of, picture
from ..view.topdown import MapPicture, draw_map
from .controls import Controls, keys_of
from .display import Display, Event, Rectangle

QUIT_KEYS = ("q", "escape")
COMMANDS = {
    "R": "next episode",
    "M": "top-down map",
    "P": "pause",
    "H": "this help",
    "Q, Esc": "quit",
}
# For how many steps an event stays visible.
RECENT = 12
# Seconds between two updates of the clock while compiling.
COMPILING_INTERVAL = 0.1


class Game:
    """An environment played with keys.

    Time passes only with actions, as for an agent. After the end of an episode, the player has to
    start the next one.

    Attributes:
        session: the current episode.
        paused: whether the game is paused.
        mapped: whether the map is shown.
        helping: whether the help is shown.
        over: whether the player wants to quit.
    """

    def __init__(
        self,
        env: FirstPerson[Any, Any],
        params: Any,
        *,
        seed: int = 0,
        fps: float = 15.0,
        keep: bool = False,
        note: str = "",
    ) -> None:
        """Compile the environment, and start the first episode.

        Args:
            env: the environment; its `autoreset` does not matter.
            params: its params.
            seed: the seed of the first episode; each next episode adds 1.
            fps: the maximum number of actions per second.
            keep: whether to keep the frames of all episodes, for `episodes`.
            note: a line of text below the picture.

        Raises:
            SettingError: the params have a batch axis.
        """
        self.params = env.single_params(params)
        self.env = dataclasses.replace(env, autoreset=None, final_observation=False)
        self.paused = self.mapped = self.helping = self.over = False
        self._builders: list[tuple[EpisodeBuilder, Any]] = []
        self._keep = keep
        self._note = note
        self._horizon = int(self.env.most_steps(params))
        self._longest_step = longest_step(self.env, params)
        self._controls = Controls(env.action_names, fps)
        self._fps = fps
        self._snapshot_of = snapshots(self.env, params)
        self._variables = jax.jit(self.env.variables)
        self._played: Session | None = None
        Session(self.env, params, seed).step(0)
        self._begin(seed)

    @property
    def last_played(self) -> Session | None:
        """The latest episode with at least one action; None if there is none."""
        return self.session if self.session.actions else self._played

    def episodes(self) -> list[Episode]:
        """All episodes played, if they were kept, except those without actions."""
        return [
            builder.build(self.env, self.params, tilemap)
            for builder, tilemap in self._builders
            if builder.rewards or len(self._builders) == 1
        ]

    @property
    def frame(self) -> np.ndarray:
        """uint8[H, W, 3]: what the agent sees now."""
        return picture(np.asarray(image_of(self.session.observation)), self.env.observation)

    def handle(self, event: Event, now: float) -> bool:
        """Handle an event at the time `now` (seconds); returns whether to redraw."""
        if event.kind == "close":
            self.over = True
        elif event.kind == "release":
            self._controls.release(event.key)
            return False
        elif event.kind == "press":
            return self._press(event.key, now)
        return True

    def advance(self, now: float) -> bool:
        """Take a step if one is due; returns whether it took one."""
        action = self._controls.take(now) if self._playing else None
        if action is None:
            return False
        session = self.session
        session.step(action)
        self._snapshot = self._snapshot_of(session.state)
        if text := event_text(session):
            self._event, self._event_step = text, len(session.actions)
        self._positions.append(self._snapshot["positions"])
        if self._keep:
            builder, _ = self._builders[-1]
            builder.add_frame(image_of(session.observation), self._snapshot)
            builder.add_step(session)
        return True

    def due(self, now: float) -> float | None:
        """Seconds until the next step; None if there is none."""
        return self._controls.due(now) if self._playing else None

    def status(self) -> list[str]:
        """Two lines: numbers, and the latest event or a hint."""
        session = self.session
        reward = session.rewards[-1] if session.rewards else 0.0
        facts = [
            f"seed {session.seed}",
            f"step {len(session.actions)}/{self._horizon}",
            f"reward {_signed(reward)}",
            f"return {_signed(session.episode_return)}",
            *(f"{name} {float(value):g}" for name, value in self._snapshot["variables"].items()),
        ]
        keys = self._keys()
        if keys is not None:
            facts.append(f"keys: {', '.join(keys) or 'none'}")
        recent = len(session.actions) - self._event_step < RECENT
        hint = "   ".join(["H: help", *([self._note] if self._note else [])])
        return ["   ".join(facts), self._event if self._event and recent else hint]

    def overlay(self) -> list[str]:
        """The text to show on top of the picture; [] for none."""
        session = self.session
        if self.helping:
            return self.help()
        if session.over:
            return [
                self._event or "the episode is over",
                f"return {_signed(session.episode_return)} after {len(session.actions)} steps",
                f"R: next episode (seed {_next(session.seed)})   Q: quit",
            ]
        return ["paused", "P: continue"] if self.paused else []

    def help(self) -> list[str]:
        """Lines that explain the keys."""
        keys = keys_of(self.env.action_names)
        rows = [
            (", ".join(key if len(key) > 1 else key.upper() for key in keys[name]), name)
            for name in self.env.action_names
        ]
        rows += COMMANDS.items()
        lines = [f"{key}: {what}" for key, what in rows if key]
        rate = f"Time passes only when you act, at most {self._fps:g} times per second."
        return [*lines, "", rate, *([self._note] if self._note else [])]

    def map_image(self, room: Rectangle, finer: int = 1) -> np.ndarray:
        """uint8[h, w, 3]: the map with the agent and its path, to fit a rectangle.

        Args:
            room: the rectangle; the map only exceeds it if there are more tiles than pixels.
            finer: draw the map this many times larger; the display shrinks it smoothly.
        """
        tilemap = self._tilemap
        fitting = min(room.width // tilemap.columns, room.height // tilemap.rows)
        scale = max(1, finer * fitting)
        if self._ground is None or self._ground.scale != scale:
            self._ground, self._drawn = draw_map(tilemap, scale=scale), 0
        new = np.array(self._positions[self._drawn :])
        self._ground.path(new, self._drawn, self._horizon, self._longest_step)
        self._drawn = len(self._positions) - 1
        seen = self._snapshot
        shot = self._ground.copy().state(
            pose=(seen["positions"], float(seen["headings"])),
            field_of_view=self.env.field_of_view,
            closed=closed_doors(tilemap, seen["doors"], seen["closed"]),
            things=(seen["sprites"], seen["labels"], seen["visible"]),
        )
        return np.asarray(shot.image())

    @property
    def _playing(self) -> bool:
        return not (self.paused or self.helping or self.session.over)

    def _begin(self, seed: int) -> None:
        """Start the episode of a seed."""
        self.session = session = Session(self.env, self.params, seed)
        self._snapshot = self._snapshot_of(session.state)
        self._tilemap = self.env.tilemap_of(session.state)
        self._has_keys = bool(self._tilemap.keys) and "carried_keys" in self.env.variable_spaces()
        self._positions = [self._snapshot["positions"]]
        self._ground: MapPicture | None = None
        self._drawn = 0
        self._event, self._event_step = self.env.instruction(session.state), 0
        self._controls.clear()
        if self._keep:
            builder = EpisodeBuilder()
            builder.add_frame(image_of(session.observation), self._snapshot)
            self._builders.append((builder, self._tilemap))

    def _press(self, key: str, now: float) -> bool:
        if key in QUIT_KEYS:
            self.over = True
        elif key == "r":
            if self.session.actions:
                self._played = self.session
            self._begin(_next(self.session.seed))
            self.paused = False
        elif key == "m":
            self.mapped = not self.mapped
        elif key == "p":
            self.paused = not self.paused
        elif key == "h":
            self.helping = not self.helping
        else:
            if self._playing:
                self._controls.press(key, now)
            return False
        if not self._playing:
            self._controls.clear()
        return True

    def _keys(self) -> list[str] | None:
        """The colours of the keys that the player has; None if the task has no keys."""
        if not self._has_keys:
            return None
        carried = np.asarray(self._variables(self.session.state)["carried_keys"])
        return [name for name, here in zip(COLOUR_NAMES, carried, strict=True) if here]


class AgentControls(Controls):
    """An agent instead of keys: it acts as often as the rate allows."""

    def __init__(self, choose: Callable[[], int], fps: float) -> None:
        """Store a function for the next action, and the maximum actions per second."""
        super().__init__((), fps)
        self._choose = choose

    def due(self, now: float) -> float | None:
        """Seconds until the next action."""
        return max(0.0, self._ready - now)

    def take(self, now: float) -> int | None:
        """The action to take now, if one is due."""
        if now < self._ready:
            return None
        self._ready = now + self._interval
        return self._choose()


class AgentGame(Game):
    """A game that a policy plays; you can pause it, see the map, and start the next episode."""

    def __init__(self, env: Any, params: Any, policy: Policy, **kwargs: Any) -> None:
        """Store the policy; the other arguments are those of `Game`."""
        super().__init__(env, params, **kwargs)
        self._controls = AgentControls(lambda: int(policy(self.session)), self._fps)
        # Compiles the policy before anything is shown.
        policy(self.session)

    def help(self) -> list[str]:
        """Lines that explain the keys."""
        return [f"{key}: {what}" for key, what in COMMANDS.items()]


def wait_for(display: Display, load: Callable[[], Game]) -> Game | None:
    """Run `load` behind a notice; returns its game, or None if the player quits first.

    Compiling takes seconds, so it runs on a thread while the display stays responsive. The process
    only ends after that thread.
    """
    pool = ThreadPoolExecutor(1)
    game = pool.submit(load)
    pool.shutdown(wait=False)
    start = time.monotonic()
    while not game.done():
        display.show(None, overlay=[f"compiling ... {time.monotonic() - start:.0f} s"])
        for event in display.events(COMPILING_INTERVAL):
            if event.kind == "close" or event.key in QUIT_KEYS:
                return None
    return game.result()


def play(display: Display, game: Game) -> None:
    """Show a game and pass it the keys until the player quits; sleeps while nothing happens."""
    draw(display, game)
    while not game.over:
        due = game.due(time.monotonic())
        events = display.events(1.0 if due is None else due)
        now = time.monotonic()
        mapped = game.mapped
        changed = [game.handle(event, now) for event in events]
        if mapped != game.mapped:
            display.make_room(game.mapped)
        if game.advance(now) or any(changed):
            draw(display, game)


def draw(display: Display, game: Game) -> None:
    """Show the current state of a game."""
    lines = game.status()
    room = display.beside_area(len(lines))
    beside = game.map_image(room, display.finer) if game.mapped else None
    display.show(game.frame, lines, beside=beside, overlay=game.overlay())


def _next(seed: int) -> int:
    return (seed + 1) % 2**32


def _signed(number: float) -> str:
    """A sum of rewards with its sign: 0, +1, -0.0012."""
    return f"{number:+.4g}" if number else "0"
