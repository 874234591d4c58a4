"""`jaxenstein evaluate`: measure the returns of agents, and film one of them."""

from __future__ import annotations

import argparse
import dataclasses
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import suite
from ..episodes.policies import Scripted
from ..errors import quoted
from ..evaluation import evaluate, evaluate_player
from ..files import check_apart, check_writable
from ..intervals import mean_interval
from ..params import drawn
from ..players import player_of
from ..progress import Progress
from ..results import Results, check_text, write_results
from ..settings import changed, environment_options
from ..tasks.first_person import GeneratedTask
from ..view.episode import Pictures
from ..view.recording import check_animation, save_animation
from . import suite as suite_commands
from .arguments import (
    OWN,
    Parser,
    UsageError,
    add_agent,
    add_options,
    add_seed,
    add_suite,
    add_tasks,
    flag,
    flag_of,
    real,
    whole,
)
from .listing import between, format_table
from .opening import (
    baselines,
    drawn_by,
    given_options,
    named,
    open_environment,
    print_warning,
    printing_warnings,
    with_map,
    written_anyway,
)
from .own_policy import CONVENTION, is_own, load_own
from .record import play_shown

if TYPE_CHECKING:
    from ..baselines.runs.trained import Trained

HELP = "evaluate agents over many episodes"
DESCRIPTION = f"""\
Play whole episodes with the agents of a run directory, an agent from 'jaxenstein export', or a
pretrained agent ('jaxenstein list --pretrained'). The table shows mean returns and success rates
for the most likely actions ("greedy") and for sampled actions ("sampled"), with 95 % bootstrap
intervals over runs and episodes. --gif also films one episode beside the map.

--env, --map-file, --set and --param test the agents in another environment with the same
observations and actions, without further training. Agents that were trained on a split of levels
play the same split; --set split=test plays the test levels. A diverged run plays with its last
finite parameters, and a warning says so.

--in vizdoom also plays the same number of episodes in ViZDoom, without further training. Both then
have the game's rewards and rules: of the params of training, only the time limit stays. --gif then
shows one episode in both, from the same start. This needs the extra 'vizdoom' and agents trained in
a doom- environment that is not a sparse variant.

--policy MODULE:FUNCTION plays with your own policy, in --env ID or on --map-file FILE.
{CONVENTION}
--policy NAME plays with a scripted player of the task, such as random, idle or expert. Scripted
players see the whole state.

The points of a grid are separate rows of the table, and separate policies in --json.

--suite tests an agent on every task of the benchmark, with sampled actions. Give --policy, or the
folder of 'jaxenstein train --suite' as RUN. Tasks with a split are played on their test levels.
'jaxenstein score --suite' reads the file that --json writes."""
EPILOG = """\
examples:
  jaxenstein evaluate runs/simple-rnd
  jaxenstein evaluate runs/simple-rnd --episodes 1000 --json simple-rnd.json
  jaxenstein evaluate runs/simple-rnd --gif agent.gif --run 2
  jaxenstein evaluate runs/doom-home --in vizdoom --gif both.gif
  jaxenstein evaluate simple.npz
  jaxenstein evaluate runs/held-out --set split=test
  jaxenstein evaluate runs/few-levels --set levels=200,10000
  jaxenstein evaluate runs/dmlab --env dmlab-static-01-respawn
  jaxenstein evaluate --policy my_module:agent --env t-maze --json mine.json
  jaxenstein evaluate --policy random --env t-maze
  jaxenstein evaluate runs/rnd --suite --json rnd.json
  jaxenstein evaluate --policy my_module:seed0 --suite --name seed0 --json seed0.json
"""


def fill(parser: Parser) -> None:
    """Add the arguments."""
    help = "a run directory, FILE.npz or pretrained/NAME"
    parser.add_argument("folder", metavar="RUN", nargs="?", type=Path, help=help)
    what = f"evaluate a scripted player, or your own policy, {OWN}, instead of RUN"
    flag(parser, "--policy NAME", what, str)
    flag(parser, "--name NAME", f"the run's name in --json, for {OWN} (default: {OWN})", str)
    add_suite(parser, "test on every task of the benchmark")
    add_tasks(parser)
    flag(parser, "--episodes N", "episodes for each run", whole(), 100)
    add_seed(parser)
    flag(parser, "--json FILE", "also write the result of every episode as JSON", Path)
    parser.add_argument(
        "--in", dest="game", choices=["vizdoom"], help="also play in the original game"
    )
    elsewhere = ("env", "map_file", "heading", "settings", "params")
    add_options(parser, {name: environment_options()[name] for name in elsewhere})
    shown = parser.add_argument_group("film of one episode")
    flag(shown, "--gif FILE", "write a film: .gif, or .mp4 with the extra 'video'", Path)
    add_agent(shown)
    flag(shown, "--fps RATE", "frames per second, 1 to 50", real(1, 50), 15.0)


def run(options: argparse.Namespace) -> None:
    """Evaluate, print the table, write the files."""
    if (options.folder is None) == (options.policy is None):
        raise UsageError(
            f"jaxenstein evaluate: give either RUN or --policy {OWN} for your own agent"
        )
    _check_policy(options)
    check_apart(
        [options.json, options.gif], [options.folder, given_options(options).get("map_file")]
    )
    if options.json is not None:
        check_writable(options.json)
    if options.gif is not None:
        check_animation(options.gif)
    elif options.greedy or options.number is not None:
        raise UsageError(
            "jaxenstein evaluate: --run and --greedy choose the agent of the film: they need --gif"
        )
    tasks = suite_commands.tasks_of(options.suite, options.tasks)
    if options.suite is not None:
        _suite(options, tasks)
        return
    evaluated = _own(options) if options.policy is not None else _trained(options)
    env = evaluated.env
    with written_anyway(
        options.json, lambda path: write_results(path, [*evaluated.results.values()])
    ):
        print(evaluated.heading)
        print(end=_split_of(env) + _ranges_of(evaluated.results) + _ignored(evaluated.results))
        print(table(evaluated.results))
    if options.gif is not None:
        _film(evaluated.actor(), options)


def _check_policy(options: argparse.Namespace) -> None:
    """Check that the other flags are allowed with --policy and --suite."""
    text = options.policy
    if text is not None:
        if options.greedy or options.number is not None or options.game is not None:
            raise UsageError("jaxenstein evaluate: --run, --greedy and --in need RUN, not --policy")
        if not is_own(text) and not text.isidentifier():
            raise UsageError(
                f"jaxenstein evaluate: --policy must be {OWN} or the name of a scripted player, "
                f"not {quoted(text)}; give a run directory without --policy"
            )
    if options.name is not None:
        if not is_own(text):
            raise UsageError(f"jaxenstein evaluate: --name needs --policy {OWN}")
        check_text("--name", options.name)
    if options.suite is not None:
        given = [flag_of(name) for name in given_options(options)]
        given += ["--gif"] * (options.gif is not None) + ["--in"] * (options.game is not None)
        given += ["--greedy"] * options.greedy + ["--run"] * (options.number is not None)
        if given:
            raise UsageError(f"jaxenstein evaluate: --suite does not accept {', '.join(given)}")


def _suite(options: argparse.Namespace, tasks: Sequence[suite.Task]) -> None:
    """Test on tasks of the benchmark."""
    played: list[tuple[Any, Results]] = []

    def write(path: Path) -> None:
        if 0 < len(played) < len(tasks):
            print_warning(f"{path} has {len(played)} of {len(tasks)} tasks")
        if played:
            write_results(path, [one for _, one in played])

    # After an interruption or an error, the file has the finished tasks.
    with written_anyway(options.json, write):
        for one in suite_commands.evaluated(options, tasks):
            played.append(one)
        print(suite_commands.table(played))


@dataclasses.dataclass(frozen=True)
class Evaluated:
    """The results of an evaluation.

    Attributes:
        heading: a line that describes the evaluation.
        env: the environment.
        results: by the kind of actions, such as "greedy".
        actor: returns the policy to film.
    """

    heading: str
    env: Any
    results: dict[str, Results]
    actor: Callable[[], Any]


def _own(options: argparse.Namespace) -> Evaluated:
    """Evaluate the user's own policy, or a scripted player."""
    given = named(given_options(options), "evaluate")
    env, params, where = open_environment(given, ranges=True, seen=options.gif is not None)
    heading = f"{options.policy} in {where}: {options.episodes} episodes"
    # For the film and the user's function; the evaluation draws its own numbers for each episode.
    told = is_own(options.policy) or options.gif is not None
    shown = drawn_by(params, options.seed) if told else drawn(params, options.seed)
    if not is_own(options.policy):
        results = evaluate_player(env, params, options.policy, options.episodes, options.seed)
        scripted = Scripted(player_of(env, options.policy), env, shown, options.policy)
        return Evaluated(heading, env, {"its own": results}, lambda: scripted)
    own = load_own(options.policy, env, shown, options.name)
    with Progress(options.episodes, "evaluating", unit="episodes", compiles=True) as progress:
        results = evaluate(
            env,
            params,
            own.policy,
            own.carry,
            options.episodes,
            options.seed,
            own.name,
            notify=progress.update,
        )
    return Evaluated(heading, env, {"its own": results}, lambda: own)


def _trained(options: argparse.Namespace) -> Evaluated:
    """Evaluate the agents of a run directory or a file."""
    agents = baselines("agents")
    if options.game is not None:
        # Report a missing game before playing any episode.
        from ..adapters.vizdoom_buffers import load_vizdoom

        load_vizdoom()
    with printing_warnings():
        trained = agents.load_trained(options.folder)
        for run in range(len(trained.experiment.runs)):
            trained.warn(run)
        if options.game is not None:
            trained = agents.by_game_rules(trained)
        trained = _changed(trained, with_map(given_options(options)))
    env = trained.experiment.learner.env
    if options.game is not None:
        from ..adapters.vizdoom import check_scenario

        check_scenario(env)
    if options.number is not None:
        agents.chosen_run(trained, options.number)
    points = trained.points()
    played = _play(points, options)
    results = {
        f"{way}{point.removeprefix(trained.name)}": one for (point, way), one in played.items()
    }
    if options.game is not None:
        results |= {
            f"{way}, in ViZDoom{point.removeprefix(trained.name)}": one
            for (point, way), one in _play(points, options, in_game=True).items()
        }
    many, updates = len(trained.experiment.runs), trained.experiment.config.updates
    runs = f"{many} run{'s' * (many > 1)}, {options.episodes} episodes each"
    heading = f"{options.folder}: update {trained.update} of {updates}, {runs}"
    if options.number is not None:
        shown, number = trained, options.number
    else:
        way = "greedy" if options.greedy else "sampled"
        shown = max(points, key=lambda point: played[point.name, way].returns.mean(axis=1).max())
        number = played[shown.name, way].best
    actor = functools.partial(agents.TrainedPolicy, shown, number, options.greedy)
    return Evaluated(heading, env, results, actor)


def _play(
    points: Sequence[Trained], options: argparse.Namespace, *, in_game: bool = False
) -> dict[tuple[str, str], Results]:
    """The results of all points of a grid, by the name of the point and the kind of actions."""
    agents, results = baselines("agents"), {}
    turns = [(point, way) for point in points for way in agents.WAYS]
    many = options.episodes * len(points[0].experiment.runs)
    told, play = "evaluating", agents.evaluate
    if in_game:
        told, play = "playing ViZDoom", agents.evaluate_in_game
    with Progress(many * len(turns), told, unit="episodes", compiles=not in_game) as progress:
        for number, (point, way) in enumerate(turns):
            results[point.name, way] = play(
                point,
                episodes=options.episodes,
                seed=options.seed,
                greedy=agents.WAYS[way],
                notify=lambda done, before=number * many: progress.update(before + done),
            )
    return results


def _changed(trained: Trained, given: dict[str, Any]) -> Trained:
    """The same networks in another environment, or with other settings and params."""
    if not given:
        return trained
    before = trained.experiment
    after = dataclasses.replace(before, environment=changed(before.environment, given))
    learner = after.learner
    baselines("agents").TrainedPolicy(trained, 0, False).check(learner.env, learner.env_params)
    return dataclasses.replace(trained, experiment=after)


def _split_of(env: Any) -> str:
    """A line that names the split of the levels; "" without a split."""
    if not isinstance(env, GeneratedTask) or env.split is None:
        return ""
    other = "train" if env.split == "test" else "test"
    share = f"test_fraction {float(env.test_fraction):.3g}"
    return f"levels of the {env.split} split ({share}); --set split={other} plays the others\n"


def _ranges_of(results: dict[str, Results]) -> str:
    """A line for each param that episodes draw from a range; "" if there is none."""
    ranges = next(iter(results.values())).environment.ranges
    return "".join(f"{name} from {ends}, drawn for each episode\n" for name, ends in ranges.items())


def _ignored(results: dict[str, Results]) -> str:
    """A line that names the params that do not exist in ViZDoom; "" if it was not played."""
    here, *others = (result.environment.params for result in results.values())
    names = sorted({name for name in here if any(name not in other for other in others)})
    return f"ViZDoom has its own rules and ignores {', '.join(names)}\n" if names else ""


def table(results: dict[str, Results]) -> str:
    """A table of the means with their intervals."""
    rows = [("ACTIONS", "RETURN", "95 %", "SUCCESS", "95 %", "STEPS")]
    for name, result in results.items():
        earned, reached = mean_interval(result.returns), mean_interval(result.successes)
        rows.append(
            (
                name,
                f"{earned.mean:.4g}",
                between(earned, ".4g"),
                f"{reached.mean:.1%}",
                between(reached, ".1%"),
                f"{result.lengths.mean():.4g}",
            )
        )
    return format_table(rows, right=(1, 2, 3, 4, 5))


def _film(policy: Any, options: argparse.Namespace) -> None:
    if options.game is not None:
        from .beside_vizdoom import film

        pictures, summary = film(policy, options.seed)
        save_animation(pictures, options.gif, options.fps)
        print(f"{summary}, wrote {options.gif}")
        return
    env, params = policy.env, drawn_by(policy.params, options.seed)
    episode = play_shown(env, params, options.seed, policy, int(env.most_steps(params)))
    episode = dataclasses.replace(episode, name=policy.name)
    with Progress(episode.steps + 1, "drawing", unit="frames") as progress:
        save_animation(Pictures(episode, notify=progress.update), options.gif, options.fps)
    print(f"{episode.summary()}, wrote {options.gif}")
