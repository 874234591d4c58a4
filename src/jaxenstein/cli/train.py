"""`jaxenstein train`: train recurrent PPO, with or without an exploration bonus."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import math
import os
import shlex
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import SettingError, quoted
from ..files import check_links
from ..machine import use_cores
from ..progress import Progress
from ..settings import merge
from ..suite import Task
from .arguments import Parser, UsageError, add_suite, add_tasks, flag, real, whole
from .opening import (
    IMPORT,
    add_config,
    add_training_options,
    baselines,
    check_effect,
    given_training,
    handling,
    import_module_of,
    named,
    print_warning,
    printing_warnings,
)
from .suite import planned as planned_suite
from .suite import tasks_of

if TYPE_CHECKING:
    from ..baselines.divergence import Divergence
    from ..baselines.runs.experiment import Experiment
    from ..baselines.runs.folder import RunFolder
    from ..baselines.runs.metrics import Row, Sink

HELP = "train recurrent PPO, alone or with RND, ICM or E3B"
DESCRIPTION = """\
Train recurrent PPO on any environment, alone (--algo ppo) or with an exploration bonus: random
network distillation (rnd), intrinsic curiosity (icm), or an elliptical episodic bonus (e3b). All
seeds train in parallel in one compiled program. The run directory holds the config with every
option, the metrics of each update and seed as JSON Lines, and the last two checkpoints. Needs the
extra 'baselines': pip install 'jaxenstein[baselines]'.
"""
EPILOG = """\
examples:
  jaxenstein train --env simple --algo rnd --seeds 5 --total-steps 3e6 --out runs/simple-rnd
  jaxenstein train --out runs/simple-rnd --resume
  jaxenstein train --env key-door --algo rnd --recipe tuned --frame-skip 6 --out runs/key-door
  jaxenstein train --config simple-skip6 --out runs/simple
  jaxenstein train --config maze.toml --learning-rate 1e-4 --out runs/maze
  jaxenstein train --suite --algo rnd --out runs/rnd

Ctrl-C stops after the current update and saves a checkpoint. --resume continues from the newest
checkpoint, even after a crash, with the same result as an uninterrupted run. It reads every option
from the run directory. Options that you repeat must be the same, with one exception: a larger
--total-steps trains for longer if the learning rate is constant (--no-anneal).

A seed diverges if its loss, gradient or parameters are not finite. It then stops learning and keeps
its last finite parameters, which 'evaluate', 'play' and 'export' use. The other seeds continue. If
all seeds diverge, training ends with exit status 3. With --on-divergence continue, diverged seeds
continue as they are, and a warning at the end names seeds whose parameters are not finite.

A --config file sets options by name, with underscores instead of hyphens:

  env = "simple"
  algo = "rnd"
  learning_rate = 3e-4
  seeds = 5

'map' is a map as text; 'settings', 'params' and 'grid' are tables. RUN/config.json shows all
options. Flags override the file. 'jaxenstein list --configs' shows the configs of this package,
such as simple-skip6.
"""
# Number of updates whose episodes the progress line averages.
RECENT = 10
# Exit codes.
DIVERGED, INTERRUPTED = 3, 130
# Advice for a run that diverged.
ADVICE = (
    "try a lower --learning-rate, a smaller --gradient-norm, or smaller rewards "
    "(docs/training.md, 'If the agent does not learn')"
)
STOPPING = ("SIGINT", "SIGTERM", "SIGHUP")


def fill(parser: Parser) -> None:
    """Add the arguments, including a flag for every option of the baselines."""
    out = parser.add_argument_group("run directory")
    flag(out, "--out DIR", "the run directory; must be new without --resume", Path, required=True)
    flag(out, "--resume", "continue the run in DIR")
    add_config(out)
    add_suite(out, "train on every task of the benchmark, in DIR/TASK")
    add_tasks(out)
    flag(out, "--budget X", "with --suite: factor on the number of decisions", real(0, 1000), 1.0)
    add_training(parser)
    together = parser.add_argument_group("several processes (the same command in each)")
    flag(together, "--coordinator HOST:PORT", "the address of process 0, with a free port; 'auto' "
         "if Slurm, Open MPI or a TPU pod starts the processes", _address)  # fmt: skip
    flag(together, "--processes N", "the number of processes", whole())
    flag(together, "--process I", "the number of this process, from 0", whole(0))
    add_training_options(parser)


def add_training(parser: Parser) -> None:
    """Add the flags of the execution."""
    how = parser.add_argument_group("execution (only --cores and --minutes affect the result)")
    flag(how, "--chunk K", "updates per call of the compiled program", whole(), 1)
    flag(how, "--save-every SECONDS", "seconds between checkpoints", real(0, 1e9), 60.0)
    cores = "use N CPU cores, each with its own seeds; another N rounds differently"
    flag(how, "--cores N", cores, whole())
    how.add_argument(
        "--minutes",
        type=_end_after,
        default=math.inf,
        dest="end",
        metavar="M",
        help="stop after M minutes, with a checkpoint (default: at the end of training)",
    )
    how.add_argument(
        "--tensorboard",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="write DIR/tensorboard (default: if tensorboard is installed)",
    )
    flag(how, "--wandb PROJECT", "also log to Weights & Biases", str)


def _end_after(minutes: str) -> float:
    """The time on the monotonic clock at which to stop."""
    return time.monotonic() + 60 * real(0, 1e9)(minutes)


def _address(text: str) -> str:
    """The address of process 0."""
    host, _, port = text.rpartition(":")
    if text != "auto" and not (host and port.isdecimal() and 0 < int(port) < 2**16):
        raise argparse.ArgumentTypeError(
            f"must be HOST:PORT, such as 10.0.0.1:1234, or auto, not {quoted(text)}"
        )
    return text


def run(options: argparse.Namespace) -> int:
    """Train, and return the exit code."""
    spread(options)
    if options.budget != 1 and options.suite is None:
        raise UsageError("jaxenstein train: --budget needs --suite; use --total-steps instead")
    tasks = tasks_of(options.suite, options.tasks)
    together = _together(options)
    if options.suite is not None:
        return train_suite(options, tasks)
    if not together:
        return train_one(options)
    processes = baselines("processes")
    with processes.joined(*together):
        code = train_one(options) if processes.is_leader() else _help(options)
        return processes.shared(code)


def _together(options: argparse.Namespace) -> tuple[Any, ...]:
    """The coordinator, the number of processes, and the number of this one; () for one process."""
    given = (options.coordinator, options.processes, options.process)
    if given == (None, None, None):
        return ()
    if options.suite is not None:
        raise UsageError("jaxenstein train: --suite trains in one process, without --coordinator")
    if given == ("auto", None, None):
        return given
    if None in given or options.coordinator == "auto":
        raise UsageError(
            "jaxenstein train: give --coordinator HOST:PORT, --processes and --process together, "
            "or --coordinator auto alone"
        )
    if options.process >= options.processes:
        raise UsageError(
            f"jaxenstein train: --process counts from 0 to {options.processes - 1} with "
            f"--processes {options.processes}, so it cannot be {options.process}"
        )
    return given


def _help(options: argparse.Namespace) -> int:
    """Train with process 0, which has the run directory."""
    processes = baselines("processes")
    plain, chunk = processes.shared(None)
    import_module_of(plain["environment"]["id"])
    experiment = baselines("experiment").Experiment.from_json(plain)
    folder = baselines("folder").RunFolder(options.out, experiment)
    with stopping() as stop:
        baselines("training").train(folder, chunk=chunk, save_every=math.inf, stop=stop)
    return 0


def train_one(options: argparse.Namespace) -> int:
    """Train in one run directory; returns the exit code."""
    with printing_warnings():
        folder = open_folder(options)
    baselines("processes").shared((folder.experiment.to_json(), options.chunk))
    module, colon, _ = (folder.experiment.environment.id or "").rpartition(":")
    modules = dict.fromkeys([*(options.modules or ()), *[module] * bool(colon)])
    again = ["jaxenstein", "train", "--out", str(folder.path), "--resume"]
    again += [word for module in modules for word in (IMPORT, module)]
    again += [] if options.cores is None else ["--cores", str(options.cores)]
    again += [] if options.wandb is None else ["--wandb", options.wandb]
    again += ["--no-tensorboard"] * (options.tensorboard is False)
    return carry_out([lambda: folder], options, shlex.join(again))


def train_suite(options: argparse.Namespace, tasks: Sequence[Task]) -> int:
    """Train on one task of the benchmark after the other; returns the exit code of `carry_out`."""
    check_links(options.out)
    with printing_warnings():
        planned = planned_suite(options.suite, tasks, given_training(options), options.budget)
    check_effect(options, [experiment.config.algo for experiment in planned.values()][:1])
    return carry_out(openings(options, planned), options)


def openings(
    options: argparse.Namespace, planned: Mapping[str, Experiment]
) -> list[Callable[[], RunFolder]]:
    """Functions that open or create the run directory of each of several trainings, by name.

    Raises:
        UsageError: a directory has a run, and `--resume` is not set; or it is, and none has.
        SettingError: the run in a directory has another config.
    """
    config = baselines("folder").CONFIG
    begun = [name for name in planned if os.path.exists(options.out / name / config)]
    if options.resume and not begun:
        raise UsageError(
            f"jaxenstein: no folder in {options.out} has a run to continue; leave out --resume"
        )
    for name in begun:
        open_run(options.out / name, planned[name], options.resume)
    return [
        functools.partial(open_run, options.out / name, experiment, options.resume)
        for name, experiment in planned.items()
    ]


def open_run(path: Path, experiment: Experiment, resume: bool) -> RunFolder:
    """The run directory of one of several trainings; it must be new unless `resume`.

    Raises:
        SettingError: the directory has a run, and `resume` is not set, or it has another config.
    """
    runs = baselines("folder")
    # A copy, whose compiled programs are freed with it.
    experiment = dataclasses.replace(experiment)
    if not resume:
        return runs.RunFolder.create(path, experiment)
    try:
        return runs.RunFolder.open_or_create(path, experiment)
    except SettingError as error:
        again = "repeat the options that the training was started with"
        raise SettingError(f"{error}; {again}") from error


def spread(options: argparse.Namespace) -> None:
    """Turn the requested number of cores into devices."""
    if options.cores is not None:
        use_cores(options.cores)


def open_folder(options: argparse.Namespace) -> RunFolder:
    """Create the run directory, or open the one to resume."""
    runs, parsing = baselines("folder"), baselines("options")
    given = given_training(options)
    if not options.resume:
        experiment = parsing.resolve(named(given, "train"))
        check_effect(options, [experiment.config.algo])
        return runs.RunFolder.create(options.out, experiment)
    folder = runs.RunFolder.open(options.out)
    if given:
        before = parsing.given_by(folder.experiment)
        experiment = parsing.resolve(merge(before, given))
        check_effect(options, [experiment.config.algo])
        folder.continue_as(experiment)
    return folder


def carry_out(
    folders: Sequence[Callable[[], RunFolder]],
    options: argparse.Namespace,
    again: str = "the same command with --resume",
) -> int:
    """Train in one run directory after the other, until the end or a signal.

    Args:
        folders: functions that open the run directories; each is called when its turn comes.
        options: of the command.
        again: the command that continues, for the message.

    Returns:
        The exit code: `INTERRUPTED` if training is not complete, `DIVERGED` if all runs of all
        folders diverged, otherwise 0.
    """
    codes = []
    with stopping() as stop:
        for opening in folders:
            codes.append(_carry_out(opening(), options, stop))
            if codes[-1] == INTERRUPTED or (stop() and opening is not folders[-1]):
                print(f"stopped; to continue: {again}", file=sys.stderr)
                return INTERRUPTED
    return min(codes)


def _carry_out(folder: RunFolder, options: argparse.Namespace, stop: Callable[[], bool]) -> int:
    """Train in a run directory, with a progress line, until the end or a stop.

    Returns:
        The exit code: `DIVERGED` if all runs diverged, `INTERRUPTED` if training is not complete,
        otherwise 0. With `--on-divergence continue`, a run counts as diverged only if its
        parameters at the end are not finite.
    """
    experiment = folder.experiment
    total, runs = experiment.config.updates, len(experiment.runs)
    names = baselines("folder").run_names(experiment)
    many = experiment.config.steps_per_update * runs
    recent: deque[Row] = deque(maxlen=RECENT * runs)
    diverged: dict[int, Divergence] = {}
    with (
        folder.locked(),
        opened_sinks(folder, options) as sinks,
        Progress(total * many, folder.path.name, compiles=True) as progress,
    ):
        watch = baselines("training").StallWatch(runs)

        def notify(update: int, rows: Sequence[Row]) -> None:
            recent.extend(rows)
            # A resumed run already has rows.
            seen = rows or (baselines("metrics").read_metrics(folder.path) if update else [])
            if (warning := watch.check(seen)) is not None:
                progress.say(f"jaxenstein: warning: {warning}")
            for run, found in baselines("metrics").diverged_runs(seen, runs).items():
                if run not in diverged:
                    diverged[run] = found
                    told = f"{found.message(names[run])}. It stops learning; {ADVICE}"
                    progress.say(f"jaxenstein: warning: {told}")
            if rows or update == total:
                progress.note = note_of(recent)
                progress.update(update * many)
            else:
                progress.done = update * many

        done = baselines("training").train(
            folder,
            chunk=options.chunk,
            save_every=options.save_every,
            sinks=sinks,
            notify=notify,
            stop=lambda: stop() or time.monotonic() > options.end,
        )
    where = f"{folder.path}: {done} of {total} updates"
    print("  ".join(filter(None, [where, note_of(recent)])))
    lost = _not_finite(folder)
    if lost:
        print_warning(f"the parameters of {', '.join(lost)} are not finite; {ADVICE}")
    if len(diverged) == runs or (done == total and len(lost) == runs):
        print(f"all {runs} runs diverged" if runs > 1 else "the run diverged", file=sys.stderr)
        return DIVERGED
    return 0 if done == total else INTERRUPTED


def _not_finite(folder: RunFolder) -> list[str]:
    """The names of runs whose parameters are not finite at the end of training."""
    # Runs that stop when they diverge keep finite parameters.
    if folder.experiment.config.on_divergence == "stop":
        return []
    trained = baselines("trained").trained_in(folder)
    names = baselines("folder").run_names(folder.experiment)
    return [name for run, name in enumerate(names) if not trained.finite(run)]


def note_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """The mean return and success rate of the episodes in some rows, as text; "" without any."""
    episodes = sum(row["episodes"] for row in rows)
    if not episodes:
        return ""
    total = sum(row["return_sum"] or 0 for row in rows) / episodes
    rate = sum(row["successes"] for row in rows) / episodes
    return f"return {total:.3g}  success {rate:.0%}"


@contextlib.contextmanager
def opened_sinks(folder: RunFolder, options: argparse.Namespace) -> Iterator[list[Sink]]:
    """Open TensorBoard and Weights & Biases if requested; close them at the end."""
    metrics, runs = baselines("metrics"), baselines("folder")
    names = runs.run_names(folder.experiment)
    with contextlib.ExitStack() as stack:
        sinks: list[Sink] = []
        if options.wandb is not None:
            plain = folder.experiment.to_json()
            sinks.append(metrics.WeightsAndBiases(folder.path, names, options.wandb, plain))
            stack.callback(sinks[-1].close)
        if options.tensorboard is not False:
            try:
                sinks.append(metrics.TensorBoard(folder.path / "tensorboard", names))
                stack.callback(sinks[-1].close)
            except ImportError as error:
                if options.tensorboard:
                    hint = "pip install tensorboard"
                    raise SettingError(f"TensorBoard is not installed ({error}): {hint}") from error
        yield sinks


@contextlib.contextmanager
def stopping() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether a signal asked to stop; a second signal interrupts."""
    asked: list[int] = []

    def ask(signum: int, frame: object) -> None:
        del frame
        if asked:
            raise KeyboardInterrupt
        asked.append(signum)
        # `print` may be running already, and the terminal may be gone.
        with contextlib.suppress(OSError):
            os.write(2, b"\nstopping after this update; repeat to stop at once\n")

    with handling(STOPPING, ask):
        yield lambda: bool(asked)
