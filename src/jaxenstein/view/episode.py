"""An episode as pictures: the agent's view beside a top-down map, above a line of text."""

from __future__ import annotations

import base64
import dataclasses
import html
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..errors import SettingError, quoted
from ..fields import check_whole
from ..maps.tilemap import TileMap
from ..trajectory import Trajectory
from .recording import (
    ANIMATIONS,
    BACKGROUND,
    TEXT,
    encode_gif,
    enlarge,
    evenly,
    mosaic,
    save_animation,
    save_png,
    scale_to,
)
from .topdown import JUMP, MapPicture, draw_map

CAPTION_HEIGHT = 30
# The side of the map in pixels, and the least height of the first-person view.
MAP_SIZE, VIEW_HEIGHT = 448, 384
SHEET_VIEWS, SHEET_COLUMNS, SHEET_HEIGHT = 32, 8, 112
# The same in a notebook, whose file contains the whole animation as text, and its most frames.
NOTEBOOK_MAP, NOTEBOOK_VIEW, NOTEBOOK_FRAMES = 256, 192, 150


@dataclasses.dataclass(frozen=True)
class Episode:
    """An episode of T steps, as numpy arrays.

    A notebook shows it as an animation.

    Attributes:
        frames: uint8[T + 1, H, W, 3], the agent's view, from the reset on.
        positions: float32[T + 1, 2], (x, y) in tiles.
        headings: float32[T + 1], radians, 0 along +x, growing clockwise on the map.
        rewards: float32[T], of each step.
        closed: bool[T + 1, D], which doors were closed, in the order of the map.
        sprites: float32[T + 1, N, 2], (x, y) of all things, in tiles.
        labels: int32[T + 1, N], label id of each thing.
        visible: bool[T + 1, N], which things were present.
        events: a description of what happened in each of the T steps; "" for nothing.
        tilemap: the map, or None.
        variables: other variables of the agent by name, such as its health: float[T + 1].
        name: the name of the environment.
        field_of_view: horizontal field of view of the frames, in degrees.
        longest_step: how many tiles a step can move the agent; a longer move is a new start.
        ending: how the episode ended: "terminated", "truncated", or "" if it did not.
        trajectory: the trajectory for `replay`; None if neither `make` nor `from_ascii` builds
            the environment.
    """

    frames: np.ndarray
    positions: np.ndarray
    headings: np.ndarray
    rewards: np.ndarray
    closed: np.ndarray
    sprites: np.ndarray
    labels: np.ndarray
    visible: np.ndarray
    events: tuple[str, ...]
    tilemap: TileMap | None = None
    variables: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    name: str = ""
    field_of_view: float = 60.0
    longest_step: float = JUMP
    ending: str = ""
    trajectory: Trajectory | None = None

    @property
    def steps(self) -> int:
        """The number of steps, T."""
        return len(self.rewards)

    @property
    def returns(self) -> np.ndarray:
        """float64[T + 1]: the sum of rewards so far."""
        return np.concatenate([[0.0], np.cumsum(self.rewards, dtype=np.float64)])

    def summary(self) -> str:
        """The name, length, return and end in one line."""
        facts = [f"{self.steps} steps", f"return {self.returns[-1]:.4g}"]
        facts += [self.ending] * bool(self.ending)
        return f"{self.name or 'episode'}: {', '.join(facts)}"

    def save(self, path: str | Path, *, fps: float = 15.0, every: int = 1) -> None:
        """Write the episode to a file, atomically.

        Args:
            path: .gif or, with the extra `video`, .mp4: an animation beside the map; .png: a
                contact sheet of the views; .json: the trajectory, for `replay`.
            fps: frames per second of an animation.
            every: show only every n-th step in an animation.

        Raises:
            SettingError: the suffix is not supported, there is no trajectory, or the extra
                `video` is missing.
            OutputError: the file cannot be written.
        """
        suffix = Path(path).suffix.lower()
        if suffix == ".json":
            if self.trajectory is None:
                raise SettingError(
                    f"the episode of {quoted(self.name)} has no trajectory to save: it was not "
                    "recorded in an environment that make or from_ascii builds"
                )
            self.trajectory.save(path)
        elif suffix == ".png":
            save_sheet(self, path)
        elif suffix in ANIMATIONS:
            save_animation(Pictures(self, every=every), path, fps)
        else:
            raise SettingError(f"{path} should end in {', '.join(ANIMATIONS)}, .png or .json")

    def __repr__(self) -> str:
        """Its summary."""
        return f"<Episode {self.summary()}>"

    def _repr_html_(self) -> str:
        """The animation with its summary, for notebooks; long episodes are thinned out."""
        every = -(-self.steps // (NOTEBOOK_FRAMES - 1)) or 1
        scale = scale_to(self.frames.shape[1:3], NOTEBOOK_VIEW)
        pictures = Pictures(self, scale=scale, map_size=NOTEBOOK_MAP, every=every)
        data = base64.b64encode(encode_gif(pictures)).decode()
        text = html.escape(self.summary() + (f" (every {every} steps shown)" if every > 1 else ""))
        return (
            '<figure style="margin: 0">'
            f'<img alt="{text}" style="max-width: 100%" src="data:image/gif;base64,{data}">'
            f"<figcaption>{text}</figcaption></figure>"
        )


def save_sheet(episode: Episode, path: str | Path) -> None:
    """Write up to 32 views spread over the episode as one PNG.

    Raises:
        OutputError: the file cannot be written.
    """
    times = evenly(len(episode.frames), SHEET_VIEWS)
    scale = scale_to(episode.frames.shape[1:3], SHEET_HEIGHT)
    columns = min(SHEET_COLUMNS, len(times))
    save_png(mosaic(episode.frames[times], columns, scale=scale), path)


class Pictures(Sequence[np.ndarray]):
    """The pictures of an episode, uint8[h, w, 3] each, drawn on demand.

    The pictures of a long episode do not fit into memory. Iterating in order is fast.
    """

    def __init__(
        self,
        episode: Episode,
        *,
        with_map: bool = True,
        scale: int | None = None,
        every: int = 1,
        map_size: int = MAP_SIZE,
        notify: Callable[[int], object] | None = None,
    ) -> None:
        """Prepare the pictures.

        Args:
            episode: the episode; without a tile map there is no map picture.
            with_map: whether to show the map.
            scale: factor by which the view is enlarged; None chooses one.
            every: show only every n-th step; the first and the last frame are always shown.
            map_size: approximate length of the longer side of the map, in pixels.
            notify: called with the number of pictures drawn so far during iteration.

        Raises:
            SettingError: `every` is below 1.
        """
        check_whole("every", every)
        self._episode = episode
        self._scale = scale or scale_to(episode.frames.shape[1:3], VIEW_HEIGHT)
        self._notify = notify
        self._times = [*range(0, episode.steps, every), episode.steps]
        tilemap = episode.tilemap if with_map else None
        self._ground = None if tilemap is None else draw_map(tilemap, size=map_size)

    def __len__(self) -> int:
        """The number of pictures."""
        return len(self._times)

    def __getitem__(self, index: int) -> np.ndarray:  # type: ignore[override]
        """One picture."""
        time = self._times[index]
        ground = None if self._ground is None else self._ground.copy()
        return self._draw(ground, 0, time)

    def __iter__(self) -> Iterator[np.ndarray]:
        """All pictures in order; the path grows from one to the next."""
        ground = None if self._ground is None else self._ground.copy()
        before = 0
        for i, time in enumerate(self._times, 1):
            yield self._draw(ground, before, time)
            before = time
            if self._notify is not None:
                self._notify(i)

    def _draw(self, ground: MapPicture | None, before: int, time: int) -> np.ndarray:
        """The picture of a step, on a map that shows the path up to an earlier step."""
        episode, shot = self._episode, None
        if ground is not None:
            walked = episode.positions[before : time + 1]
            ground.path(walked, before, episode.steps, episode.longest_step)
            shot = overview(ground, episode, time).image()
        text = caption(episode, time)
        return compose_side_by_side(episode.frames[time], shot, text, scale=self._scale)


def overview(ground: MapPicture, episode: Episode, step: int) -> MapPicture:
    """A map with the doors, the things and the agent of one frame."""
    return ground.copy().state(
        pose=(episode.positions[step], float(episode.headings[step])),
        field_of_view=episode.field_of_view,
        closed=episode.closed[step],
        things=(episode.sprites[step], episode.labels[step], episode.visible[step]),
    )


def compose_side_by_side(
    frame: np.ndarray, map_picture: Image.Image | None, caption: Sequence[str], *, scale: int
) -> np.ndarray:
    """Compose the agent's view and the map, above a line of text.

    Args:
        frame: uint8[H, W, 3].
        map_picture: the top-down map, or None to leave it out.
        caption: pieces of text: the last one is aligned right, the others follow each other from
            the left.
        scale: whole factor by which the frame is enlarged.

    Returns:
        uint8[h, w, 3], the same size for all frames and map pictures of the same sizes.
    """
    gap = 6
    view = Image.fromarray(enlarge(frame, scale))
    parts = [view] if map_picture is None else [view, map_picture]
    height = max(part.height for part in parts)
    width = sum(part.width for part in parts) + gap * (len(parts) + 1)
    sheet = Image.new("RGB", (width, height + 2 * gap + CAPTION_HEIGHT), BACKGROUND)
    left = gap
    for part in parts:
        sheet.paste(part, (left, gap + (height - part.height) // 2))
        left += part.width + gap
    _write_caption(sheet, caption, height + gap)
    return np.asarray(sheet)


def _write_caption(sheet: Image.Image, caption: Sequence[str], top: int) -> None:
    draw = ImageDraw.Draw(sheet)
    middle = top + CAPTION_HEIGHT // 2 + 3
    *facts, event = caption
    left = 12
    for fact in facts:
        draw.text((left, middle), fact, TEXT, _font(), anchor="lm")
        left += round(draw.textlength(fact, _font())) + 22
    if sheet.width - left > draw.textlength(event, _font()) + 12:
        draw.text((sheet.width - 12, middle), event, (255, 206, 84), _font(), anchor="rm")


@cache
def _font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(15)


def caption(episode: Episode, step: int, recent: int = 12) -> list[str]:
    """The text for a frame of an episode: step, return, variables, and the latest event.

    Args:
        episode: the episode.
        step: index of the frame, 0 to `episode.steps`.
        recent: for how many steps an event stays visible.
    """
    latest = ""
    for event in episode.events[max(0, step - recent) : step]:
        latest = event or latest
    variables = [f"{name} {values[step]:g}" for name, values in episode.variables.items()]
    return [f"step {step}", f"return {_sum_text(episode, step)}", *variables, latest]


def _sum_text(episode: Episode, step: int) -> str:
    """The return so far, as a whole number if all rewards are whole."""
    total = float(episode.returns[step])
    if not total or np.array_equal(episode.rewards, np.round(episode.rewards)):
        return str(round(total))
    return f"{total:+.4g}"
