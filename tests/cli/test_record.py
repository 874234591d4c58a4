"""`jaxenstein record`: one episode with its map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

import jaxenstein
from jaxenstein import SettingError
from jaxenstein.about import Event, Player
from jaxenstein.cli import main, record
from jaxenstein.cli.record import parse_actions
from jaxenstein.episodes.policies import GENERAL, Script, Scripted, named_policy
from jaxenstein.episodes.recorder import event_words, play
from jaxenstein.episodes.session import NO_OP, Session
from jaxenstein.maps.ascii import parse_ascii
from jaxenstein.maps.symbols import LABEL_COLOURS
from jaxenstein.maps.things import APPLE, GOAL, KEY, MEDKIT
from jaxenstein.tasks.first_person import FirstPerson
from jaxenstein.view import glyphs
from jaxenstein.view.episode import CAPTION_HEIGHT, Episode, Pictures, overview
from jaxenstein.view.ground import FLOOR
from jaxenstein.view.topdown import draw_map

pytestmark = pytest.mark.usefixtures("plain_frames")

NAMES = ("turn left", "turn right", "forward", "backward", "interact")
# One tile takes seven steps of 0.15: a key, its door, and the goal in a row.
MAP = "########\n#S.rR.G#\n########\n"


World = tuple[FirstPerson[Any, Any], Any]


@pytest.fixture(scope="module")
def world() -> World:
    """One environment for all tests, so that it is compiled once."""
    return jaxenstein.from_ascii(MAP, height=8, width=8, autoreset=None, heading=0.0)


@pytest.fixture(scope="module")
def episode(world: World) -> Episode:
    script = [2] * 17 + [4] + [2] * 40
    return play(Session(*world), Script(script), len(script))


def test_episode_describes_events(world: World, episode: Episode) -> None:
    played = episode
    happened = [event for event in played.events if event]
    assert happened == ["picked up a key", "opened a door", "reached the goal"]
    assert played.steps < 57
    assert played.frames.shape == (played.steps + 1, 8, 8, 3)
    np.testing.assert_allclose(played.positions[0], (1.5, 1.5))
    np.testing.assert_allclose(played.positions[1], (1.65, 1.5), rtol=1e-6)
    assert played.rewards[-1] == played.returns[-1] == 1
    assert played.closed[0].all()
    assert not played.closed[-1].any()
    # The goal is there all the time, the key until it is picked up.
    goal, key = played.labels[0].tolist()
    assert (goal, key) == (GOAL.label, KEY.labels[0])
    assert played.visible[:, 0].all()
    picked = played.events.index("picked up a key") + 1
    assert played.visible[:picked, 1].all()
    assert not played.visible[picked:, 1].any()
    np.testing.assert_allclose(played.sprites[0], [(6.5, 1.5), (3.5, 1.5)])
    assert (played.headings == 0).all()
    assert played.tilemap == world[0].tilemap  # type: ignore[attr-defined]
    assert played.variables == {}


def test_images_show_view_and_path(episode: Episode) -> None:
    played = episode
    pictures = list(Pictures(played, with_map=True, scale=10))
    assert len(pictures) == played.steps + 1
    assert len({picture.shape for picture in pictures}) == 1
    assert (pictures[0] != pictures[-1]).any()
    plain = next(iter(Pictures(played, with_map=False, scale=10)))
    assert plain.shape[1] < pictures[0].shape[1]
    np.testing.assert_array_equal(
        plain[6:86, 6:86], np.kron(played.frames[0], np.ones((10, 10, 1)))
    )


def test_long_episodes_can_be_subsampled(episode: Episode) -> None:
    every = list(Pictures(episode, with_map=True, scale=4))
    some = list(Pictures(episode, with_map=True, scale=4, every=7))
    chosen = [*range(0, episode.steps, 7), episode.steps]
    assert len(some) == len(chosen)
    for shot, i in zip(some, chosen, strict=True):
        # The path so far is complete, even if frames are left out.
        np.testing.assert_array_equal(shot, every[i])


FIELD = parse_ascii("########\n#S.....#\n########", "field", goal_required=False)


def moving_things() -> Episode:
    """An agent that respawns after two steps, and a medkit and an apple that come and go.

    The medkit lies at (2.5, 1.5) in frame 1 alone, the apple at (4.5, 1.5) but in frame 2.
    """
    places = np.array([(1.5, 1.5), (1.65, 1.5), (1.8, 1.5), (6.5, 1.5)], np.float32)
    return Episode(
        frames=np.zeros((4, 4, 4, 3), np.uint8),
        positions=places,
        headings=np.full(4, np.pi / 2, np.float32),
        rewards=np.ones(3, np.float32),
        closed=np.zeros((4, 0), bool),
        sprites=np.tile(np.array([(2.5, 1.5), (4.5, 1.55)], np.float32), (4, 1, 1)),
        labels=np.tile(np.array([MEDKIT.label, APPLE.label], np.int32), (4, 1)),
        visible=np.array([(0, 1), (1, 1), (0, 0), (0, 1)], bool),
        events=("", "", "reached the goal, moved to a new start"),
        tilemap=FIELD,
    )


def test_things_appear_and_vanish_from_frame_to_frame() -> None:
    played = moving_things()
    ground = draw_map(FIELD, scale=20)
    medkit, apple = [], []
    for i in range(4):
        image = np.asarray(overview(ground, played, i).image())
        medkit.append(tuple(image[30, 50]) == glyphs.CROSS)
        apple.append(tuple(image[31, 90]) == tuple(LABEL_COLOURS[APPLE.label]))
    assert medkit == [False, True, False, False]
    assert apple == [True, True, False, True]


def test_respawn_is_not_drawn_as_path() -> None:
    played = moving_things()
    *_, last = Pictures(played, with_map=True, scale=96)
    played.visible[:] = False
    *_, bare = Pictures(played, with_map=True, scale=96)
    # The map is on the right, 56 pixels per tile; there is floor between the old and new start.
    left = last.shape[1] - 6 - 8 * 56
    top = (last.shape[0] - CAPTION_HEIGHT - 3 * 56) // 2
    middle = bare[top + 84, left + 3 * 56 : left + 6 * 56]
    assert (middle == FLOOR).all()
    assert (bare[top + 84, left + 84 : left + 95] != FLOOR).any(axis=-1).all()


def test_events_in_words() -> None:
    events = {
        "won": Event("won"),
        "took": Event("took a medkit", "took {} medkits"),
        "died": Event("died"),
    }
    info = {"took": np.int32(2), "died": np.bool_(True), "won": np.bool_(False), "other": 1}
    assert event_words(events, info) == ["took 2 medkits", "died"]
    assert event_words(events, {"took": np.int32(1)}) == ["took a medkit"]
    assert event_words(events, {"died": True, "won": True}) == ["won", "died"]


def test_files(
    world: World,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(record, "open_environment", lambda *_, **__: (*world, "map"))
    gif, sheet = tmp_path / "a.gif", tmp_path / "a.png"
    outputs = ["--out", str(gif), "--sheet", str(sheet), "--fps", "10"]
    assert main(["record", "simple", "--actions", "turn left*3, 2*4", *outputs]) == 0
    out, err = capsys.readouterr()
    assert "7 steps" in out
    assert "100%" in err
    with Image.open(gif) as image:
        assert getattr(image, "n_frames", 1) == 8
        assert image.info["duration"] == 100
    with Image.open(sheet) as image:
        assert image.width == 8 * (112 + 2) + 2
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("arguments", "written", "said"),
    [
        (["--out", "{}/a.png", "--steps", "2"], "a.png", "2 steps, return 0, stopped by --steps"),
        (["--save", "{}/a.json", "--actions", "2*3"], "a.json", "return 0, stopped by --actions"),
        (["--save", "{}/a.json", "--policy", "expert"], "a.json", "return 1, terminated, wrote"),
        (["--save", "{}/a.json", "--policy", "idle"], "a.json", "1000 steps, return 0, truncated"),
    ],
)
def test_single_output_files_and_episode_ending(
    world: World,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    written: str,
    said: str,
) -> None:
    monkeypatch.setattr(record, "open_environment", lambda *_, **__: (*world, "map"))
    assert main(["record", "simple", *(part.format(tmp_path) for part in arguments)]) == 0
    assert said in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == [written]


def test_actions_by_number_name_and_count() -> None:
    assert parse_actions("2,2, forward*3 ,interact,0 * 2", NAMES) == [2, 2, 2, 2, 2, 4, 0, 0]


def test_every_named_policy_acts_or_explains_why_not(world: World) -> None:
    for name in (*GENERAL, "shortest_path"):
        assert play(Session(*world), named_policy(name, *world, 0), 3).steps == 3, name
    known = "idle, random, shortest_path, expert, forward"
    with pytest.raises(SettingError, match=f"has no player 'greedy_medkits'; it has {known}$"):
        named_policy("greedy_medkits", *world, 0)
    with pytest.raises(SettingError, match="did you mean 'shortest_path'"):
        named_policy("shortest-path", *world, 0)
    with pytest.raises(SettingError, match="did you mean 'forward'"):
        named_policy("forwrd", *world, 0)


def test_player_explains_why_it_waits(world: World) -> None:
    patient = Player("waits a while", lambda env, params: waiting, waits="waits: too early")
    played = play(Session(*world), Scripted(patient, *world), 4)
    assert played.events[:4] == ("waits: too early", "waits: too early", "", "")


def waiting(key: jax.Array, state: Any) -> jax.Array:
    del key
    return jnp.where(state.time < 2, NO_OP, 0)
