"""What trained agents get, for the scoreboard of the site: from a run directory to a row.

    python -m docs.agents CONFIG RUN [--episodes N]

plays whole episodes with the agents of RUN, which `jaxenstein train --config CONFIG --out RUN`
made, and puts their means into docs/agents.json. A configuration has one row.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path
from typing import Any

from jaxenstein.baselines.runs.agents import evaluate_both, load_trained
from jaxenstein.baselines.runs.options import read_file, resolve
from jaxenstein.baselines.runs.timing import read_seconds
from jaxenstein.baselines.runs.trained import Trained
from jaxenstein.files import atomic, check_writable
from jaxenstein.progress import Progress

OUT = Path(__file__).parent / "agents.json"
EPISODES = 100


def row_of(config: str, run: Path, episodes: int) -> dict[str, Any]:
    """What was trained, how long, and what its agents get, over seeds and episodes."""
    trained, told = load_trained(run), resolve(read_file(Path(config)))
    about = trained.experiment
    for part in ("spec", "config", "hparams", "seeds", "grid"):
        if getattr(about, part) != getattr(told, part):
            raise SystemExit(f"{run} was not trained by {config}: its {part} is another")
    seeds = len(about.seeds)
    with Progress(2 * seeds * episodes, "evaluating", unit="episodes", compiles=True) as progress:
        results = evaluate_both(trained, episodes=episodes, seed=0, notify=progress.update)
    means = {
        what: {name: dataclasses.asdict(r.interval(getattr(r, of))) for name, r in results.items()}
        for what, of in (("success", "successes"), ("return", "returns"))
    }
    return {
        "id": about.spec.id,
        "version": about.spec.version,
        "config": config,
        "algo": about.config.algo,
        "frame_skip": about.spec.settings.get("frame_skip", 1),
        "sees": seen(trained),
        "seeds": seeds,
        "decisions": trained.update * about.config.steps_per_update,
        "seconds": round(read_seconds(run, trained.update)[-1]),
        "episodes": episodes,
        **means,
    }


def seen(trained: Trained) -> str:
    """Size and kind of what the agents see, such as `16x16 rgb`; columns come first."""
    env = trained.experiment.learner.env
    return f"{env.width}x{env.height} {env.observation}"


def main() -> None:
    """Measure, and write the file."""
    parser = argparse.ArgumentParser(prog="python -m docs.agents", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("config", metavar="CONFIG", help="such as experiments/simple-skip6.toml")
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--episodes", type=int, default=EPISODES, metavar="N")
    parser.add_argument("--out", type=Path, default=OUT, metavar="FILE.json")
    options = parser.parse_args()
    check_writable(options.out)
    kept = json.loads(options.out.read_text("utf-8")) if options.out.exists() else []
    new = row_of(options.config, options.run, options.episodes)
    rows = sorted(
        [*(r for r in kept if r["config"] != new["config"]), new], key=lambda r: r["config"]
    )
    with atomic(options.out) as temporary:
        temporary.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
