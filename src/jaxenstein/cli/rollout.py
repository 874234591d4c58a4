"""`jaxenstein rollout`: many environments under a random policy, and what they saw."""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import check_writable, make_folder
from ..progress import Progress, si
from ..view.frames import image_of, picture
from ..view.recording import evenly, mosaic, save_gif, save_png, scale_to
from .arguments import Parser, add_environment, add_seed, flag, whole
from .opening import given_options, open_environment

if TYPE_CHECKING:
    from ..environment import AnyEnvironment

HELP = "run many environments with a random policy, and picture what they see"
DESCRIPTION = """\
Step many environments side by side with a uniform random policy, resetting each when its
episode ends, and report the speed, the returns and how many episodes succeeded.
With --out also write DIR/ID.gif, the views of up to 16 of them over time, and DIR/ID.png,
a contact sheet: one row an environment, time running to the right.
"""
EPILOG = """\
examples:
  jaxenstein rollout my-way-home --envs 512 --steps 500 --out demo
  jaxenstein rollout key-door --envs 64 --width 160 --height 120 --fov 90
  jaxenstein rollout --map-file maze.txt --observation depth --out pictures
"""
# Frames of the GIF, environments in it, and rows and columns of the contact sheet.
GIF_FRAMES, GIF_ENVS, GIF_COLUMNS = 100, 16, 4
SHEET_ENVS, SHEET_COLUMNS = 6, 8
GIF_FPS = 12.5
# Without pictures, the number of steps between updates of the progress bar aims at this time.
CALL_SECONDS = 0.2
# Larger images are thinned out for the pictures, to at most this many pixels a side.
THUMBNAIL = 192
# Pixels that the mosaic of the GIF and each view on the contact sheet are high, at least.
GIF_HEIGHT, SHEET_HEIGHT = 480, 112
Carry = dict[str, Any]


def fill(parser: Parser) -> None:
    """Add the arguments."""
    add_environment(parser)
    flag(parser, "--envs N", "environments side by side", whole(), 256)
    flag(parser, "--steps T", "steps of each environment", whole(), 500)
    add_seed(parser)
    help = "folder for the pictures, made if missing (default: no pictures)"
    flag(parser, "--out DIR", help, Path)


@dataclasses.dataclass
class Tally:
    """What a rollout came to.

    Attributes:
        episodes: episodes that ended.
        returns: the sum of their returns.
        successes: how many of them reached the task's aim at least once.
        goals: how often they reached it; where they go on after that, more than once.
        seconds: time spent stepping, without compiling.
        compiling: seconds it took to compile.
    """

    episodes: int
    returns: float
    successes: int
    goals: int
    seconds: float
    compiling: float = 0.0


def run(options: argparse.Namespace) -> None:
    """Run the rollout, print its figures, write its pictures."""
    env, params, name = open_environment(given_options(options))
    env = dataclasses.replace(env, autoreset="same-step")
    targets: tuple[Path, ...] = ()
    if options.out is not None:
        folder = make_folder(options.out)
        targets = folder / f"{name}.gif", folder / f"{name}.png"
        for target in targets:
            check_writable(target)
    watched = min(GIF_ENVS, options.envs) if targets else 0
    print(f"{name}: compiling a rollout of {options.envs} environments ...", file=sys.stderr)
    begin = time.perf_counter()
    advance, carry = compile_rollout(env, params, options.envs, options.seed, watched)
    compiling = time.perf_counter() - begin
    frames, tally = play(advance, carry, options.steps, options.envs, bool(targets))
    tally.compiling = compiling
    _report(options, tally)
    if targets:
        write_pictures(picture(np.stack(frames), env.observation), *targets)
        print(f"pictures      {targets[0]}, {targets[1]}")


def compile_rollout(
    env: AnyEnvironment, params: Any, envs: int, seed: int, watched: int
) -> tuple[Callable[[Carry, Any], tuple[Carry, Any]], Carry]:
    """Reset the environments and compile their rollout.

    Args:
        env: the environment, with automatic resets.
        params: its params.
        envs: how many run side by side.
        seed: of the resets, the policy and the steps.
        watched: of how many the images are returned.

    Returns:
        `(advance, carry)`: `advance(carry, n)` takes n steps, for any n, with one compilation, and
        returns the new carry, reusing the old one's memory, and the latest images of the first
        `watched` environments.
    """
    import jax
    import jax.numpy as jnp

    def step(_: Any, carry: Carry) -> Carry:
        key, policy_key, step_key = jax.random.split(carry["key"], 3)
        actions = jax.random.randint(policy_key, (envs,), 0, env.num_actions, jnp.int32)
        obs, state, _, terminated, truncated, info = stepping(
            jax.random.split(step_key, envs), carry["state"], actions, params
        )
        ended = terminated | truncated
        so_far = carry["so_far"] + info["success"].astype(jnp.int32)
        return {
            "key": key,
            "obs": obs,
            "state": state,
            "episodes": carry["episodes"] + ended.astype(jnp.int32),
            "returns": carry["returns"] + jnp.where(ended, info["episode_return"], 0),
            "goals": carry["goals"] + jnp.where(ended, so_far, 0),
            "successes": carry["successes"] + (ended & (so_far > 0)).astype(jnp.int32),
            "so_far": jnp.where(ended, 0, so_far),
        }

    def advance(carry: Carry, steps: Any) -> tuple[Carry, Any]:
        carry = jax.lax.fori_loop(0, steps, step, carry)
        image = image_of(carry["obs"])[:watched]
        thin = max(1, -(-max(image.shape[1:3]) // THUMBNAIL))
        return carry, image[:, ::thin, ::thin]

    stepping = jax.vmap(env.step, in_axes=(0, 0, 0, None))
    key, reset_key = jax.random.split(jax.random.key(seed))
    keys = jax.random.split(reset_key, envs)
    obs, state = jax.jit(jax.vmap(env.reset, in_axes=(0, None)))(keys, params)
    carry = {"key": key, "obs": obs, "state": state, "returns": jnp.zeros(envs, jnp.float32)}
    # Distinct arrays: their memory is reused one by one.
    counted = ("episodes", "goals", "successes", "so_far")
    carry |= {name: jnp.zeros(envs, jnp.int32) for name in counted}
    return jax.jit(advance, donate_argnums=0).lower(carry, np.int32(0)).compile(), carry


def play(
    advance: Callable[[Carry, Any], tuple[Carry, Any]],
    carry: Carry,
    steps: int,
    envs: int,
    with_frames: bool,
) -> tuple[list[np.ndarray], Tally]:
    """Run a compiled rollout under a progress bar.

    Returns:
        images [watched, h, w, ...] at regular times from the reset on if `with_frames`, else
        none; and the figures.
    """
    import jax

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
    episodes, successes, goals = (
        int(np.sum(carry[name])) for name in ("episodes", "successes", "goals")
    )
    return frames, Tally(episodes, float(np.sum(carry["returns"])), successes, goals, seconds)


def _report(options: argparse.Namespace, tally: Tally) -> None:
    total = options.envs * options.steps
    times = f"{total} steps in {tally.seconds:.2f} s, after {tally.compiling:.1f} s of compiling"
    print(f"speed         {si(total / tally.seconds)} steps/s ({times})")
    print(f"episodes      {tally.episodes} ended")
    if tally.episodes:
        print(f"mean return   {tally.returns / tally.episodes:.4g}")
        more = f", {tally.goals / tally.episodes:.3g} goals an episode"
        success = f"{tally.successes / tally.episodes:.1%} of the episodes"
        print(f"success       {success}{more if tally.goals > tally.successes else ''}")


def write_pictures(frames: np.ndarray, gif: Path, sheet: Path) -> None:
    """Write the animation and the contact sheet of uint8[T, N, H, W, 3]."""
    height, width = frames.shape[2:4]
    columns = min(GIF_COLUMNS, frames.shape[1])
    scale = scale_to((height * -(-frames.shape[1] // columns), width * columns), GIF_HEIGHT)
    save_gif([mosaic(shot, columns, scale=scale) for shot in frames], gif, GIF_FPS)
    times = evenly(len(frames), SHEET_COLUMNS)
    chosen = frames[times, :SHEET_ENVS].swapaxes(0, 1).reshape(-1, *frames.shape[2:])
    scale = scale_to((height, width), SHEET_HEIGHT)
    save_png(mosaic(chosen, len(times), scale=scale), sheet)
