"""Sections of the report for the files of the other commands: accelerators, devices, training."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from benchmarks import report_training
from benchmarks.tables import markdown, number

DEVICE_HEAD = (
    *("id", "image", "batch", "steps/s", "frames/s", "of the limit", "compile s", "MiB"),
    "kernels",
)


def other_sections(
    others: Mapping[str, Any], folder: str, pictures: Sequence[str] = ()
) -> Iterator[str]:
    """Paragraphs for `device`, `spread` and both of training, of those that are there.

    Args:
        others: the files by name.
        folder: where they lie, for the commands.
        pictures: paths of the plots of training.
    """
    if "spread" in others:
        yield from _spread(others["spread"], folder)
    if "device" in others:
        yield from _device(others["device"], folder)
    if "training" in others:
        yield from _training(others["training"], folder)
    if report_training.PART in others:
        report = others[report_training.PART]
        yield from report_training.comparison_sections(report, folder, pictures)


def _spread(report: Mapping[str, Any], folder: str) -> Iterator[str]:
    yield "## Many devices"
    yield (
        f"{report['device']}, {report['processes']} process(es): the same work on each device, "
        f"{report['settings']['id']}."
    )
    first = report["rows"][0]["steps_per_second"]["median"]
    body = [
        [
            str(row["devices"]),
            f"{row['batch']:,}",
            f"{row['steps_per_second']['median']:,.0f}",
            number(row["steps_per_second"]["median"] / first),
        ]
        for row in report["rows"]
    ]
    yield markdown(["devices", "environments", "steps/s", "x the first row"], body, left=0)
    yield f"`python -m benchmarks.spread --json {folder}/spread.json`"


def _device(report: Mapping[str, Any], folder: str) -> Iterator[str]:
    bandwidth = report["copy_bytes_per_second"]
    yield "## On an accelerator"
    yield (
        f"{report['device']}, JAX {report['versions']['jax']}. A copy of a large array moves "
        f"{bandwidth / 1e9:,.0f} GB/s, bytes read and written together. The limit of frames alone "
        "is that divided by the bytes of a frame; of steps, kernels are those that one step of "
        "the whole batch starts."
    )
    body = [device_row(row, bandwidth) for row in report["rows"]]
    yield markdown(DEVICE_HEAD, body, left=1)
    yield f"`python -m benchmarks.device --json {folder}/device.json`"


def device_row(row: Mapping[str, Any], bandwidth: float) -> list[str]:
    """The cells of a case measured on an accelerator, beneath `DEVICE_HEAD`."""
    cells = [row["id"], f"{row['width']}x{row['height']}", f"{row['batch']:,}"]
    if "failed" in row:
        return [*cells, row["failed"], "", "", "", "", ""]
    frames, memory, kernels = (
        row["frames_per_second"]["median"], row["program_bytes"], row["kernels_a_step"],
    )  # fmt: skip
    return [
        *cells,
        f"{row['steps_per_second']['median']:,.0f}",
        f"{frames:,.0f}",
        f"{frames * row['frame_bytes'] / bandwidth:.1%}",
        f"{row['compile_seconds']:.1f}",
        "" if memory is None else f"{memory / 2**20:,.0f}",
        "" if kernels is None else f"{kernels['count']:.0f}",
    ]


def _training(report: Mapping[str, Any], folder: str) -> Iterator[str]:
    yield "## Training"
    rate = report["matrix_rate"]
    yield (
        "Whole updates of the baselines: rollout, bonus, advantages, epochs. This machine does "
        f"{rate / 1e9:,.0f} GFLOP/s in one large matrix product."
    )
    body = [
        [
            row["algo"],
            row["dtype"],
            str(row["num_envs"]),
            f"{row['steps_per_second']:,.0f}",
            f"{row['matrix_flops_per_step'] / 1e6:,.0f}",
            f"{row['flops_per_second'] / rate:.0%}",
        ]
        for row in report["rows"]
    ]
    head = [
        "algorithm",
        "dtype",
        "environments",
        "steps/s",
        "MFLOP a step",
        "of the product's rate",
    ]
    yield markdown(head, body, left=2)
    yield f"`python -m benchmarks.training --json {folder}/training.json`"
