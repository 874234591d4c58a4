"""Measures the numbers on the pages of environments, the scoreboard and the benchmark.

    python -m docs.measured returns [--episodes N] [ID ...]
    python -m docs.measured agent CONFIG RUN [--episodes N]
    python -m docs.measured suite [--episodes N] [ID ...]
    python -m docs.measured baselines [RUNS ...]
    python -m docs.measured doom-pixels [--looks] [--episodes N] [RUN ...]
    python -m docs.measured doom-trainer NAME ID ROWS ...

`returns` writes the returns of scripted players to docs/returns.json, with the versions of the
environments and of JAX; with ids, it measures only their rows again. `agent` plays whole episodes
with the agents of RUN, from `jaxenstein train --config CONFIG --out RUN`, and writes their means to
docs/agents.json, with one row per config. `suite` writes the reference returns of the benchmark,
which are part of the package, and the tables in docs/suite.md; ids are as in `returns`. `baselines`
tests the agents of each folder RUNS, from `jaxenstein train --suite --out RUNS`, and adds their
algorithm to the package and to docs/suite.md, with its figures. `doom-pixels` tests the agents of
each RUN, which see colours in a scenario of Doom, here and in ViZDoom, and writes
docs/doom_pixels.json, the tables and the figure of docs/doom-pixels.md, and the best agent into the
package. With --looks, it only tests them, in all looks. Without RUN, these two only write tables
and figures again.
`doom-trainer` stores how agents of the scenario ID learned in ViZDoom with the trainer NAME, from
the rows that `experiments.in_vizdoom` or `experiments.sb3_in_vizdoom` wrote for each seed, and
draws the figures of docs/doom-pixels.md and docs/benchmarks/training.md.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax

import jaxenstein
from docs import doom_pixels, suite_baselines
from docs.other_pages import with_suite_tables
from docs.page_parts import AGENTS, HERE, RETURNS, each
from fidelity.commands import run_command
from fidelity.players import mean_and_error, measure
from jaxenstein import suite
from jaxenstein.baselines.runs.agents import evaluate_both, load_trained
from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.baselines.runs.metrics import read_seconds
from jaxenstein.baselines.runs.options import read_file, resolve
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from jaxenstein.cli.arguments import whole
from jaxenstein.evaluation import evaluate_player
from jaxenstein.files import atomic, check_writable
from jaxenstein.intervals import mean_interval
from jaxenstein.progress import Progress

SUITE = HERE / "suite.md"
PLAYED, TRIED, REFERRED = 256, 100, 1000


def players_of(name: str) -> tuple[str, ...]:
    """The scripted players to measure: random and expert."""
    return "random", jaxenstein.make(name)[0].about().expert


def rows_of(name: str, episodes: int) -> list[dict[str, Any]]:
    """A row for each player, with the versions of the environment and of JAX."""
    facts = {"version": ENTRIES[name].version, "jax": jax.__version__}
    rows = [measure(name, player, episodes) for player in players_of(name)]
    return [facts | {key: row[key] for key in row if key != "original"} for row in rows]


def row_of(config: str, run: Path, episodes: int) -> dict[str, Any]:
    """The row of a run: its training, and the means of its agents over seeds and episodes."""
    trained, told = load_trained(run), resolve(read_file(find_config(config)))
    about = trained.experiment
    for part in ("environment", "config", "hparams", "seeds", "grid"):
        if getattr(about, part) != getattr(told, part):
            raise SystemExit(f"{run} was not trained with {config}: its {part} differs")
    seeds, env = len(about.seeds), about.learner.env
    with Progress(2 * seeds * episodes, "evaluating", unit="episodes", compiles=True) as progress:
        results = evaluate_both(trained, episodes=episodes, seed=0, notify=progress.update)
    means = {
        what: {
            name: dataclasses.asdict(mean_interval(getattr(r, of))) for name, r in results.items()
        }
        for what, of in (("success", "successes"), ("return", "returns"))
    }
    return {
        "id": about.environment.id,
        "version": about.environment.version,
        "config": config,
        "algo": about.config.algo,
        "frame_skip": about.environment.settings.get("frame_skip", 1),
        "sees": f"{env.width}x{env.height} {env.observation}",
        "seeds": seeds,
        "decisions": trained.update * about.config.steps_per_update,
        "seconds": round(read_seconds(run, trained.update)[-1]),
        "episodes": episodes,
        **means,
    }


def measure_returns(options: argparse.Namespace) -> None:
    """Measure the scripted players, and write the file."""
    check_writable(RETURNS)
    for name in options.ids:
        jaxenstein.make(name)
    wanted = options.ids or list(MAIN_IDS)
    kept = json.loads(RETURNS.read_text("utf-8"))["players"] if options.ids else []
    measured = [row for n in each(options.ids, "playing") for row in rows_of(n, options.episodes)]
    rows = [*(row for row in kept if row["id"] not in wanted), *measured]
    rows.sort(key=lambda row: list(ENTRIES).index(row["id"]))
    write(RETURNS, {"command": "python -m docs.measured returns", "players": rows})


def measure_agent(options: argparse.Namespace) -> None:
    """Measure the agents of a run, and write the file."""
    check_writable(AGENTS)
    new = row_of(options.config, options.run, options.episodes)
    kept = [r for r in json.loads(AGENTS.read_text("utf-8")) if r["config"] != new["config"]]
    write(AGENTS, sorted([*kept, new], key=lambda row: row["config"]))


def measure_suite(options: argparse.Namespace) -> None:
    """Measure the random player and the expert in every task of the benchmark."""
    check_writable(suite.REFERENCES)
    names = [suite.task_of(name).id for name in options.ids] or [task.id for task in suite.TASKS]
    rows = suite.reference_rows() if options.ids else {}
    for task in each(names, "playing"):
        env, params = suite.make(task, test=True)
        row: dict[str, Any] = {"version": env.version, "episodes": options.episodes}
        for name in ("random", "expert"):
            returns = evaluate_player(env, params, name, options.episodes).returns[0]
            row[name], row[f"{name}_error"] = mean_and_error(returns)
        rows[task] = row
    write(suite.REFERENCES, rows)
    write_tables()


def measure_baselines(options: argparse.Namespace) -> None:
    """Test the agents of each folder, and write the tables and the figures."""
    for folder in options.runs:
        suite_baselines.add(folder)
    write_tables()
    suite_baselines.draw()


def measure_doom_pixels(options: argparse.Namespace) -> None:
    """Test the agents of each run here and in the game, and write the tables and the figure."""
    for run in options.runs:
        (doom_pixels.add_looks if options.looks else doom_pixels.add)(run, options.episodes)
    doom_pixels.write()


def store_doom_trainer(options: argparse.Namespace) -> None:
    """Store the training of agents in the game, and draw the figures."""
    doom_pixels.add_trainer(options.name, options.id, options.rows)
    doom_pixels.write()


def write_tables() -> None:
    """Write the tables of docs/suite.md again."""
    SUITE.write_text(with_suite_tables(SUITE.read_text("utf-8")), "utf-8")


def write(file: Path, content: Any) -> None:
    """Write a file of results."""
    with atomic(file) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    print(f"wrote {file}")


def main(argv: Sequence[str] | None = None) -> None:
    """Run the chosen measurement."""
    parser = argparse.ArgumentParser(prog="python -m docs.measured", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    what = parser.add_subparsers(required=True, metavar="WHAT")
    returns, agent = what.add_parser("returns"), what.add_parser("agent")
    benchmark = what.add_parser("suite")
    benchmark.add_argument("ids", nargs="*", metavar="ID", help="(default: all tasks)")
    benchmark.set_defaults(run_it=measure_suite)
    trained = what.add_parser("baselines")
    trained.add_argument("runs", nargs="*", type=Path, metavar="RUNS", help="such as runs/ppo")
    trained.set_defaults(run_it=measure_baselines)
    pixels = what.add_parser("doom-pixels")
    pixels.add_argument("runs", nargs="*", type=Path, metavar="RUN", help="such as runs/basic")
    pixels.add_argument("--looks", action="store_true", help="test in all looks")
    pixels.set_defaults(run_it=measure_doom_pixels)
    trainer = what.add_parser("doom-trainer")
    trainer.add_argument("name", metavar="NAME", help="such as Stable-Baselines3")
    trainer.add_argument("id", metavar="ID", help="such as doom-my-way-home")
    trainer.add_argument("rows", nargs="+", type=Path, metavar="ROWS", help="a file for each seed")
    trainer.set_defaults(run_it=store_doom_trainer)
    returns.add_argument("ids", nargs="*", metavar="ID", help="(default: all but variants)")
    returns.set_defaults(run_it=measure_returns)
    agent.add_argument("config", metavar="CONFIG", help="such as simple-skip6")
    agent.add_argument("run", type=Path, metavar="RUN")
    agent.set_defaults(run_it=measure_agent)
    for each_parser, episodes in (
        (returns, PLAYED),
        (agent, TRIED),
        (benchmark, REFERRED),
        (pixels, TRIED),
    ):
        each_parser.add_argument("--episodes", type=whole(), default=episodes, metavar="N")
    options = parser.parse_args(argv)
    options.run_it(options)


if __name__ == "__main__":
    run_command(main)
