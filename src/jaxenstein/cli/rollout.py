"""`jaxenstein rollout`: run many environments with a random policy, and picture their views."""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..environment import AnyEnvironment
from ..files import check_writable, make_folder
from ..progress import Progress, si
from ..seeds import key_of
from ..view.frames import image_of, picture
from ..view.recording import evenly, mosaic, save_gif, save_png, scale_to
from .arguments import Parser, add_environment, add_seed, flag, whole
from .opening import given_options, open_environment

HELP = "run many environments with a random policy"
DESCRIPTION = """\
Run many environments in parallel with a uniform random policy, and report the speed, the mean
return and the success rate. Only episodes that must end within --steps count; otherwise
short episodes would count more than long ones. --out also writes two pictures:
DIR/ID.gif shows the views of up to 16 environments over time, and DIR/ID.png is a contact sheet
with a row for each environment.
"""
EPILOG = """\
examples:
  jaxenstein rollout my-way-home --envs 512 --steps 500 --out demo
  jaxenstein rollout key-door --envs 64 --width 160 --height 120 --fov 90
  jaxenstein rollout --map-file maze.txt --observation depth --out pictures
"""
# Frames, environments and columns of the GIF; rows and columns of the contact sheet.
GIF_FRAMES, GIF_ENVS, GIF_COLUMNS = 100, 16, 4
SHEET_ENVS, SHEET_COLUMNS = 6, 8
GIF_FPS = 12.5
# Without pictures, the progress bar is updated after about this time.
CALL_SECONDS = 0.2
# Pictures show larger images with rows and columns left out, at most this many pixels a side.
THUMBNAIL = 192
# Minimum height in pixels of the GIF, and of each view on the contact sheet.
GIF_HEIGHT, SHEET_HEIGHT = 480, 112
# The default number of steps is that of the longest episode, within these bounds.
LEAST, MOST = 500, 3000
Carry = dict[str, Any]


def fill(parser: Parser) -> None:
    """Add the arguments."""
    add_environment(parser)
    flag(parser, "--envs N", "parallel environments", whole(), 256)
    help = f"steps in each environment (default: the longest episode, but {LEAST} to {MOST})"
    flag(parser, "--steps T", help, whole())
    add_seed(parser)
    help = "folder for the pictures, created if missing (default: no pictures)"
    flag(parser, "--out DIR", help, Path)


@dataclasses.dataclass
class Tally:
    """The results of a rollout.

    Attributes:
        ended: number of episodes that ended.
        episodes: number of those that began early enough to count.
        returns: sum of the returns of those that count.
        successes: number of those that reached the task's aim at least once.
        goals: how often they reached the aim, which some tasks allow several times per episode.
        seconds: time spent stepping, without compilation.
        compiling: seconds of compilation.
    """

    ended: int
    episodes: int
    returns: float
    successes: int
    goals: int
    seconds: float
    compiling: float = 0.0


def run(options: argparse.Namespace) -> None:
    """Run the rollout, print its results, and write its pictures."""
    env, params, name = open_environment(given_options(options))
    env = dataclasses.replace(env, autoreset="same-step")
    most = int(env.most_steps(params))
    steps = min(max(most, LEAST), MOST) if options.steps is None else options.steps
    targets: tuple[Path, ...] = ()
    if options.out is not None:
        folder = make_folder(options.out)
        targets = folder / f"{name}.gif", folder / f"{name}.png"
        for target in targets:
            check_writable(target)
    watched = min(GIF_ENVS, options.envs) if targets else 0
    print(f"{name}: compiling a rollout of {options.envs} environments ...", file=sys.stderr)
    begin = time.perf_counter()
    advance, carry = compile_rollout(env, params, options.envs, options.seed, watched, steps - most)
    compiling = time.perf_counter() - begin
    frames, tally = play(advance, carry, steps, options.envs, bool(targets))
    tally.compiling = compiling
    _report(options.envs * steps, tally, most)
    if targets:
        write_pictures(picture(np.stack(frames), env.observation), *targets)
        print(f"pictures      {targets[0]}, {targets[1]}")


def compile_rollout(
    env: AnyEnvironment, params: Any, envs: int, seed: int, watched: int, latest: int
) -> tuple[Callable[[Carry, Any], tuple[Carry, Any]], Carry]:
    """Reset the environments and compile their rollout.

    Args:
        env: the environment, with automatic resets.
        params: its params.
        envs: number of parallel environments.
        seed: seed of resets, policy and steps.
        watched: number of environments whose images are returned.
        latest: an episode counts if it began after at most so many steps.

    Returns:
        `(advance, carry)`. `advance(carry, n)` takes n steps and returns the new carry and the
        latest images of the first `watched` environments. It is compiled once for all n, and
        reuses the memory of the old carry.
    """

    def step(_: Any, carry: Carry) -> Carry:
        key, policy_key, step_key = jax.random.split(carry["key"], 3)
        actions = jax.random.randint(policy_key, (envs,), 0, env.num_actions, jnp.int32)
        obs, state, _, terminated, truncated, info = stepping(
            jax.random.split(step_key, envs), carry["state"], actions, params
        )
        ended, now = terminated | truncated, carry["now"] + 1
        counts = ended & (carry["began"] <= latest)
        so_far = carry["so_far"] + info["success"].astype(jnp.int32)
        return {
            "key": key,
            "obs": obs,
            "state": state,
            "now": now,
            "began": jnp.where(ended, now, carry["began"]),
            "ended": carry["ended"] + ended.astype(jnp.int32),
            "episodes": carry["episodes"] + counts.astype(jnp.int32),
            "returns": carry["returns"] + jnp.where(counts, info["episode_return"], 0),
            "goals": carry["goals"] + jnp.where(counts, so_far, 0),
            "successes": carry["successes"] + (counts & (so_far > 0)).astype(jnp.int32),
            "so_far": jnp.where(ended, 0, so_far),
        }

    def advance(carry: Carry, steps: Any) -> tuple[Carry, Any]:
        carry = jax.lax.fori_loop(0, steps, step, carry)
        image = image_of(carry["obs"])[:watched]
        thin = max(1, -(-max(image.shape[1:3]) // THUMBNAIL))
        return carry, image[:, ::thin, ::thin]

    stepping = jax.vmap(env.step, in_axes=(0, 0, 0, None))
    key, reset_key = jax.random.split(key_of(seed))
    keys = jax.random.split(reset_key, envs)
    obs, state = jax.jit(jax.vmap(env.reset, in_axes=(0, None)))(keys, params)
    carry = {"key": key, "obs": obs, "state": state, "returns": jnp.zeros(envs, jnp.float32)}
    # Separate arrays, since the program donates the memory of each.
    counted = ("now", "began", "ended", "episodes", "goals", "successes", "so_far")
    carry |= {name: jnp.zeros(envs, jnp.int32) for name in counted}
    return jax.jit(advance, donate_argnums=0).lower(carry, np.int32(0)).compile(), carry


def play(
    advance: Callable[[Carry, Any], tuple[Carry, Any]],
    carry: Carry,
    steps: int,
    envs: int,
    with_frames: bool,
) -> tuple[list[np.ndarray], Tally]:
    """Run a compiled rollout with a progress bar.

    Returns:
        Images [watched, h, w, ...] at regular times from the reset on, or none without
        `with_frames`; and the results.
    """
    frames: list[np.ndarray] = []
    done, seconds = 0, 0.0
    chunk = -(-steps // GIF_FRAMES) if with_frames else 1
    carry, shown = jax.block_until_ready(advance(carry, np.int32(0)))
    with Progress(steps * envs, "rollout") as progress:
        while True:
            if with_frames:
                frames.append(np.asarray(shown))
            if done == steps:
                break
            count = min(chunk, steps - done)
            begin = time.perf_counter()
            carry, shown = jax.block_until_ready(advance(carry, np.int32(count)))
            elapsed = time.perf_counter() - begin
            done, seconds = done + count, seconds + elapsed
            progress.update(done * envs)
            if not with_frames and elapsed < CALL_SECONDS:
                chunk *= 2
    ended, episodes, successes, goals = (
        int(np.sum(carry[name])) for name in ("ended", "episodes", "successes", "goals")
    )
    returns = float(np.sum(carry["returns"]))
    return frames, Tally(ended, episodes, returns, successes, goals, seconds)


def _report(total: int, tally: Tally, most: int) -> None:
    times = f"{total} steps in {tally.seconds:.2f} s, after {tally.compiling:.1f} s of compilation"
    print(f"speed         {si(total / tally.seconds)} steps/s ({times})")
    print(f"episodes      {tally.ended} ended, {tally.episodes} counted")
    if not tally.episodes:
        print(f"success       unknown: give --steps {most} or more, the longest episode")
    else:
        print(f"mean return   {tally.returns / tally.episodes:.4g}")
        more = f", {tally.goals / tally.episodes:.3g} goals per episode"
        success = f"{tally.successes / tally.episodes:.1%} of episodes"
        print(f"success       {success}{more if tally.goals > tally.successes else ''}")


def write_pictures(frames: np.ndarray, gif: Path, sheet: Path) -> None:
    """Write the animation and the contact sheet of frames, uint8[T, N, H, W, 3]."""
    height, width = frames.shape[2:4]
    columns = min(GIF_COLUMNS, frames.shape[1])
    scale = scale_to((height * -(-frames.shape[1] // columns), width * columns), GIF_HEIGHT)
    save_gif([mosaic(shot, columns, scale=scale) for shot in frames], gif, GIF_FPS)
    times = evenly(len(frames), SHEET_COLUMNS)
    chosen = frames[times, :SHEET_ENVS].swapaxes(0, 1).reshape(-1, *frames.shape[2:])
    scale = scale_to((height, width), SHEET_HEIGHT)
    save_png(mosaic(chosen, len(times), scale=scale), sheet)
