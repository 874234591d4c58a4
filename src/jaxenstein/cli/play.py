"""`jaxenstein play`: play in a window or in a terminal."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..episodes.digests import trajectory_of
from ..episodes.session import Session
from ..interactive.display import DisplayError
from ..interactive.game import AgentGame, Game, play, wait_for
from ..interactive.terminal import Terminal
from ..progress import Progress
from ..spec import spec_of
from ..tasks.first_person import FirstPerson
from ..trajectory import check_trajectory
from ..view.episode import Episode, Pictures
from ..view.recording import check_animation, save_animation, scale_to
from .arguments import (
    OF_FILES,
    OWN,
    Parser,
    UsageError,
    add_agent,
    add_environment,
    add_seed,
    flag,
    real,
)
from .opening import drawn_by, given_options, open_environment
from .own_policy import is_own, load_own
from .record import load_agent, open_for

if TYPE_CHECKING:
    from ..interactive.window import Window

HELP = "play with the keyboard, or watch an agent"
DESCRIPTION = """\
Play an environment with the keyboard, in a window (needs the extra 'play') or, with --terminal, in
a terminal with 24-bit colour, which also works over SSH.

  W A S D, arrows   walk and turn          M       map from above
  Z, C              step aside             P       pause
  space             interact, shoot        R       next episode
  E, F, G           pick up, drop, done    H       help
  X                 wait                   Q, Esc  quit

Hold a key to repeat its action. Time passes only when you act, as for an agent. --policy RUN lets
you watch a trained agent, --policy MODULE:FUNCTION your own ('jaxenstein evaluate --help' explains
how to write one).
"""
EPILOG = """\
examples:
  jaxenstein play key-door
  jaxenstein play my-way-home --native --record home.gif
  jaxenstein play health-gathering --terminal
  jaxenstein play --map-file maze.txt --save maze.json
  jaxenstein play --policy runs/simple-rnd
  jaxenstein play --policy simple.npz
  jaxenstein play t-maze --policy my_module:agent
"""
# (height, width) of pictures for people, of the default pictures for agents, and of the largest
# pictures in a terminal, which a slow connection has to carry.
COMFORTABLE, NATIVE, TERMINAL = (120, 160), (64, 64), (72, 96)
# Height in pixels of the view in a new window.
VIEW_HEIGHT = 480
STATUS_LINES = 2
# Heights of the view and the map in a recording.
RECORDED_VIEW, RECORDED_MAP = 240, 256


def fill(parser: Parser) -> None:
    """Add the arguments."""
    add_environment(parser)
    how = parser.add_argument_group("play")
    flag(how, "--terminal", "play in the terminal, with as many pixels as fit, up to 96x72")
    flag(how, "--native", "show the 64x64 pixels that agents get by default")
    flag(how, "--fps RATE", "maximum steps per second, 1 to 60", real(1, 60), 15.0)
    trained = f"a run directory, {OF_FILES} (in ID, or where it was trained)"
    watched = f"watch an agent instead: {trained}, or your own, {OWN} (in ID)"
    flag(how, "--policy RUN", watched, _run_or_own)
    add_agent(how)
    add_seed(how)
    out = parser.add_argument_group("output at the end")
    film = "film everything you played, beside the map: .gif, or .mp4 with the extra 'video'"
    flag(out, "--record FILE", film, Path)
    last = "write the last episode as a trajectory for 'jaxenstein replay'"
    flag(out, "--save FILE.json", last, Path)


def run(options: argparse.Namespace) -> None:
    """Play, then write the requested files, however the game ended."""
    if options.record is not None:
        check_animation(options.record)
    terminal = _open_terminal() if options.terminal else None
    agent = load_agent(options.policy if isinstance(options.policy, Path) else None, options)
    given = given_options(options)
    if options.native and options.policy is not None:
        raise UsageError("jaxenstein play: --native is for play by hand; give --height and --width")
    if isinstance(options.policy, str):
        env, params, name = open_environment(given, ranges=True)
    elif agent is None:
        env, params, name = open_environment(
            _size(given, options.native, terminal) | given, ranges=True
        )
    else:
        env, params, name = open_for(agent, options)
    params = drawn_by(params, options.seed)
    if isinstance(options.policy, str):
        agent = load_own(options.policy, env, params)
    if options.save is not None:
        check_trajectory(options.save)
        spec_of(env, params)

    def load() -> Game:
        keep, note = options.record is not None, _note(env)
        common: dict[str, Any] = {"seed": options.seed, "fps": options.fps, "keep": keep}
        if agent is not None:
            return AgentGame(env, params, agent, note=f"watching {agent.name}", **common)
        return Game(env, params, note=note, **common)

    game = None
    try:
        with terminal or _open_window(env, name) as display:
            game = wait_for(display, load)
            if game is not None:
                play(display, game)
    finally:
        if game is not None:
            _write(game, options, name)


def _run_or_own(text: str) -> str | Path:
    """An argument type: MODULE:FUNCTION, or the path of a trained agent."""
    return text if is_own(text) else Path(text)


def _open_terminal() -> Terminal:
    try:
        return Terminal()
    except DisplayError as error:
        raise UsageError(f"jaxenstein play --terminal: {error}") from error


def _open_window(env: FirstPerson[Any, Any], name: str) -> Window:
    """A window in which the view is about 480 pixels high."""
    from ..interactive.window import GAP, LINE, Window

    scale = scale_to((env.height, env.width), VIEW_HEIGHT)
    width = max(env.width * scale, VIEW_HEIGHT) + 2 * GAP
    height = env.height * scale + 3 * GAP + STATUS_LINES * LINE
    try:
        return Window(f"{name} - JAXenstein", (width, height))
    except DisplayError as error:
        raise UsageError(
            f"jaxenstein play: {error}; --terminal plays in the terminal instead"
        ) from error


def _size(given: Mapping[str, Any], native: bool, terminal: Terminal | None) -> dict[str, int]:
    """The default size of the picture."""
    chosen = {"height", "width"} & set(given)
    if chosen and native:
        raise UsageError("jaxenstein play: give either --native or --height and --width")
    height, width = NATIVE if native else COMFORTABLE
    if terminal is not None and not chosen and not native:
        columns, rows = terminal.size
        most_high, most_wide = TERMINAL
        height = min(most_high, 2 * (rows - STATUS_LINES), columns * most_high // most_wide)
        height = max(height, 6)
        width = height * most_wide // most_high
    return {"height": height, "width": width}


def _note(env: FirstPerson[Any, Any]) -> str:
    """A note on the size of the picture."""
    here = f"{env.width}x{env.height} pixels"
    high, wide = NATIVE
    if (env.height, env.width) == NATIVE:
        return f"{here}, the default for agents"
    return f"{here}; the default for agents is {wide}x{high} (--native)"


def _write(game: Game, options: argparse.Namespace, name: str) -> None:
    """Write the requested files and print their names."""
    session = game.last_played
    summary = f"{name}: nothing was played"
    if session is not None:
        steps, total = len(session.actions), session.episode_return
        summary = f"{name}: seed {session.seed}, {steps} steps, return {total:.4g}"
    with contextlib.ExitStack() as stack:
        try:
            print(summary, flush=True)
        except OSError:
            # The terminal is gone; still write the files.
            nowhere = stack.enter_context(open(os.devnull, "w"))
            stack.enter_context(contextlib.redirect_stdout(nowhere))
            stack.enter_context(contextlib.redirect_stderr(nowhere))
        try:
            if session is not None and options.save is not None:
                _save(session, options.save)
        finally:
            if session is not None and options.record is not None:
                _record(game, options.record, options.fps)


def _save(session: Session, path: Path) -> None:
    trajectory_of(session).save(path)
    print(f"wrote {path}")


def _record(game: Game, path: Path, fps: float) -> None:
    episodes = game.episodes()
    total = sum(episode.steps + 1 for episode in episodes)
    with Progress(total, "drawing", unit="frames") as progress:
        save_animation(Film(episodes, progress), path, fps)
    print(f"wrote {path}")


class Film(Sequence[np.ndarray]):
    """The pictures of several episodes in order, each drawn when it is needed."""

    def __init__(self, episodes: Sequence[Episode], progress: Progress) -> None:
        """Take episodes of one environment, whose pictures have equal sizes."""
        self._progress = progress
        scale = scale_to(episodes[0].frames.shape[1:3], RECORDED_VIEW)
        self._parts = [Pictures(part, scale=scale, map_size=RECORDED_MAP) for part in episodes]

    def __len__(self) -> int:
        """The number of pictures."""
        return sum(map(len, self._parts))

    def __getitem__(self, index: int) -> np.ndarray:  # type: ignore[override]
        """One picture."""
        for part in self._parts:
            if index < len(part):
                return part[index]
            index -= len(part)
        raise IndexError(index)

    def __iter__(self) -> Iterator[np.ndarray]:
        """All pictures in order."""
        for done, picture in enumerate(itertools.chain.from_iterable(self._parts), 1):
            self._progress.update(done)
            yield picture
