"""What the suite measures: its parts, and the subjects of each."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks.adapters import ADAPTERS
from benchmarks.adapters import subjects as adapter_subjects
from benchmarks.frames import FRAMES_KEPT
from benchmarks.measure import Subject
from benchmarks.peers import PEERS, Found, find
from benchmarks.stages import STAGES
from benchmarks.tables import plural
from jaxenstein import environment_ids

# Processes alive at once, each of which takes some 400 MB.
GROUP = 8
OWN = "JAXenstein"
RESIZED, RAW = "vizdoom-gymnasium", "vizdoom-raw"
Groups = list[list[Subject]]


@dataclass(frozen=True)
class Plan:
    """Sizes of everything, and where the peers are.

    Attributes:
        cores: how many this process may use.
        batches: numbers of environments side by side.
        batch: the number where it is not the question.
        ids: environments.
        tasks: those that the other parts take.
        sizes: images, as WxH.
        kinds: observations.
        maps: tiles a side.
        sprites: numbers of them.
        adapter_envs: environments of each adapter.
        partners: of the adapters' partners, whose environments to measure in.
        find: where a peer is.
    """

    cores: int = 1
    batches: tuple[int, ...] = (1, 8, 64, 256, 1024, 4096)
    batch: int = 256
    ids: tuple[str, ...] = environment_ids()
    tasks: tuple[str, ...] = ("my-way-home", "health-gathering")
    sizes: tuple[str, ...] = ("64x64", "84x84", "160x120", "320x240")
    kinds: tuple[str, ...] = ("rgb", "gray", "depth", "labels", "dict")
    maps: tuple[int, ...] = (9, 16, 32, 64, 128, 256)
    sprites: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128)
    adapter_envs: tuple[int, ...] = (64, 1024)
    partners: tuple[str, ...] = ("gymnasium", "gymnax", "stoa", "brax", "sb3")
    find: Callable[[str], Found] = field(default=find)


def quick_plan() -> Plan:
    """Sizes to see the suite work with, not to learn anything from."""
    return Plan(
        batches=(1, 16),
        batch=16,
        ids=("simple", "my-way-home", "health-gathering"),
        tasks=("my-way-home",),
        sizes=("64x64", "160x120"),
        kinds=("rgb", "depth"),
        maps=(9, 32),
        sprites=(1, 16),
        adapter_envs=(16,),
        partners=("gymnasium",),
    )


def peers(plan: Plan) -> Groups:
    """Everybody on one core."""
    ratios = {"x resized": RESIZED, "x raw": RAW}
    viz = "ViZDoom MyWayHome"
    rows = [
        _peer(plan, "vizdoom", RESIZED, f"{viz}, Gymnasium, 320x240 to 64x64 by area"),
        _peer(plan, "vizdoom", f"{RESIZED} resize=linear", f"{viz}, Gymnasium, linear"),
        _peer(plan, "vizdoom", f"{RESIZED} resize=none", f"{viz}, Gymnasium, 320x240"),
        _peer(plan, "vizdoom", f"{RAW} resize=linear", f"{viz}, raw, 160x120 to 64x64, linear"),
        _peer(plan, "vizdoom", RAW, f"{viz}, raw, 160x120, its fastest"),
        *_health_peers(plan),
        _peer(plan, "envpool", "envpool-8", "EnvPool MyWayHome, 8 envs, 64x64 by area"),
        _peer(plan, "miniworld", "miniworld", "MiniWorld Hallway, 80x60 to 64x64 by area"),
        _peer(plan, "miniworld", "miniworld size=64x64 resize=none", "MiniWorld Hallway, 64x64"),
        Subject("loop", f"{OWN} my-way-home, Python loop"),
        *(_own(batch, f"{OWN} my-way-home") for batch in plan.batches if batch <= 1024),
        _own(plan.batch, f"{OWN} health-gathering", id="health-gathering"),
    ]
    return [[_with(row, references=ratios) for row in rows]]


def _health_peers(plan: Plan) -> list[Subject]:
    title, words = "ViZDoom HealthGathering", "scenario=health-gathering"
    return [
        _peer(plan, "vizdoom", f"{RESIZED} {words}", f"{title}, Gymnasium, 64x64 by area"),
        _peer(plan, "vizdoom", f"{RAW} {words}", f"{title}, raw, 160x120, its fastest"),
    ]


def cores(plan: Plan) -> Groups:
    """All cores together, this project and EnvPool."""
    many, batch = plan.cores, plan.batch
    one = f"scan-{batch}"
    rows = [
        Subject(one, f"{OWN}, {batch} environments, scan, one core"),
        Subject(
            f"scan-{batch} cores={many}", f"{OWN}, {batch} environments, scan, XLA's own threads",
            pinned=False, flags="",
        ),
        Subject(
            f"spread-{batch * many} devices={many}",
            f"{OWN}, {batch * many} environments, shard_map, a device each core", pinned=False,
        ),
    ]  # fmt: skip
    for size in plan.sizes:
        for batch in (8, 32) if size == plan.sizes[0] else (32,):
            title = f"EnvPool MyWayHome, {batch} envs, {size} by area"
            name = f"envpool-{batch} size={size} cores={many}"
            rows.append(_with(_peer(plan, "envpool", name, title), pinned=False))
    for words, told in (("resize=linear", "not by area"), ("send=8", "by area, 8 at a time")):
        title = f"EnvPool MyWayHome, 32 envs, 64x64 {told}"
        row = _peer(plan, "envpool", f"envpool-32 {words} cores={many}", title)
        rows.append(_with(row, pinned=False))
    return [[_with(row, references={"x one core": one}) for row in rows]]


def batches(plan: Plan) -> Groups:
    """From one environment to thousands."""
    return [[_own(batch, name, id=name) for batch in plan.batches] for name in plan.tasks]


def limits(plan: Plan) -> Groups:
    """What a step is made of, and what it is bounded by."""
    batch, base = plan.batch, f"scan-{plan.batch}"
    rows = [
        Subject(base, "my-way-home, whole steps"),
        Subject(f"keep-{batch}", "my-way-home, whole steps that keep their frames"),
        Subject(f"frames-{batch}", "my-way-home, frames alone"),
        Subject(f"{base} id=health-gathering", "health-gathering, whole steps"),
        Subject(f"frames-{batch} id=health-gathering", "health-gathering, frames alone"),
        Subject(f"fill-{batch}", "writing as many bytes, by NumPy"),
        Subject(f"fill-{FRAMES_KEPT}", f"the same into room for {FRAMES_KEPT} frames"),
    ]
    return [[_with(row, references={"of my-way-home": base}) for row in rows]]


def stages(plan: Plan) -> Groups:
    """The stages of a step, one by one."""
    groups = []
    for name in plan.tasks:
        base = f"scan-{plan.batch} id={name}"
        rows = [Subject(base, f"{name}, whole step", axes={"id": name, "stage": "the whole step"})]
        for stage, told in STAGES.items():
            words = f"stage-{plan.batch} stage={stage} id={name}"
            rows.append(Subject(words, f"{name}, {told}", axes={"id": name, "stage": told}))
        groups.append([_with(row, references={"of the step": base}) for row in rows])
    return groups


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
        axes = {"id": "ViZDoom", "size": size}
        row = _peer(plan, "vizdoom", f"{RAW} size={size}", title)
        rows.append(_with(row, axes=axes))
    return _beside(plan, rows)


def observations(plan: Plan) -> Groups:
    """Kinds of observations."""
    rows = [
        _own(plan.batch, name, id=name, observation=kind)
        for name in plan.tasks
        for kind in plan.kinds
    ]
    return _beside(plan, rows)


def maps_and_sprites(plan: Plan) -> Groups:
    """Own maps: larger ones, and a hall with ever more sprites."""
    rows = [_own(plan.batch, f"{side}x{side} tiles", map=side) for side in plan.maps]
    rows += [_own(plan.batch, f"{count} sprites", sprites=count) for count in plan.sprites]
    return _beside(plan, rows)


def adapters(plan: Plan) -> Groups:
    """The adapters, each beside the native environments under the same interpreter."""
    groups = []
    for partner in plan.partners:
        found = plan.find(partner)
        modules = set(PEERS[partner].modules)
        missing = {row.module for row in ADAPTERS.values() if row.module} - modules
        rows = []
        names = adapter_subjects(plan.adapter_envs, (), sorted(missing))
        for name in names:
            kind, _, batch = name.rpartition("-")
            native = {"of the scan": f"scan-{batch}", "of the loop": f"adapter-loop-{batch}"}
            rows.append(
                Subject(
                    name,
                    ADAPTERS[kind].title,
                    axes={"batch": int(batch), "partner": partner},
                    references={ratio: other for ratio, other in native.items() if other in names},
                    python=found.python,
                    problem=found.problem,
                )
            )
        groups.append(rows)
    return groups


def _own(batch: int, title: str, **options: Any) -> Subject:
    """This project in a scan."""
    words = "".join(f" {name}={value}" for name, value in options.items())
    return Subject(
        f"scan-{batch}{words}", f"{title}, scan, {plural(batch, 'environment')}",
        axes={"batch": batch, **options},
    )  # fmt: skip


def _peer(plan: Plan, peer: str, name: str, title: str) -> Subject:
    found = plan.find(peer)
    return Subject(name, title, python=found.python, jax=False, problem=found.problem)


def _with(subject: Subject, **changes: Any) -> Subject:
    return dataclasses.replace(subject, **changes)


def _beside(plan: Plan, rows: Sequence[Subject]) -> Groups:
    """Groups of a few subjects, in each of which my-way-home is measured as well."""
    base = f"scan-{plan.batch}"
    reference = Subject(base, f"my-way-home, 64x64, scan, {plan.batch} environments")
    ratio = {"of my-way-home": base}
    return [
        [_with(row, references=ratio) for row in (reference, *rows[start : start + GROUP])]
        for start in range(0, len(rows), GROUP)
    ]


def _fitting(batch: int, size: str) -> int:
    """Fewer environments for larger images, so that frames fit into caches alike."""
    width, _, height = size.partition("x")
    pixels = int(width) * int(height)
    while batch > 1 and batch * pixels > 256 * 160 * 120:
        batch //= 2
    return batch


PARTS: Mapping[str, Callable[[Plan], Groups]] = {
    "peers": peers,
    "cores": cores,
    "batches": batches,
    "limits": limits,
    "stages": stages,
    "environments": environments,
    "resolutions": resolutions,
    "observations": observations,
    "maps-and-sprites": maps_and_sprites,
    "adapters": adapters,
}
