"""Agents of Doom's scenarios that see pixels: their returns here and in the game, and their page.

docs/doom_pixels.json has a row for each scenario and look, and for each trainer in the game. `add`,
`add_looks` and `add_trainer` write it. The tables and figures of docs/doom-pixels.md have what is
there; rows of other scenarios are absent.
"""

from __future__ import annotations

import dataclasses
import json
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import jaxenstein
from docs.page_parts import HERE, PIXELS, four_digits, table
from fidelity.doom_palette import ORDERS, exchanged
from jaxenstein.baselines.runs.agents import (
    WAYS,
    by_game_rules,
    chosen_run,
    evaluate,
    evaluate_in_game,
    rounded,
    write_with_score,
)
from jaxenstein.baselines.runs.configs import find_config
from jaxenstein.baselines.runs.curves import band, curves_of, new_figure, save_figure
from jaxenstein.baselines.runs.experiment import Experiment
from jaxenstein.baselines.runs.metrics import read_seconds
from jaxenstein.baselines.runs.options import given_by, read_file, resolve
from jaxenstein.baselines.runs.trained import HERE as PACKAGED
from jaxenstein.baselines.runs.trained import SUFFIX, Trained, load_trained
from jaxenstein.catalogue import ENTRIES
from jaxenstein.cli.arguments import flag_of
from jaxenstein.evaluation import evaluate_player
from jaxenstein.files import atomic
from jaxenstein.intervals import mean_interval
from jaxenstein.progress import Progress
from jaxenstein.results import Results
from jaxenstein.settings import changed
from jaxenstein.spec import Spec
from jaxenstein.tasks.doom.scenario import DoomScenario
from jaxenstein.tasks.doom.wad import find_iwad

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILE, PAGE = HERE / "doom_pixels.json", HERE / "doom-pixels.md"
IMAGES = HERE / "images" / "results"
PICTURE, TRAINERS = (IMAGES / f"doom-{name}.png" for name in ("pixels", "trainers"))
HERE_TOO, GAME, OTHER = "here", "in ViZDoom", "in ViZDoom, other palette"
LOOKS = ("plain", "random", "game")
# The look of the agents that `add` takes.
SHOWN = "game"
POINTS, COLUMNS = 50, 3
# The parts of a training in the game, each with the mean of its episodes.
PARTS = 12
# The scripted players, their episodes, and the height and width of frames that are not used.
PLAYERS, PLAYED, SMALL = ("random", "expert"), 1000, 4
# The entries that identify a row, for each part of the file.
KEYS = {"agents": ("id",), "looks": ("id", "look"), "trainers": ("id", "trainer")}
Row = dict[str, Any]


def add(run: Path, episodes: int) -> None:
    """Test the agents of a run with the rewards of the game, here and in the game.

    The best one becomes part of the package.

    Args:
        run: a run directory of agents that see colours in a scenario of ViZDoom.
        episodes: the number of episodes for each seed, way of acting, and place.
    """
    trained, row = _opened(run)
    if row["look"] != SHOWN:
        raise SystemExit(f"{run}: its agents see the look {row['look']}, not {SHOWN}")
    row |= {
        "players": players_of(row),
        "minutes": round(float(read_seconds(run, trained.update)[-1]) / 60, 1),
        "tests": _tested([(HERE_TOO, trained, False), (GAME, trained, True)], episodes),
        "curve": _curve(run, row),
    }
    _store("agents", row)
    best = rounded(trained, chosen_run(trained, None), "float16")
    write_with_score(PACKAGED / f"{row['id']}{PIXELS}{SUFFIX}", best, "float16")


def add_looks(run: Path, episodes: int) -> None:
    """Test the agents of a run in all looks, and in the game in its own and in other colours."""
    trained, row = _opened(run)
    with tempfile.TemporaryDirectory() as folder:
        other = Path(folder) / "other.wad"
        other.write_bytes(exchanged(find_iwad(), ORDERS[0]))
        parts = [(look, _looking(trained, look=look), False) for look in LOOKS]
        parts += [
            (GAME, _looking(trained, look="game"), True),
            (OTHER, _looking(trained, look="game", wad=str(other)), True),
        ]
        row["tests"] = _tested(parts, episodes)
    _store("looks", row)


def add_trainer(trainer: str, id: str, files: Sequence[Path]) -> None:
    """Store how agents learned in the game.

    Args:
        trainer: the name of the program that trained them.
        id: the scenario.
        files: the rows of each seed, from `experiments.in_vizdoom` or `experiments.sb3_in_vizdoom`.
    """
    seeds = [[json.loads(line) for line in file.read_text("utf-8").splitlines()] for file in files]
    total = "successes" if _measure({"id": id}) == "success" else "return_sum"
    ends = np.linspace(0, max(rows[-1]["seconds"] for rows in seeds), PARTS + 1)[1:]
    row = {"id": id, "trainer": trainer, "minutes": [float(f"{end / 60:.4g}") for end in ends]}
    _store("trainers", {**row, "values": [_in_parts(rows, total, ends) for rows in seeds]})


def players_of(row: Mapping[str, Any]) -> Row:
    """What the random player and the expert get in a row's scenario with its frame skip."""
    env, params = jaxenstein.make(
        row["id"], frame_skip=row["frame_skip"], height=SMALL, width=SMALL
    )
    return {player: _means(evaluate_player(env, params, player, PLAYED)) for player in PLAYERS}


def _in_parts(rows: Sequence[Row], total: str, ends: np.ndarray) -> list[float | None]:
    """The mean of the episodes up to each of the ends; None where no episode ended."""
    part = np.searchsorted(ends, [row["seconds"] for row in rows])
    sums, counts = np.zeros(len(ends)), np.zeros(len(ends))
    np.add.at(sums, part, [row[total] for row in rows])
    np.add.at(counts, part, [row["episodes"] for row in rows])
    with np.errstate(invalid="ignore"):
        return [four_digits(value) for value in sums / counts]


def _opened(run: Path) -> tuple[Trained, Row]:
    """The agents with the params of the game, and the first entries of their row."""
    trained = load_trained(run)
    spec = trained.experiment.environment
    env: Any = trained.experiment.learner.env
    if trained.update < trained.experiment.config.updates or trained.experiment.grid:
        raise SystemExit(f"{run}: the training is not complete, or has a grid")
    if not isinstance(env, DoomScenario) or env.scenario is None or env.observation != "rgb":
        raise SystemExit(f"{run}: its agents must see colours (rgb) in a scenario of ViZDoom")
    row = {
        "id": spec.id,
        "version": spec.version,
        "look": env.look,
        "frame_skip": env.frame_skip,
        "scale": reward_scale(spec),
        "seeds": len(trained.experiment.runs),
        "flags": flags_of(trained.experiment),
    }
    return by_game_rules(trained), row


def flags_of(about: Experiment) -> str:
    """The flags of a training in addition to `--config doom-pixels`, its id and its look."""
    own = given_by(about)
    # No WAD file is needed for the plain look.
    usual = resolve({**read_file(find_config("doom-pixels")), "env": own["env"], "look": "plain"})
    same = {**given_by(usual), "look": own.get("look")}
    params = own.pop("params", {})
    return " ".join(
        flag
        for name, value in {**own, "params": params}.items()
        if value != same.get(name)
        for flag in _flags(name, value)
    )


def _flags(name: str, value: Any) -> list[str]:
    """The flags that give an option its value."""
    flag = flag_of(name)
    if isinstance(value, Mapping):
        between = ":" if name == "params" else ","
        return [f"{flag} {key}={_told(of, between)}" for key, of in value.items()]
    if isinstance(value, bool):
        return [flag if value else f"--no-{flag[2:]}"]
    return [f"{flag} {_told(value, ',')}"]


def _told(value: Any, between: str) -> str:
    """A value as a flag takes it, with this mark between the parts of a tuple."""
    if isinstance(value, tuple | list):
        return between.join(_told(part, "x") for part in value)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.9g}" if isinstance(value, float) else f"{value}"


def reward_scale(spec: Spec) -> float | None:
    """The factor on all of the game's rewards in training; None if they have several."""
    env, _ = spec.build()
    factors: set[float | None] = set()
    for name in env.about().rewards:
        usual = float(getattr(env.default_params, name))
        value = spec.params.get(name, usual)
        if isinstance(value, tuple):
            factors.add(None)
        elif usual or value:
            factors.add(round(value / usual, 6) if usual else None)
    return factors.pop() if len(factors) == 1 else None


def _looking(trained: Trained, **settings: str) -> Trained:
    spec = changed(trained.experiment.environment, {"settings": settings})
    experiment = dataclasses.replace(trained.experiment, environment=spec)
    return dataclasses.replace(trained, experiment=experiment)


def _tested(parts: Sequence[tuple[str, Trained, bool]], episodes: int) -> Row:
    """Test agents; `parts` has the name of each test, agents, and whether they play in the game."""
    many = len(parts[0][1].experiment.runs)
    total = episodes * many * len(WAYS) * len(parts)
    found: Row = {}
    with Progress(total, "testing", unit="episodes", compiles=True) as progress:
        for name, trained, there in parts:
            found[name] = {}
            for way, greedy in WAYS.items():
                play = evaluate_in_game if there else evaluate
                result = play(trained, episodes=episodes, greedy=greedy)
                found[name][way] = _means(result)
                done = len(WAYS) * (len(found) - 1) + len(found[name])
                progress.update(done * episodes * many)
    return {"episodes": episodes, **found}


def _means(result: Results) -> Row:
    values = {"return": result.returns, "success": result.successes}
    return {
        name: [float(f"{end:.5g}") for end in dataclasses.astuple(mean_interval(of))]
        for name, of in values.items()
    }


def _curve(run: Path, row: Row) -> Row | None:
    """Returns over minutes in training, seed by seed; None if rewards have several factors."""
    if row["scale"] is None and _measure(row) == "return":
        return None
    (curve,) = curves_of(run, _measure(row), POINTS, "minutes")
    scale = row["scale"] if _measure(row) == "return" else 1.0
    values = [[four_digits(value / scale) for value in of_run] for of_run in curve.values]
    return {"minutes": [float(f"{at:.4g}") for at in curve.at], "values": values}


def _measure(row: Mapping[str, Any]) -> str:
    """What tells how good agents are: success, where a goal is to be found, or the return."""
    return "success" if str(row["id"]).startswith("doom-my-way-home") else "return"


def stored() -> dict[str, list[Row]]:
    """The content of the file."""
    there = json.loads(FILE.read_text("utf-8")) if FILE.exists() else {}
    return {part: there.get(part, []) for part in KEYS}


def _store(part: str, row: Row) -> None:
    """Put a row into a part of the file, in place of the one with the same keys."""
    rows, order = stored(), list(ENTRIES)

    def keys(of: Row) -> list[Any]:
        return [of[key] for key in KEYS[part]]

    kept = [one for one in rows[part] if keys(one) != keys(row)]
    rows[part] = sorted([*kept, row], key=lambda one: (order.index(one["id"]), keys(one)))
    lines = {name: ",\n  ".join(map(json.dumps, of)) for name, of in rows.items()}
    parts = [f" {json.dumps(name)}: [\n  {of}\n ]" for name, of in lines.items()]
    with atomic(FILE) as temporary:
        temporary.write_text("{\n" + ",\n".join(parts) + "\n}\n", "utf-8")
    print(f"wrote {FILE}")


def agents_table() -> str:
    """The agents that see the game's pictures."""
    columns = [(way, place) for way in WAYS for place in (HERE_TOO, GAME)]
    tests = (f"{way}, {place}" for way, place in columns)
    head = ("scenario", *PLAYERS, *tests, "minutes", "flags")
    cells = [
        [
            f"`{row['id']}`",
            *(_player(row, player) for player in PLAYERS),
            *(_shown(row, place, way) for way, place in columns),
            f"{row['minutes']:.0f}",
            f"`{row['flags']}`" if row["flags"] else "",
        ]
        for row in stored()["agents"]
    ]
    return table(head, cells, range(1, len(head) - 1))


def looks_table() -> str:
    """The agents of each look in the others: sampled actions."""
    places = (*LOOKS, GAME, OTHER)
    cells = [
        [
            f"`{row['id']}`",
            f"`{row['look']}`",
            *(_shown(row, place, "sampled") for place in places),
        ]
        for row in stored()["looks"]
    ]
    head = ("scenario", "trained in", *(f"`{look}`" for look in LOOKS), GAME, OTHER)
    return table(head, cells, range(2, len(head)))


def _shown(row: Row, place: str, way: str) -> str:
    """A mean with its interval; success in percent."""
    measure = _measure(row)
    mean, low, high = row["tests"][place][way][measure]
    if measure == "success":
        return f"{100 * mean:.1f} % ({100 * low:.0f} to {100 * high:.0f})"
    mean, low, high = (_number(value, mean) for value in (mean, low, high))
    return f"{mean} ({low} to {high})"


def _number(value: float, beside: float) -> str:
    """A return with as many digits as the one beside it needs."""
    return f"{value:.{4 if abs(beside) >= 100 else 3}g}"


def _player(row: Row, player: str) -> str:
    """The mean of a scripted player; success in percent."""
    mean, *_ = row["players"][player][_measure(row)]
    return f"{100 * mean:.0f} %" if _measure(row) == "success" else _number(mean, mean)


def with_tables(page: str) -> str:
    """The text of docs/doom-pixels.md with its tables and its figure between their marks.

    Tables without rows are left out.
    """
    parts = {"agents": agents_table(), "looks": looks_table()}
    if any(_drawn()):
        parts["agents"] += "\n\n![Training over minutes](images/results/doom-pixels.png)"
    for name, text in parts.items():
        block = re.compile(rf"(<!-- doom {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        lines = f"{text}\n" if text.count("\n") > 1 else ""
        page = block.sub(lambda found, lines=lines: f"{found[1]}{lines}{found[2]}", page)
    return page


def write() -> None:
    """Write the tables and the figure again."""
    PAGE.write_text(with_tables(PAGE.read_text("utf-8")), "utf-8")
    if any(_drawn()):
        save_figure(figure(), [PICTURE])
    if stored()["trainers"]:
        save_figure(trainers_figure(), [TRAINERS])


def _drawn() -> Iterator[Row]:
    """The rows whose training is in the figure."""
    return (row for row in stored()["agents"] if row["curve"])


def figure() -> Figure:
    """Returns over minutes in training, a panel for each scenario: means with 95 % bands."""
    rows = [*_drawn()]
    drawing, panels = _panels([row["id"] for row in rows])
    for axes, row in zip(panels, rows, strict=True):
        _draw_curve(axes, row["curve"]["minutes"], row["curve"]["values"])
        for way in WAYS:
            played = row["tests"][GAME][way][_measure(row)][0]
            axes.axhline(played, color="grey", lw=0.8, ls="--" if way == "greedy" else ":")
    drawing.supxlabel(
        "minutes of all seeds, where training has the game's rewards\n"
        "grey: in ViZDoom, greedy (dashed), sampled (dotted)"
    )
    return drawing


def trainers_figure() -> Figure:
    """Results in the game over minutes of a core for each agent, a panel for each scenario."""
    rows = stored()["trainers"]
    ids, trainers = (sorted({row[key] for row in rows}) for key in KEYS["trainers"])
    drawing, panels = _panels(ids)
    for row in rows:
        color, axes = f"C{trainers.index(row['trainer'])}", panels[ids.index(row["id"])]
        _draw_curve(axes, row["minutes"], row["values"], row["trainer"], color)
    lines = panels[0].get_legend_handles_labels()
    drawing.legend(*lines, loc="outside upper center", ncols=len(trainers), frameon=False)
    drawing.supxlabel("minutes of a core for each agent")
    return drawing


def _panels(ids: Sequence[str]) -> tuple[Figure, list[Axes]]:
    """A figure with a panel for each scenario."""
    lines = -(-len(ids) // COLUMNS)
    drawing = new_figure(9.6, 0.6 + 2.2 * lines)
    panels = [*drawing.subplots(lines, min(COLUMNS, len(ids)), squeeze=False).flat]
    for axes in panels[len(ids) :]:
        axes.axis("off")
    for axes, id in zip(panels, ids, strict=False):
        axes.set_title(id, fontsize="small")
        axes.set_ylabel(_measure({"id": id}), fontsize="small")
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    return drawing, panels[: len(ids)]


def _draw_curve(
    axes: Axes, at: Any, values: Any, label: str | None = None, color: str | None = None
) -> None:
    """Means of all seeds with 95 % bands."""
    at, (mean, low, high) = np.asarray(at), band(np.array(values, np.float64))
    there = ~np.isnan(mean)
    (line,) = axes.plot(at[there], mean[there], label=label, color=color)
    axes.fill_between(at[there], low[there], high[there], color=line.get_color(), alpha=0.2, lw=0)
