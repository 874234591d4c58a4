"""What fuzzing tries, and how it judges what came of it.

A case is some files and some arguments. A target takes them and returns, or raises one of the
project's own errors. Everything else is a defect: another exception or warning, taking too long,
leaving files behind after an error, an error that does not say which file is meant.
"""

from __future__ import annotations

import dataclasses
import hashlib
import re
import signal
import threading
import traceback
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Protocol

from jaxenstein.cli.arguments import UsageError
from jaxenstein.errors import JAXensteinError, MapWarning

from .mutate import Rng

ACCEPTED, REFUSED, DEFECT = "accepted", "refused", "defect"


@dataclasses.dataclass(frozen=True)
class Case:
    """One input: the content of files by name, which may have folders in it, and arguments."""

    files: Mapping[str, bytes]
    args: tuple[str, ...] = ()

    def write(self, folder: Path) -> None:
        """Put the files into a folder."""
        for name, data in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

    @property
    def size(self) -> int:
        """Bytes and arguments, for finding the smallest of several."""
        return sum(map(len, self.files.values())) + sum(map(len, self.args))


class Target(Protocol):
    """Something that reads what others wrote.

    Attributes:
        name: what it is called on the command line.
        named: whether an error must name a file of the case.
        quiet: whether the files must be the same afterwards, also where it is accepted.
    """

    name: str
    named: bool
    quiet: bool

    def seeds(self) -> list[Case]:
        """Valid cases to begin with."""
        ...

    def spoil(self, case: Case, rng: Rng) -> Case:
        """A case with one change."""
        ...

    def run(self, case: Case, folder: Path) -> None:
        """Read the case, whose files are in a folder, which is the working directory."""
        ...


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Attributes:
        kind: `ACCEPTED`, `REFUSED` or `DEFECT`.
        words: the message without what differs from case to case: equal for equal reasons.
        details: the whole message, or the traceback of a defect.
    """

    kind: str
    words: str = ""
    details: str = ""


class TookTooLong(BaseException):
    """A case that hangs; no handler of ordinary errors catches it."""


def attempt(target: Target, case: Case, folder: Path, seconds: float) -> Outcome:
    """Run a case in an empty folder and judge what came of it."""
    case.write(folder)
    before = contents(folder)
    try:
        with limited(seconds), warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", MapWarning)
            target.run(case, folder)
    except (JAXensteinError, UsageError) as error:
        outcome = _refusal(target, case, str(error))
    except TookTooLong:
        return Outcome(DEFECT, f"took longer than {seconds:g} s", traceback.format_exc())
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        words = f"{type(error).__name__} in {Path(where.filename).name}, {where.name}"
        return Outcome(DEFECT, f"{words}: {skeleton(str(error))}", traceback.format_exc())
    else:
        outcome = Outcome(ACCEPTED)
    left = changes(before, contents(folder))
    if left and (target.quiet or outcome.kind == REFUSED):
        return Outcome(DEFECT, f"left files behind: {skeleton(left)}", f"{left}\n{outcome.details}")
    return outcome


def _refusal(target: Target, case: Case, text: str) -> Outcome:
    words = skeleton(text)
    if len(text.strip()) < 8:
        return Outcome(DEFECT, f"an error that says nothing: {words}", text)
    if target.named and not any(Path(name).parts[0] in text for name in case.files):
        return Outcome(DEFECT, f"an error that names no file: {words}", text)
    return Outcome(REFUSED, words, text)


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Interrupt what takes longer, where signals can do that."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "SIGALRM"):
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        raise TookTooLong

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def contents(folder: Path) -> dict[str, str]:
    """A digest of every file below a folder, by name; of links, where they lead."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = f"link to {path.readlink()}"
        elif path.is_file():
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def changes(before: Mapping[str, str], after: Mapping[str, str]) -> str:
    """The files that are new, gone or different, in words."""
    return ", ".join(
        f"{name} {'is new' if name not in before else 'changed' if name in after else 'is gone'}"
        for name in sorted({*before, *after})
        if before.get(name) != after.get(name)
    )


def skeleton(text: str) -> str:
    """A message without quoted words, paths and numbers, so that equal reasons look alike."""
    text = re.sub(r"'[^']*'|\"[^\"]*\"", "'..'", " ".join(text.split()))
    text = re.sub(r"\S*/\S*", "PATH", text)
    return re.sub(r"0x[0-9a-f]+|-?\d[\d.e+-]*|\binf\b|\bnan\b", "N", text)[:160]
