"""The figures of the site's pages of environments, of its scoreboard, and of the benchmark.

    python -m docs.measured returns [--episodes N] [ID ...]
    python -m docs.measured agent CONFIG RUN [--episodes N]
    python -m docs.measured suite [--episodes N]

The first writes docs/returns.json: returns of the scripted players, and the versions of
environments and JAX; with ids, only their rows are measured anew. The second plays whole episodes
with the agents of RUN, which `jaxenstein train --config CONFIG --out RUN` made, and puts their
means into docs/agents.json. A configuration has one row. The third writes the reference returns of
the benchmark, which come with the package, and the table of docs/suite.md.
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
from docs.other_pages import with_suite_tasks
from docs.page_parts import AGENTS, HERE, RETURNS, each
from fidelity.players import mean_and_error, measure
from jaxenstein import suite
from jaxenstein.baselines.runs.agents import evaluate_both, load_trained
from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.baselines.runs.metrics import read_seconds
from jaxenstein.baselines.runs.options import read_file, resolve
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from jaxenstein.evaluation import evaluate_player
from jaxenstein.files import atomic, check_writable
from jaxenstein.intervals import mean_interval
from jaxenstein.progress import Progress

SUITE = HERE / "suite.md"
PLAYED, TRIED, REFERRED = 256, 100, 1000


def players_of(name: str) -> tuple[str, ...]:
    """The players that play an environment: chance, and the one that knows the way."""
    return "random", jaxenstein.make(name)[0].about().expert


def rows_of(name: str, episodes: int) -> list[dict[str, Any]]:
    """A row for each player, with the versions that it is true of."""
    facts = {"version": ENTRIES[name].version, "jax": jax.__version__}
    rows = [measure(name, player, episodes) for player in players_of(name)]
    return [facts | {key: row[key] for key in row if key != "original"} for row in rows]


def row_of(config: str, run: Path, episodes: int) -> dict[str, Any]:
    """What was trained, how long, and what its agents get, over seeds and episodes."""
    trained, told = load_trained(run), resolve(read_file(find_config(config)))
    about = trained.experiment
    for part in ("environment", "config", "hparams", "seeds", "grid"):
        if getattr(about, part) != getattr(told, part):
            raise SystemExit(f"{run} was not trained by {config}: its {part} is another")
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
    """Measure the random player and the expert of every task of the benchmark."""
    check_writable(suite.REFERENCES)
    rows = {}
    for task in each([task.id for task in suite.TASKS], "playing"):
        env, params = suite.make(task, test=True)
        row: dict[str, Any] = {"version": env.version, "episodes": options.episodes}
        for name in ("random", "expert"):
            returns = evaluate_player(env, params, name, options.episodes).returns[0]
            row[name], row[f"{name}_error"] = mean_and_error(returns)
        rows[task] = row
    write(suite.REFERENCES, rows)
    SUITE.write_text(with_suite_tasks(SUITE.read_text("utf-8")), "utf-8")


def write(file: Path, content: Any) -> None:
    """Write a file of figures."""
    with atomic(file) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    print(f"wrote {file}")


def main(argv: Sequence[str] | None = None) -> None:
    """Measure what the command line names."""
    parser = argparse.ArgumentParser(prog="python -m docs.measured", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    what = parser.add_subparsers(required=True, metavar="WHAT")
    returns, agent = what.add_parser("returns"), what.add_parser("agent")
    benchmark = what.add_parser("suite")
    benchmark.set_defaults(run_it=measure_suite)
    returns.add_argument("ids", nargs="*", metavar="ID", help="(default: all but variants)")
    returns.set_defaults(run_it=measure_returns)
    agent.add_argument("config", metavar="CONFIG", help="such as simple-skip6")
    agent.add_argument("run", type=Path, metavar="RUN")
    agent.set_defaults(run_it=measure_agent)
    for each_parser, episodes in ((returns, PLAYED), (agent, TRIED), (benchmark, REFERRED)):
        each_parser.add_argument("--episodes", type=int, default=episodes, metavar="N")
    options = parser.parse_args(argv)
    options.run_it(options)


if __name__ == "__main__":
    main()
