"""From keys to actions: which key asks for what, and when a key that is held acts again."""

from __future__ import annotations

from collections.abc import Sequence

# Keys of each action by its name; the first one is named first in the help. Of two actions of one
# environment that would have the same key, the earlier has it.
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
# Between the names of actions that one action takes at once, as of `buttons="all"` of Doom's tasks.
AND = " + "
# Seconds for which a key must be held before it acts again: a tap is one step.
HOLD = 0.2


def keys_of(action_names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """The keys of each action, by its name; actions that nobody foresaw get the keys 1 to 9.

    Those that take several others at once have none: they come of their keys together.
    """
    digits = iter("123456789")
    found: dict[str, tuple[str, ...]] = {}
    for name in action_names:
        if AND in name:
            found[name] = ()
            continue
        taken = {key for keys in found.values() for key in keys}
        keys = tuple(key for key in ACTION_KEYS.get(name, ()) if key not in taken)
        found[name] = keys or tuple(digit for digit in (next(digits, None),) if digit)
    return found


class Controls:
    """The keys pressed and held, as actions at a limited rate.

    A press is one action; when it comes while an earlier one of the same action still waits for
    its turn, the two are one. A key that is held repeats. Several that are held are one action
    where there is one that takes them at once; else they take turns, which walks in curves. Of two
    opposite ones the later one counts.
    """

    def __init__(self, action_names: Sequence[str], fps: float) -> None:
        """Start with no key pressed.

        Args:
            action_names: of the environment.
            fps: the most actions a second.
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
        """A key goes down at the time `now` (seconds); returns whether it is one of an action."""
        action = self._actions.get(key)
        if action is None:
            return False
        if action not in self._waiting:
            self._waiting.append(action)
        # Whoever is on the way already need not wait to turn as well.
        self._held[key] = now if self._held else now + HOLD
        return True

    def release(self, key: str) -> None:
        """A key goes up; what it asked for and did not get yet still counts."""
        self._held.pop(key, None)

    def clear(self) -> None:
        """Forget all keys, also those that are still held."""
        self._waiting.clear()
        self._held.clear()

    def due(self, now: float) -> float | None:
        """Seconds until the next action; None if no key asks for one."""
        times = [self._ready] * bool(self._waiting) + list(self._held.values())
        return max(0.0, max(self._ready, min(times)) - now) if times else None

    def take(self, now: float) -> int | None:
        """The action to take now, if one is due."""
        if now < self._ready:
            return None
        action = self._waiting.pop(0) if self._waiting else self._repeated(now)
        if action is not None:
            # A step that is only a little late does not delay those after it.
            late = now - self._ready
            self._ready = now + self._interval - (late if late < self._interval else 0.0)
            self._turns = [*(turn for turn in self._turns if turn != action), action]
            action = self._joined(action)
        return action

    def _joined(self, action: int) -> int:
        """The action that takes this one and those of all other keys at once, if there is one."""
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
    """The actions without those of which a later one is the opposite."""
    return [one for i, one in enumerate(actions) if opposite.get(one) not in actions[i:]]
