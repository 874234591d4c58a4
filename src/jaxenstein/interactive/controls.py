"""From keys to actions: the key of each action, and when a held key acts again."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

# Keys of each action by its name; the help lists the first one first. If two actions of an
# environment share a key, the earlier action has it.
ACTION_KEYS: dict[str, tuple[str, ...]] = {
    "forward": ("w", "up"),
    "backward": ("s", "down"),
    "turn left": ("a", "left"),
    "turn right": ("d", "right"),
    "move left": ("z",),
    "move right": ("c",),
    "nothing": ("x",),
    "interact": ("space",),
    "attack": ("space", "f"),
    "pick up": ("e",),
    "drop": ("f",),
    "done": ("g",),
    "forward and turn left": ("u",),
    "forward and turn right": ("o",),
    **{f"weapon {number}": (str(number),) for number in range(1, 7)},
    "next weapon": ("v",),
    "previous weapon": ("b",),
    "speed": ("8",),
    "strafe": ("9",),
}
OPPOSITES = {
    "forward": "backward",
    "backward": "forward",
    "turn left": "turn right",
    "turn right": "turn left",
    "move left": "move right",
    "move right": "move left",
}
# Joins the names of actions that one action takes at once, as with `buttons="all"` in Doom's tasks.
AND = " + "
# Seconds for which a key must be held before it acts again: a tap is one step.
HOLD = 0.2


def keys_of(action_names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """The keys of each action by its name; other actions get the keys 1 to 9.

    Combined actions have no keys: you press the keys of their parts together.
    """
    found: dict[str, tuple[str, ...]] = {}
    taken: set[str] = set()
    for name in action_names:
        own = () if AND in name else ACTION_KEYS.get(name, ())
        found[name] = tuple(key for key in own if key not in taken)
        taken.update(found[name])
    digits = iter(sorted({*"123456789"} - taken))
    for name, keys in found.items():
        if not keys and AND not in name:
            found[name] = tuple(itertools.islice(digits, 1))
    return found


class Controls:
    """The keys pressed and held, as actions at a limited rate.

    A press is one action, unless an earlier press of the same action is still waiting. A held key
    repeats. Several held keys become one combined action if there is one. Otherwise they take
    turns, so the player walks in curves. Of two opposite keys the later one counts.
    """

    def __init__(self, action_names: Sequence[str], fps: float) -> None:
        """Start with no key pressed.

        Args:
            action_names: the action names of the environment.
            fps: the maximum number of actions per second.
        """
        keys = keys_of(action_names)
        self._actions = {key: i for i, name in enumerate(action_names) for key in keys[name]}
        index = {name: i for i, name in enumerate(action_names)}
        self._opposite = {
            index[name]: index[other]
            for name, other in OPPOSITES.items()
            if name in index and other in index
        }
        self._names = tuple(action_names)
        self._together = {
            frozenset(name.split(AND)): i for i, name in enumerate(action_names) if AND in name
        }
        self._interval = 1 / fps
        self._waiting: list[int] = []
        self._held: dict[str, float] = {}
        self._turns: list[int] = []
        self._ready = 0.0

    def press(self, key: str, now: float) -> bool:
        """Press a key at the time `now` (seconds); returns whether it belongs to an action."""
        action = self._actions.get(key)
        if action is None:
            return False
        if action not in self._waiting:
            self._waiting.append(action)
        # A player who is already moving can turn without waiting.
        self._held[key] = now if self._held else now + HOLD
        return True

    def release(self, key: str) -> None:
        """Release a key; a press that is still waiting counts."""
        self._held.pop(key, None)

    def clear(self) -> None:
        """Forget all keys, even those that are held."""
        self._waiting.clear()
        self._held.clear()

    def due(self, now: float) -> float | None:
        """Seconds until the next action; None if no key is pressed."""
        times = [self._ready] * bool(self._waiting) + list(self._held.values())
        return max(0.0, max(self._ready, min(times)) - now) if times else None

    def take(self, now: float) -> int | None:
        """The action to take now, if one is due."""
        if now < self._ready:
            return None
        action = self._waiting.pop(0) if self._waiting else self._repeated(now)
        if action is not None:
            # A slightly late step does not delay the following ones.
            late = now - self._ready
            self._ready = now + self._interval - (late if late < self._interval else 0.0)
            self._turns = [*(turn for turn in self._turns if turn != action), action]
            action = self._joined(action)
        return action

    def _joined(self, action: int) -> int:
        """The action that combines this one with those of all other keys, if there is one."""
        down = [self._actions[key] for key in self._held]
        asked = _unopposed([*down, *self._waiting, action], self._opposite)
        both = self._together.get(frozenset(self._names[one] for one in asked))
        if both is None:
            return action
        self._waiting = [one for one in self._waiting if one not in asked]
        return both

    def _repeated(self, now: float) -> int | None:
        held = [self._actions[key] for key, start in self._held.items() if start <= now]
        held = _unopposed(held, self._opposite)
        if not held:
            return None
        return min(held, key=lambda a: self._turns.index(a) if a in self._turns else -1)


def _unopposed(actions: Sequence[int], opposite: dict[int, int]) -> list[int]:
    """The actions, without those whose opposite comes later."""
    return [one for i, one in enumerate(actions) if opposite.get(one) not in actions[i:]]
