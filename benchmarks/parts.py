"""What the suite measures: its parts, and the subjects of each. A further subject is a row here."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from benchmarks.install import PEERS
from benchmarks.measure import Groups, Subject
from benchmarks.subjects.common import FRAMES_KEPT, SCENARIOS, SHOOTING
from jaxenstein.catalogue import ENTRIES, MAIN_IDS
from jaxenstein.machine import cores_allowed

# Processes alive at once, each of which takes some 400 MB.
GROUP = 8
OWN, TRAINED = "JAXenstein", "RecurrentPPO, ViZDoom"
RESIZED, RAW = "vizdoom-gymnasium", "vizdoom-raw"
# The adapters: their subjects, what to call them, and their partners' modules.
SCANNED = {
    "adapter-gymnax": ("gymnax, in a scan", "gymnax"),
    "adapter-stoa": ("Stoa, in a scan", "stoa"),
}
CALLED = {
    "adapter-torch": ("Torch", "torch"),
    "adapter-gymnasium-same-step": ("Gymnasium vector, same-step", "gymnasium"),
    "adapter-gymnasium-next-step": ("Gymnasium vector, next-step", "gymnasium"),
    "adapter-sb3": ("Stable-Baselines3", "stable_baselines3"),
}
SINGLE = {"adapter-gymnasium-single": ("Gymnasium, one environment", "gymnasium")}


@dataclasses.dataclass(frozen=True)
class Plan:
    """Sizes of everything: of the parts that have them in the plural, and `batch` of the others."""

    batches: tuple[int, ...] = (1, 8, 64, 256, 1024, 4096)
    batch: int = 256
    ids: tuple[str, ...] = MAIN_IDS
    # Those that the other parts take.
    tasks: tuple[str, ...] = ("my-way-home", "health-gathering")
    sizes: tuple[str, ...] = ("64x64", "84x84", "160x120", "320x240")
    observations: tuple[str, ...] = ("rgb", "gray", "depth", "labels", "dict")
    maps: tuple[int, ...] = (9, 16, 32, 64, 128, 256)
    sprites: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128)
    skips: tuple[int, ...] = (1, 4)
    trained: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128, 256)
    adapted: tuple[int, ...] = (64, 1024)
    # Those whose resets and first frames are waited for.
    waits: tuple[str, ...] = (
        "my-way-home", "health-gathering", "key-corridor", "memory-maze-9x9",
        "minigrid-door-key-8x8", "doom-my-way-home",
    )  # fmt: skip
    # Of the adapters' partners, whose environments to measure in.
    partners: tuple[str, ...] = ("gymnasium", "gymnax", "stoa", "sb3")


# Sizes to see the suite work with, not to learn anything from.
QUICK = Plan(
    batches=(1, 16),
    batch=16,
    ids=("simple", "my-way-home", "health-gathering"),
    tasks=("my-way-home",),
    sizes=("64x64", "160x120"),
    observations=("rgb", "depth"),
    maps=(9, 32),
    sprites=(1, 16),
    trained=(2,),
    adapted=(16,),
    waits=("my-way-home",),
    partners=("gymnasium",),
)


def peers(plan: Plan) -> Groups:
    """Everybody on one core."""
    viz, health = "ViZDoom MyWayHome", "ViZDoom HealthGathering"
    gathering = "scenario=health-gathering"
    rows = [
        _peer("vizdoom", RESIZED, f"{viz}, Gymnasium, 320x240 to 64x64 by area"),
        _peer("vizdoom", f"{RESIZED} resize=linear", f"{viz}, Gymnasium, linear"),
        _peer("vizdoom", f"{RESIZED} resize=none", f"{viz}, Gymnasium, 320x240"),
        _peer("vizdoom", f"{RAW} resize=linear", f"{viz}, raw, 160x120 to 64x64, linear"),
        _peer("vizdoom", RAW, f"{viz}, raw, 160x120, its fastest"),
        _peer("vizdoom", f"{RESIZED} {gathering}", f"{health}, Gymnasium, 64x64 by area"),
        _peer("vizdoom", f"{RAW} {gathering}", f"{health}, raw, 160x120, its fastest"),
        _peer("envpool", "envpool-8", "EnvPool MyWayHome, 8 envs, 64x64 by area"),
        _peer("miniworld", "miniworld", "MiniWorld Hallway, 80x60 to 64x64 by area"),
        _peer("miniworld", "miniworld size=64x64 resize=none", "MiniWorld Hallway, 64x64"),
        Subject("loop", f"{OWN} my-way-home, Python loop"),
        *(_own(batch, f"{OWN} my-way-home") for batch in plan.batches if batch <= 1024),
        _own(plan.batch, f"{OWN} health-gathering", id="health-gathering"),
    ]
    return [_beside_vizdoom(rows)]


def frame_skips(plan: Plan) -> Groups:
    """Steps of the world a second where an action lasts for several of them, as in `scenarios`.

    Beside the environments that are ViZDoom's own scenarios, `doom-...`, the project's tasks of the
    same name.
    """
    groups = []
    for name in SCENARIOS:
        rows: list[Subject] = []
        for skip in plan.skips:
            words, axes = f"scenario={name} frame_skip={skip}", {"frame_skip": skip}
            told = f"frame skip {skip}"
            rows += [
                _peer("vizdoom", f"{RESIZED} {words}", f"ViZDoom, resized, {told}", **axes),
                _peer("vizdoom", f"{RAW} {words}", f"ViZDoom, raw, {told}", **axes),
                *(
                    _own(plan.batch, own, id=own, frame_skip=skip)
                    for own in (f"doom-{name}", name) if own in ENTRIES
                ),
            ]  # fmt: skip
        groups.append(_beside_vizdoom(rows, f" scenario={name} frame_skip={plan.skips[0]}"))
    return groups


def scenarios(plan: Plan) -> Groups:
    """ViZDoom's scenarios with weapons or enemies, each beside the environment of its name."""
    groups = []
    for name in SHOOTING:
        words, own = f" scenario={name}", f"doom-{name}"
        rows = [
            _peer("vizdoom", RESIZED + words, "ViZDoom, resized", id=own),
            _peer("vizdoom", RAW + words, "ViZDoom, raw", id=own),
            _own(plan.batch, OWN, id=own),
        ]
        groups.append(_beside_vizdoom(rows, words))
    return groups


def cores(plan: Plan) -> Groups:
    """All cores together, this project and EnvPool."""
    many, batch = cores_allowed(), plan.batch
    rows = [
        Subject(f"scan-{batch}", f"{OWN}, {batch} environments, scan, one core"),
        Subject(
            f"scan-{batch} cores={many}", f"{OWN}, {batch} environments, scan, XLA's own threads",
            flags="", pinned=False,
        ),
        Subject(
            f"spread-{batch * many} devices={many}",
            f"{OWN}, {batch * many} environments, shard_map, a device each core", pinned=False,
        ),
    ]  # fmt: skip
    envpools = [(8, "size=64x64", "64x64 by area")]
    envpools += [(32, f"size={size}", f"{size} by area") for size in plan.sizes]
    envpools += [(32, "resize=linear", "64x64 not by area")]
    envpools += [(32, "send=8", "64x64 by area, 8 at a time")]
    for number, words, told in envpools:
        title = f"EnvPool MyWayHome, {number} envs, {told}"
        row = _peer("envpool", f"envpool-{number} {words} cores={many}", title)
        rows.append(dataclasses.replace(row, pinned=False))
    return [_compared(rows, {"x one core": f"scan-{batch}"})]


def batches(plan: Plan) -> Groups:
    """From one environment to thousands."""
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


def resets(plan: Plan) -> Groups:
    """A batch of resets, beside as many steps with automatic resets."""
    groups = []
    for name in plan.waits:
        step = _own(plan.batch, name, id=name)
        words, title = f"reset-{plan.batch} id={name}", f"{name}, resets alone"
        rows = [step, Subject(words, title, {"batch": plan.batch, "id": name})]
        groups.append(_compared(rows, {"of a step": step.name}))
    return groups


def starts(plan: Plan) -> Groups:
    """From the start of an interpreter to its end: the imports, or a reset and a step."""
    rows = [
        Subject(f"start until={module}", f"import {module}") for module in ("jax", "jaxenstein")
    ]
    for name in plan.waits:
        words, told = f"start until=frames id={name}", f"first frames of {name}"
        rows.append(Subject(words, told, {"id": name}))
        rows.append(Subject(f"{words} cache=yes", f"{told}, compiled before", {"id": name}))
    return [_compared(rows, {"of import jax": rows[0].name})]


def limits(plan: Plan) -> Groups:
    """What bounds a step."""
    batch, health = plan.batch, "id=health-gathering"
    rows = [
        Subject(f"scan-{batch}", "my-way-home, whole steps"),
        Subject(f"keep-{batch}", "my-way-home, whole steps that keep their frames"),
        Subject(f"frames-{batch}", "my-way-home, frames alone"),
        Subject(f"scan-{batch} {health}", "health-gathering, whole steps"),
        Subject(f"frames-{batch} {health}", "health-gathering, frames alone"),
        Subject(f"fill-{batch}", "writing as many bytes, by NumPy"),
        Subject(f"fill-{FRAMES_KEPT}", f"the same into room for {FRAMES_KEPT} frames"),
    ]
    return [_compared(rows, {"of my-way-home": f"scan-{batch}"})]


def environments(plan: Plan) -> Groups:
    """Every id."""
    return _beside(plan, [_own(plan.batch, name, id=name) for name in plan.ids])


def resolutions(plan: Plan) -> Groups:
    """Image sizes, with ViZDoom's game at the two that it has."""
    rows = [
        _own(_fitting(plan.batch, size), name, id=name, size=size)
        for name in plan.tasks
        for size in plan.sizes
    ]
    for size in ("160x120", "320x240"):
        title = f"ViZDoom MyWayHome, raw, {size}"
        rows.append(_peer("vizdoom", f"{RAW} size={size}", title, id="ViZDoom", size=size))
    return _beside(plan, rows)


def observations(plan: Plan) -> Groups:
    """Observations of every sort."""
    pairs = [(name, observation) for name in plan.tasks for observation in plan.observations]
    return _beside(plan, [_own(plan.batch, n, id=n, observation=seen) for n, seen in pairs])


def maps_and_sprites(plan: Plan) -> Groups:
    """Own maps: larger ones, and a hall with ever more sprites."""
    rows = [_own(plan.batch, f"{side}x{side} tiles", map=side) for side in plan.maps]
    rows += [_own(plan.batch, f"{count} sprites", sprites=count) for count in plan.sprites]
    return _beside(plan, rows)


def adapters(plan: Plan) -> Groups:
    """The adapters, each beside the native environments under the same interpreter."""
    groups = []
    for partner in plan.partners:
        group = []
        for batch in (*plan.adapted, 1):
            scan, loop = f"scan-{batch}", f"adapter-loop-{batch}"
            rows = [(scan, "native, in a scan", {}), (loop, "native, one jitted call a step", {})]
            for table, ratio, native in (
                (SCANNED if batch > 1 else {}, "of the scan", scan),
                (CALLED if batch > 1 else SINGLE, "of the loop", loop),
            ):
                rows += [
                    (f"{kind}-{batch}", title, {ratio: native})
                    for kind, (title, module) in table.items() if module in PEERS[partner].modules
                ]  # fmt: skip
            # What nothing is held up against need not be measured.
            needed = {name for *_, beside in rows for name in beside.values()}
            group += [
                Subject(name, title, {"batch": batch, "partner": partner}, beside, peer=partner)
                for name, title, beside in rows if beside or name in needed
            ]  # fmt: skip
        groups.append(group)
    return groups


def _own(batch: int, title: str, **options: Any) -> Subject:
    """This project in a scan."""
    words = "".join(f" {name}={value}" for name, value in options.items())
    told = f"frame skip {options['frame_skip']}, " if "frame_skip" in options else ""
    count = f"{batch} environment{'' if batch == 1 else 's'}"
    return Subject(f"scan-{batch}{words}", f"{title}, {told}scan, {count}",
                   axes={"batch": batch, **options})  # fmt: skip


def _peer(peer: str, name: str, title: str, **axes: Any) -> Subject:
    return Subject(name, title, axes, peer=peer, flags=None)


def _compared(rows: Iterable[Subject], references: Mapping[str, str]) -> list[Subject]:
    return [dataclasses.replace(row, references=references) for row in rows]


def _beside_vizdoom(rows: Iterable[Subject], words: str = "") -> list[Subject]:
    """Compared to ViZDoom resized and raw, whose names go on with these words."""
    return _compared(rows, {"x resized": RESIZED + words, "x raw": RAW + words})


def _beside(plan: Plan, rows: Sequence[Subject]) -> Groups:
    """Groups of a few subjects, in each of which my-way-home is measured as well."""
    base = f"scan-{plan.batch}"
    reference = Subject(base, f"my-way-home, 64x64, scan, {plan.batch} environments")
    return [
        _compared((reference, *rows[start : start + GROUP]), {"of my-way-home": base})
        for start in range(0, len(rows), GROUP)
    ]


def _fitting(batch: int, size: str) -> int:
    """Fewer environments for larger images, so that frames fit into caches alike."""
    width, _, height = size.partition("x")
    while batch > 1 and batch * int(width) * int(height) > 256 * 160 * 120:
        batch //= 2
    return batch


PARTS: Mapping[str, Callable[[Plan], Groups]] = {
    "peers": peers,
    "cores": cores,
    "frame-skip": frame_skips,
    "scenarios": scenarios,
    "batches": batches,
    "limits": limits,
    "environments": environments,
    "resolutions": resolutions,
    "observations": observations,
    "maps-and-sprites": maps_and_sprites,
    "adapters": adapters,
    "resets": resets,
    "starts": starts,
    "training-compare": training,
}
# Measured only where it is named: PyTorch is large.
NAMED = ("training-compare",)
