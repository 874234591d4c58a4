"""From keys to actions, with a simulated clock."""

from __future__ import annotations

import itertools

import numpy as np

from jaxenstein.interactive.controls import HOLD, Controls, keys_of
from jaxenstein.tasks.steering import ACTION_NAMES, BACKWARD, FORWARD, INTERACT
from jaxenstein.tasks.steering import TURN_LEFT as LEFT
from jaxenstein.tasks.steering import TURN_RIGHT as RIGHT

FPS = 10.0


def played(controls: Controls, start: float, seconds: float) -> list[tuple[float, int]]:
    """The actions of a display that polls every millisecond, each with its time."""
    found = []
    for tick in range(round(1000 * seconds)):
        now = start + tick / 1000
        due = controls.due(now)
        action = controls.take(now)
        # Only due actions are taken.
        assert (due == 0.0) == (action is not None)
        if action is not None:
            found.append((round(now, 3), action))
    return found


def test_every_listed_key_acts() -> None:
    wanted = {
        FORWARD: ("w", "up"),
        BACKWARD: ("s", "down"),
        LEFT: ("a", "left"),
        RIGHT: ("d", "right"),
        INTERACT: ("space",),
    }
    for action, keys in wanted.items():
        for key in keys:
            controls = Controls(ACTION_NAMES, FPS)
            assert controls.press(key, 0.0)
            assert controls.take(0.0) == action


def test_keys_without_a_meaning_do_nothing() -> None:
    controls = Controls(ACTION_NAMES[:3], FPS)
    # The first three actions do without backward and interact.
    for key in ("s", "down", "space", "x", "1", ""):
        assert not controls.press(key, 0.0)
    assert controls.due(0.0) is None
    assert controls.take(0.0) is None


def test_keys_pressed_together_give_the_combined_action() -> None:
    """As in Doom with buttons="all"; without a combined action, keys take turns."""
    names = ("nothing", "attack", "turn left", "turn left + attack", "turn right")
    assert keys_of(names)["turn left + attack"] == ()
    controls = Controls(names, FPS)
    controls.press("a", 0.0)
    controls.press("space", 0.05)
    assert {action for _, action in played(controls, 0.0, 0.95)} == {3}
    controls.release("a")
    assert {action for _, action in played(controls, 1.0, 0.95)} == {1}
    # There is no action for turning right and shooting, and opposite directions exclude each other.
    controls.press("d", 2.0)
    assert {action for _, action in played(controls, 2.0, 0.95)} == {1, 4}
    controls.release("space")
    controls.press("a", 3.0)
    assert {action for _, action in played(controls, 3.01, 0.9)} == {2}


def test_waiting_taps_combine_into_one_action() -> None:
    """As in a terminal: released at once."""
    controls = Controls(("attack", "turn left", "turn left + attack"), FPS)
    for key in ("space", "a"):
        controls.press(key, 0.0)
        controls.release(key)
    assert [action for _, action in played(controls, 0.0, 0.5)] == [2]


def test_unknown_actions_get_digits() -> None:
    names = ("jump", "forward", "duck")
    assert keys_of(names) == {"jump": ("1",), "forward": ("w", "up"), "duck": ("2",)}
    controls = Controls(names, FPS)
    controls.press("2", 0.0)
    assert controls.take(0.0) == 2
    assert keys_of([f"action {i}" for i in range(11)])["action 10"] == ()


def test_two_actions_never_share_a_key() -> None:
    names = ("interact", "attack", "drop")
    assert keys_of(names) == {"interact": ("space",), "attack": ("f",), "drop": ("1",)}
    names = ("forward", "weapon 1", "jump")
    assert keys_of(names) == {"forward": ("w", "up"), "weapon 1": ("1",), "jump": ("2",)}


def test_tap_of_any_length_is_one_step() -> None:
    for length in (0.0, 0.03, 0.9 * HOLD):
        controls = Controls(ACTION_NAMES, FPS)
        controls.press("w", 5.0)
        before = played(controls, 5.0, length)
        controls.release("w")
        assert [action for _, action in before + played(controls, 5.0 + length, 1.0)] == [FORWARD]


def test_held_key_repeats_at_the_frame_rate() -> None:
    controls = Controls(ACTION_NAMES, FPS)
    controls.press("up", 5.0)
    times = [time for time, _ in played(controls, 5.0, 1.05)]
    assert times[:2] == [5.0, 5.0 + HOLD]
    assert all(abs(b - a - 0.1) < 2e-3 for a, b in itertools.pairwise(times[1:]))
    assert len(times) == 10
    controls.release("up")
    assert played(controls, 6.05, 0.5) == []
    assert controls.due(7.0) is None


def test_irregular_polling_keeps_the_rate() -> None:
    controls = Controls(ACTION_NAMES, FPS)
    controls.press("w", 0.0)
    looks = np.cumsum(np.random.default_rng(0).uniform(0.001, 0.09, 400))
    steps = sum(controls.take(float(now)) is not None for now in looks)
    # One at once, and then ten per second.
    assert abs(steps - 1 - FPS * (looks[-1] - HOLD)) < 2


def test_taps_between_steps_wait_for_their_turn() -> None:
    controls = Controls(ACTION_NAMES, FPS)
    for key in ("w", "w", "d", "space", "d"):
        controls.press(key, 5.0)
        controls.release(key)
    # A second press of a waiting key adds no step.
    assert [action for _, action in played(controls, 5.0, 1.0)] == [FORWARD, RIGHT, INTERACT]


def test_keys_held_together_take_turns() -> None:
    controls = Controls(ACTION_NAMES, FPS)
    controls.press("w", 5.0)
    assert len(played(controls, 5.0, 0.6)) == 5
    controls.press("a", 5.6)
    actions = [action for _, action in played(controls, 5.6, 0.6)]
    assert actions == [LEFT, FORWARD] * 3
    controls.release("w")
    assert {action for _, action in played(controls, 6.2, 0.5)} == {LEFT}


def test_later_of_two_opposite_keys_counts() -> None:
    controls = Controls(ACTION_NAMES, FPS)
    controls.press("w", 5.0)
    played(controls, 5.0, 0.6)
    controls.press("s", 5.6)
    assert {action for _, action in played(controls, 5.6, 0.5)} == {BACKWARD}
    controls.release("s")
    assert {action for _, action in played(controls, 6.1, 0.5)} == {FORWARD}


def test_clearing_forgets_held_keys() -> None:
    controls = Controls(ACTION_NAMES, FPS)
    controls.press("w", 5.0)
    controls.press("d", 5.0)
    controls.clear()
    assert played(controls, 5.0, 1.0) == []
