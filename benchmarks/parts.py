"""The parts of the suite and their subjects; to add a subject, add a row here."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from benchmarks.measure import Groups, Subject
from benchmarks.subjects.common import FIGHTS, PICTURED, SHOOTING
from jaxenstein.catalogue import MAIN_IDS
from jaxenstein.machine import cores_allowed

# Processes to run at the same time; each takes about 400 MB.
GROUP = 8
OWN, TRAINED = "JAXenstein", "RecurrentPPO, ViZDoom"
RESIZED, RAW = "vizdoom-gymnasium", "vizdoom-raw"
# The peers that have the newest and an older JAX.
JAX = "gymnasium", "jax-0.10"
GAME_SIZES = "160x120", "320x240"


@dataclasses.dataclass(frozen=True)
class Plan:
    """The sizes of all parts; `batch` is for parts without their own."""

    batches: tuple[int, ...] = (1, 8, 64, 256, 1024, 4096)
    batch: int = 256
    # The last has the most billboards.
    ids: tuple[str, ...] = (*MAIN_IDS, "minigrid-obstructed-maze-full")
    # The environments of the other parts.
    tasks: tuple[str, ...] = ("my-way-home", "health-gathering")
    sizes: tuple[str, ...] = ("64x64", "84x84", "160x120", "320x240")
    observations: tuple[str, ...] = ("rgb", "gray", "depth", "labels", "dict")
    trained: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128, 256)
    adapted: tuple[int, ...] = (64, 1024)
    networks: tuple[tuple[str, str], ...] = (
        ("tiny", "16x16"), ("small", "16x16"), ("tiny", "64x64"), ("paper", "64x64")
    )  # fmt: skip
    started: tuple[str, ...] = (
        "my-way-home", "health-gathering", "memory-maze-9x9", "key-corridor",
    )  # fmt: skip
    compiled: tuple[str, ...] = tuple(f"doom-{name}" for name in FIGHTS)


# Sizes to test that the suite works; the results mean nothing.
QUICK = Plan(
    batches=(1, 16),
    batch=16,
    ids=("simple", "my-way-home", "health-gathering"),
    tasks=("my-way-home",),
    sizes=("64x64", "160x120"),
    observations=("rgb", "depth"),
    trained=(2,),
    adapted=(16,),
    networks=(("tiny", "16x16"),),
    started=("my-way-home",),
    compiled=("simple",),
)


def peers(plan: Plan) -> Groups:
    """This project and its peers on one core."""
    viz, health = "ViZDoom MyWayHome", "ViZDoom HealthGathering"
    gathering = "scenario=health-gathering"
    rows = [
        _peer("vizdoom", RESIZED, f"{viz}, Gymnasium, 320x240 resized to 64x64 (area)"),
        _peer("vizdoom", f"{RESIZED} resize=linear", f"{viz}, Gymnasium, linear"),
        _peer("vizdoom", f"{RESIZED} resize=none", f"{viz}, Gymnasium, 320x240"),
        _peer("vizdoom", f"{RAW} resize=linear", f"{viz}, raw, 160x120 to 64x64, linear"),
        _peer("vizdoom", RAW, f"{viz}, raw, 160x120, its fastest"),
        _peer("vizdoom", f"{RESIZED} {gathering}", f"{health}, Gymnasium, 64x64 (area)"),
        _peer("vizdoom", f"{RAW} {gathering}", f"{health}, raw, 160x120, its fastest"),
        _peer("envpool", "envpool-8", "EnvPool MyWayHome, 8 envs, 64x64 (area)"),
        _peer("miniworld", "miniworld", "MiniWorld Hallway, 80x60 resized to 64x64 (area)"),
        _peer("miniworld", "miniworld size=64x64 resize=none", "MiniWorld Hallway, 64x64"),
        Subject("loop", f"{OWN} my-way-home, Python loop"),
        *(_own(batch, f"{OWN} my-way-home") for batch in plan.batches if batch <= 1024),
        _own(plan.batch, f"{OWN} health-gathering", id="health-gathering"),
    ]
    return [_beside_vizdoom(rows)]


def scenarios(plan: Plan) -> Groups:
    """ViZDoom's scenarios with weapons or enemies, beside the same environments here."""
    groups = []
    for name in SHOOTING:
        words, own = f" scenario={name}", f"doom-{name}"
        rows = [
            _peer("vizdoom", RESIZED + words, "ViZDoom, resized", id=own),
            _peer("vizdoom", RAW + words, "ViZDoom, raw", id=own),
            *_each_jax(_own(plan.batch, OWN, id=own)),
            _own(plan.batch, f"{OWN}, 4x4 pixels", id=own, size="4x4"),
        ]
        groups.append(_beside_vizdoom(rows, words))
    return groups


def pictures(plan: Plan) -> Groups:
    """`look="game"` beside the same scenarios in ViZDoom: resized, and at the game's own sizes."""
    groups = []
    for name in PICTURED:
        words, own = f" scenario={name}", f"doom-{name}"
        rows = [
            _peer("vizdoom", RESIZED + words, "ViZDoom, resized", id=own, size="64x64"),
            _peer("vizdoom", RAW + words, "ViZDoom, raw", id=own, size="160x120"),
            _own(plan.batch, OWN, id=own, size="64x64", look="game"),
        ]
        groups.append(_beside_vizdoom(rows, words))
        for size in GAME_SIZES:
            raw, batch = f"{RAW}{words} size={size}", _fitting(plan.batch, size, frames=32)
            rows = [
                _peer("vizdoom", raw, "ViZDoom, raw", id=own, size=size),
                _own(batch, OWN, id=own, size=size, look="game"),
            ]
            groups.append(_compared(rows, {"x raw": raw}))
    return groups


def cores(plan: Plan) -> Groups:
    """This project and EnvPool on all cores."""
    many, batch = cores_allowed(), plan.batch
    rows = [
        Subject(f"scan-{batch}", f"{OWN}, {batch} environments, scan, one core"),
        Subject(
            f"scan-{batch} cores={many}", f"{OWN}, {batch} environments, scan, XLA's own threads",
            flags="", pinned=False,
        ),
        Subject(
            f"spread-{batch * many} devices={many}",
            f"{OWN}, {batch * many} environments, shard_map, one device per core", pinned=False,
        ),
    ]  # fmt: skip
    envpools = [(8, "size=64x64", "64x64 (area)")]
    envpools += [(32, f"size={size}", f"{size} (area)") for size in plan.sizes]
    envpools += [(32, "resize=linear", "64x64 (linear)")]
    envpools += [(32, "send=8", "64x64 (area), 8 at a time")]
    for number, words, told in envpools:
        title = f"EnvPool MyWayHome, {number} envs, {told}"
        row = _peer("envpool", f"envpool-{number} {words} cores={many}", title)
        rows.append(dataclasses.replace(row, pinned=False))
    return [_compared(rows, {"x one core": f"scan-{batch}"})]


def batches(plan: Plan) -> Groups:
    """Batches from one environment to thousands."""
    return [[_own(batch, name, id=name) for batch in plan.batches] for name in plan.tasks]


def training(plan: Plan) -> Groups:
    """Recurrent PPO on My Way Home on all cores: this project's, and sb3-contrib's on ViZDoom."""
    groups = []
    for number in plan.trained:
        theirs, axes = f"sb3-{number}", {"envs": number}
        rows = [
            Subject(f"training-{number}", OWN, axes | {"id": OWN}, flags=""),
            _peer("training", theirs, TRAINED, id=TRAINED, **axes),
        ]
        rows = [dataclasses.replace(row, pinned=False) for row in rows]
        groups.append(_compared(rows, {"x RecurrentPPO": theirs}))
    return groups


def environments(plan: Plan) -> Groups:
    """Every id."""
    return _beside(plan, [_own(plan.batch, name, id=name) for name in plan.ids])


def resolutions(plan: Plan) -> Groups:
    """Image sizes, with the two sizes of ViZDoom's game."""
    rows = [
        _own(_fitting(plan.batch, size), name, id=name, size=size)
        for name in plan.tasks
        for size in plan.sizes
    ]
    for size in GAME_SIZES:
        title = f"ViZDoom MyWayHome, raw, {size}"
        rows.append(_peer("vizdoom", f"{RAW} size={size}", title, id="ViZDoom", size=size))
    return _beside(plan, rows)


def observations(plan: Plan) -> Groups:
    """All kinds of observations."""
    pairs = [(name, observation) for name in plan.tasks for observation in plan.observations]
    return _beside(plan, [_own(plan.batch, n, id=n, observation=seen) for n, seen in pairs])


def adapters(plan: Plan) -> Groups:
    """Gymnasium's adapters, beside a loop over native environments."""
    group = []
    for batch in (*plan.adapted, 1):
        loop = f"adapter-loop-{batch}"
        kind, title = (
            ("gymnasium-same-step", "Gymnasium vector, same-step")
            if batch > 1
            else ("gymnasium-single", "Gymnasium, one environment")
        )
        group += [
            Subject(name, told, {"batch": batch}, beside, peer="gymnasium")
            for name, told, beside in (
                (loop, "native, one jitted call a step", {}),
                (f"adapter-{kind}-{batch}", title, {"of the loop": loop}),
            )
        ]
    return [group]


def single(plan: Plan) -> Groups:
    """One Gymnasium environment with the default settings of JAX, beside ViZDoom."""
    del plan
    groups = []
    small = "64x64", 1, "size=160x120 resize=linear", "160x120 to 64x64, linear"
    large = "320x240", 4, "size=320x240 resize=none frame_skip=4", "320x240"
    for size, skip, words, told in (small, large):
        for cores, busy in (("one", ""), ("all", ""), ("all, one of them busy", " busy=1")):
            axes = {"size": size, "frame skip": skip, "cores": cores}
            theirs, raw = f"{RESIZED} {words}{busy}", f"{RAW} {words}{busy}"
            own = f"gymnasium size={size} frame_skip={skip}{busy}"
            rows = [
                _peer("vizdoom", theirs, f"ViZDoom, Gymnasium, {told}", **axes),
                _peer("vizdoom", raw, f"ViZDoom, raw, {told}", **axes),
                *_each_jax(Subject(own, OWN, axes, flags="")),
            ]
            rows = [dataclasses.replace(row, pinned=cores == "one") for row in rows]
            groups.append(_compared(rows, {"x Gymnasium": theirs, "x raw": raw}))
    return groups


def starts(plan: Plan) -> Groups:
    """The first step in a new process, and the compilation of fights, on all cores."""
    rows = [(f"start id={name}", "first step", name) for name in plan.started]
    rows += [
        (f"compile id={name} of={function}", f"compiling {function}", name)
        for name in plan.compiled
        for function in ("reset", "step", "observe")
    ]
    subjects = [
        Subject(name, told, {"id": id_}, flags="", pinned=False) for name, told, id_ in rows
    ]
    return [_each_jax(subject) for subject in subjects]


def convolutions(plan: Plan) -> Groups:
    """Updates of image networks with this project's convolution and with flax's."""
    groups = []
    for network, size in plan.networks:
        words, axes = f" network={network} size={size}", {"network": network, "size": size}
        names = {layer: f"convolution-64 layer={layer}{words}" for layer in ("flax", "patches")}
        rows = [
            Subject(names["flax"], "flax.linen.Conv", axes),
            Subject(names["patches"], "PatchConvolution", axes, {"x flax": names["flax"]}),
        ]
        groups.append(rows)
    return groups


def _own(batch: int, title: str, **options: Any) -> Subject:
    """This project in a scan."""
    words = "".join(f" {name}={value}" for name, value in options.items())
    count = f"{batch} environment{'' if batch == 1 else 's'}"
    return Subject(f"scan-{batch}{words}", f"{title}, scan, {count}",
                   axes={"batch": batch, **options})  # fmt: skip


def _peer(peer: str, name: str, title: str, **axes: Any) -> Subject:
    return Subject(name, title, axes, peer=peer, flags=None)


def _each_jax(subject: Subject) -> list[Subject]:
    """A subject with each version of JAX."""
    return [
        dataclasses.replace(subject, name=f"{subject.name} jax={peer}", peer=peer) for peer in JAX
    ]


def _compared(rows: Iterable[Subject], references: Mapping[str, str]) -> list[Subject]:
    return [dataclasses.replace(row, references=references) for row in rows]


def _beside_vizdoom(rows: Iterable[Subject], words: str = "") -> list[Subject]:
    """Compare rows with ViZDoom resized and raw; `words` end their names."""
    return _compared(rows, {"x resized": RESIZED + words, "x raw": RAW + words})


def _beside(plan: Plan, rows: Sequence[Subject]) -> Groups:
    """Split rows into groups, each with my-way-home as the reference."""
    base = f"scan-{plan.batch}"
    reference = Subject(base, f"my-way-home, 64x64, scan, {plan.batch} environments")
    return [
        _compared((reference, *rows[start : start + GROUP]), {"of my-way-home": base})
        for start in range(0, len(rows), GROUP)
    ]


def _fitting(batch: int, size: str, frames: int = 256) -> int:
    """Fewer environments for larger images, so that frames fit into the cache.

    Together they have at most the pixels of `frames` frames of 160x120.
    """
    width, _, height = size.partition("x")
    while batch > 1 and batch * int(width) * int(height) > frames * 160 * 120:
        batch //= 2
    return batch


PARTS: Mapping[str, Callable[[Plan], Groups]] = {
    "peers": peers,
    "cores": cores,
    "scenarios": scenarios,
    "pictures": pictures,
    "batches": batches,
    "environments": environments,
    "resolutions": resolutions,
    "observations": observations,
    "adapters": adapters,
    "single": single,
    "starts": starts,
    "training-compare": training,
    "convolutions": convolutions,
}
# Measured only by name: PyTorch is large, and no page shows convolutions.
NAMED = ("training-compare", "convolutions")
# The rounds of parts whose chunks take longer than others.
ROUNDS = {"starts": 3}
