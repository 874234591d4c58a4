"""Record an episode with everything that pictures and replays need, and replay it."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..about import Event
from ..environment import AnyEnvironment
from ..errors import SettingError, TrajectoryError, quoted
from ..fields import check_seed, check_whole
from ..maps.tilemap import TileMap
from ..spec import Spec, spec_of
from ..tasks.first_person import FirstPerson
from ..tasks.levels import closed_doors
from ..trajectory import Trajectory
from ..view.episode import Episode
from ..view.frames import image_of, picture
from ..view.topdown import JUMP
from .digests import Digests, make_trajectory
from .policies import Policy, Script, named_policy
from .session import NO_OP, Session, whole_action

COMPARED = ("rewards", "states", "observations")
# Billboards closer to the eye than this, in tiles, are in the hand, and not on the map.
IN_HAND = 0.08


def record(
    env: AnyEnvironment,
    params: Any = None,
    policy: str | Sequence[int] | Policy = "forward",
    *,
    seed: int = 0,
    steps: int | None = None,
) -> Episode:
    r"""Record an episode: a notebook shows it, `save` writes it to a file.

    Args:
        env: a first-person environment; its `autoreset` does not matter.
        params: its params; None for the default params.
        policy: the name of a scripted player, such as "forward", "random" or "expert"; a list of
            actions; or any function of a `Session` that returns an action, such as
            `lambda session: agent(session.observation)`.
        seed: the seed of the episode and of the named policies, 0 to 2**32 - 1.
        steps: the maximum number of steps; None for the whole episode or list of actions.

    Raises:
        SettingError: the environment is not first-person; the policy does not exist or cannot
            play this task; an action, `seed` or `steps` is not a whole number in range; or the
            params have a batch axis.

    Examples:
        >>> import jaxenstein
        >>> corridor = "#####\n#S G#\n#####"
        >>> env, params = jaxenstein.from_ascii(corridor, heading=0, height=8, width=8)
        >>> episode = record(env, params, "expert", seed=1)
        >>> episode.ending, float(episode.returns[-1])
        ('terminated', 1.0)
    """
    if not isinstance(env, FirstPerson):
        raise SettingError(f"only first-person environments can be recorded, not {quoted(env)}")
    params = env.single_params(params)
    seed = check_seed(seed)
    chosen, length = _policy(policy, env, params, seed)
    limit = int(env.most_steps(params)) if length is None else length
    if steps is not None:
        check_whole("steps", steps, 1)
        limit = min(int(steps), limit)
    try:
        spec = spec_of(env, params)
    except TrajectoryError:
        spec = None
    return play(Session(env, params, seed), chosen, limit, spec)


def _policy(
    policy: str | Sequence[int] | Policy, env: AnyEnvironment, params: Any, seed: int
) -> tuple[Policy, int | None]:
    """The policy, and its number of actions if that is known."""
    if isinstance(policy, str):
        return named_policy(policy, env, params, seed), None
    if callable(policy):
        return policy, None
    if not isinstance(policy, Iterable):
        raise SettingError(
            f"policy must be a name, a function or a sequence of actions, not {quoted(policy)}"
        )
    actions = [whole_action(action) for action in policy]
    for index, action in enumerate(actions):
        if not NO_OP <= action < env.num_actions:
            raise SettingError(
                f"action {index} (from 0) is {action}, but {quoted(env.name)} has the actions 0 to "
                f"{env.num_actions - 1}, and {NO_OP} for none"
            )
    return Script(actions), len(actions)


def play(
    session: Session,
    policy: Policy,
    steps: int,
    spec: Spec | None = None,
    *,
    beyond: bool = False,
    notify: Callable[[int], object] | None = None,
) -> Episode:
    """Play one episode to its end, or the first `steps` steps of it.

    Args:
        session: a session right after a reset.
        policy: chooses the actions.
        steps: the maximum number of steps.
        spec: the spec of the environment, for the trajectory; None for no trajectory.
        beyond: whether to continue after the end of the episode until all steps are taken.
        notify: called with the number of steps taken.
    """
    builder, digests = EpisodeBuilder(), Digests()
    snapshot = snapshots(session.env, session.params)
    env: Any = session.env
    tilemap = env.tilemap_of(session.state)

    def add_frame() -> None:
        builder.add_frame(image_of(session.observation), snapshot(session.state))
        if spec is not None:
            digests.add(session)

    add_frame()
    while len(session.actions) < steps and (beyond or not session.over):
        session.step(policy(session))
        add_frame()
        builder.add_step(session)
        if session.actions[-1] == NO_OP and (words := getattr(policy, "waits", "")):
            builder.events[-1] = ", ".join(filter(None, [builder.events[-1], words]))
        if notify is not None:
            notify(len(session.actions))
    trajectory = None if spec is None else make_trajectory(session, digests, spec)
    return dataclasses.replace(
        builder.build(env, session.params, tilemap),
        ending="terminated" if session.terminated else "truncated" * session.truncated,
        trajectory=trajectory,
    )


def longest_step(env: FirstPerson[Any, Any], params: Any) -> float:
    """How many tiles a step can move the agent; a longer move on the map is a new start."""
    # With some tolerance for rounding.
    return max(JUMP, 1.001 * env.frame_skip * env.stride(params))


def snapshots(env: Any, params: Any) -> Callable[[Any], dict[str, Any]]:
    """A function from a state to what the map and the caption show, on the host.

    Its keys are the `Episode` attributes that it fills, per frame, and `"variables"`. `"closed"`
    follows the order of `"doors"`, int32[D, 2], the tiles of the level's doors
    (`levels.closed_doors`).
    """
    env = dataclasses.replace(env, autoreset=None, final_observation=False)
    return lambda state: jax.device_get(_snapshot(env, state, params))


@functools.partial(jax.jit, static_argnums=0)
def _snapshot(env: Any, state: Any, params: Any) -> dict[str, Any]:
    scene = env.scene(state, params)
    described = env.describe(state, params)
    apart = jnp.abs(scene.sprites.position - state.position[None]) > IN_HAND
    return {
        "positions": state.position,
        "headings": state.heading,
        "closed": scene.closed,
        "doors": scene.level.doors - scene.level.margin,
        "sprites": scene.sprites.position,
        "labels": jnp.asarray(scene.theme.sprite_labels)[scene.sprites.picture],
        "visible": scene.sprites.visible & jnp.any(apart, axis=-1),
        "variables": {name: described[name] for name in env.about().captions},
    }


@dataclasses.dataclass
class EpisodeBuilder:
    """Collects an episode step by step."""

    frames: list[np.ndarray] = dataclasses.field(default_factory=list)
    snapshots: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    rewards: list[float] = dataclasses.field(default_factory=list)
    events: list[str] = dataclasses.field(default_factory=list)

    def add_frame(self, image: Any, snapshot: dict[str, Any]) -> None:
        """Add an image and the snapshot of its state."""
        self.frames.append(np.asarray(image))
        self.snapshots.append(snapshot)

    def add_step(self, session: Session) -> None:
        """Add the outcome of a session's last step."""
        self.rewards.append(session.rewards[-1])
        self.events.append(event_text(session))

    def build(self, env: FirstPerson[Any, Any], params: Any, tilemap: TileMap | None) -> Episode:
        """The finished episode."""

        def over_time(name: str, dtype: type) -> np.ndarray:
            return np.stack([np.asarray(shot[name]) for shot in self.snapshots]).astype(dtype)

        names, closed = self.snapshots[0]["variables"], over_time("closed", bool)
        if tilemap is not None:
            closed = closed_doors(tilemap, self.snapshots[0]["doors"], closed)
        return Episode(
            frames=picture(np.stack(self.frames), env.observation),
            positions=over_time("positions", np.float32),
            headings=over_time("headings", np.float32),
            rewards=np.array(self.rewards, np.float32),
            closed=closed,
            sprites=over_time("sprites", np.float32),
            labels=over_time("labels", np.int32),
            visible=over_time("visible", bool),
            events=tuple(self.events),
            tilemap=tilemap,
            variables={
                name: np.array([float(shot["variables"][name]) for shot in self.snapshots])
                for name in names
            },
            name=env.name,
            field_of_view=float(env.field_of_view),
            longest_step=longest_step(env, params),
        )


def event_text(session: Session) -> str:
    """The events of the last step in words, or else the instruction of the task; may be ""."""
    late = session.truncated and not session.terminated
    words = event_words(session.env.about().events, session.info) + ["time is up"] * late
    return ", ".join(words) or session.env.instruction(session.state)


def event_words(events: Mapping[str, Event], info: Mapping[str, Any]) -> list[str]:
    """Describe each event of a step in words.

    Args:
        events: the events of the environment, from its `about()`.
        info: the info of the step.
    """
    counts = {name: int(info.get(name, 0)) for name in events}
    return [events[name].in_words(count) for name, count in counts.items() if count]


@dataclasses.dataclass(frozen=True)
class Replay:
    """The replay of a trajectory.

    Attributes:
        episode: the replayed episode, with a trajectory of its own.
        original: the trajectory that was replayed.
        differences: descriptions of all differences, with their first steps; () if rewards,
            states and observations are bit-identical.
    """

    episode: Episode
    original: Trajectory
    differences: tuple[str, ...]

    @property
    def identical(self) -> bool:
        """Whether all rewards, states and observations are bit-identical."""
        return not self.differences

    def report(self) -> str:
        """Report whether the replay is identical, and if not, where and what differs."""
        if self.identical:
            return f"{self.episode.summary()}, the same bit for bit"
        assert self.episode.trajectory is not None
        now = self.episode.trajectory
        lines = [f"{self.episode.summary()}, NOT the same", *(f"  {d}" for d in self.differences)]
        differing = {difference.partition(" ")[0] for difference in self.differences}
        same = [name for name in COMPARED if name not in differing]
        lines += [f"  {' and '.join(same)} are the same bit for bit"] * bool(same)
        versions = self.original.environment.version, now.environment.version
        if versions[0] != versions[1]:
            lines.append(f"  the environment had version {versions[0]}, now {versions[1]}")
        lines.append(f"  made by  {described(self.original.made_by)}")
        lines.append(f"  running  {described(now.made_by)}")
        return "\n".join(lines)


def described(made_by: Mapping[str, str]) -> str:
    """Versions and hardware in one line."""
    return ", ".join(f"{name} {value}" for name, value in made_by.items())


def replay(trajectory: Trajectory, *, notify: Callable[[int], object] | None = None) -> Replay:
    """Replay a trajectory.

    Args:
        trajectory: a trajectory from `load_trajectory` or `Episode.trajectory`.
        notify: called with the number of steps taken.

    Raises:
        JAXensteinError: the environment can no longer be built.
    """
    spec = trajectory.environment
    env, params = spec.build()
    if not isinstance(env, FirstPerson):
        raise SettingError(f"only first-person environments can be replayed, not {quoted(env)}")
    spec = dataclasses.replace(spec, version=env.version)
    session = Session(env, params, trajectory.seed)
    actions = Script(trajectory.actions)
    count = len(trajectory.actions)
    episode = play(session, actions, count, spec, notify=notify, beyond=True)
    assert episode.trajectory is not None
    differences = trajectory.checks.differences(episode.trajectory.checks)
    return Replay(episode, trajectory, differences)
