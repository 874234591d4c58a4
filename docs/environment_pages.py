"""The pages of the environments, generated from the catalogue in every build of the site.

    python -m docs.environment_pages     # writes docs/environments/*.md

Numbers come from the environments, differences from the originals from docs/originals, changes from
CHANGELOG.md, returns and trained agents from docs/returns.json and docs/agents.json (`python -m
docs.measured`), and pictures and animations from `python -m docs.pictures`.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import jaxenstein
from docs.other_pages import scoreboard
from docs.page_parts import (
    FAMILIES,
    HERE,
    PIXELS,
    Family,
    fidelity,
    history,
    info_table,
    link_to,
    returns,
    table,
)
from jaxenstein.baselines.runs.trained import pretrained, read_config
from jaxenstein.catalogue import ALIASES, ENTRIES, MAIN_IDS
from jaxenstein.cli.listing import GENERATED, extent
from jaxenstein.fields import Option, options_of
from jaxenstein.level_counts import level_counts
from jaxenstein.tasks.first_person import SETTINGS

OUT = HERE / "environments"
EPISODES, LOOKS = HERE / "_static" / "episodes", HERE / "images" / "looks"


def write_pages(folder: Path = OUT) -> list[Path]:
    """Write the overview and a page for each family; unchanged files are not touched."""
    folder.mkdir(exist_ok=True)
    pages = {family.name: page(family) for family in FAMILIES}
    pages |= {"index": overview(), "scoreboard": scoreboard()}
    for old in folder.glob("*.md"):
        if old.stem not in pages:
            old.unlink()
    paths = [folder / f"{name}.md" for name in pages]
    for path, text in zip(paths, pages.values(), strict=True):
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
    return paths


def overview() -> str:
    """The overview of all environments, as animated cards and as a table."""
    cards = "\n".join(_card(name) for name in MAIN_IDS)
    head = ("id", "map", "reward", "horizon", "discount")
    rows = table(head, [_overview_row(name) for name in ENTRIES], right=(3, 4))
    aliases = ", ".join(f"`{alias}` is `{name}`" for alias, name in ALIASES.items())
    pages = "\n".join(family.name for family in FAMILIES)
    return f"""# Environments

Each card links to the rules and shows the start of an episode of the scripted expert. An agent sees
only the picture on the left.

<div class="gallery">
{cards}
</div>

{rows}

Maps are columns x rows in tiles; {GENERATED} marks maps that every reset generates. Other names:
{aliases}.

```{{toctree}}
:hidden:

{pages}
```
"""


def page(family: Family) -> str:
    """The page of a family: common parts, and a section for each id."""
    env, params = built(family.ids[0])
    named = ", ".join(f"{i} {name}" for i, name in enumerate(env.action_names))
    sections = "\n".join(section(name) for name in family.ids)
    return f"""# {family.title}

{family.text.strip()}

Actions: {named}. Any other number does nothing for a step.

{sections}
{variants(family)}{looks(family)}## Info

{info_table(env, params)}

## Params

`params.replace(...)` changes these numbers. Under `jax.vmap`, each can be an array.

{params_table(family)}

{own_settings(family.ids[0])}
{fidelity(family)}
{history(family)}"""


def variants(family: Family) -> str:
    """A table of variants, which the page does not describe one by one, and their agents."""
    if not family.variants:
        return ""
    rows = [
        (
            f"`{name}`",
            ENTRIES[name].summary,
            extent(env),
            level_counts()[name].words if name in level_counts() else "",
            f"{int(params.max_steps_in_episode)}",
        )
        for name, (env, params) in ((name, built(name)) for name in family.variants)
    ]
    listed = table(("id", "", "map", "levels", "horizon"), rows, right=(3, 4))
    agents = [(name, agent_in_vizdoom(name)) for name in family.variants]
    shown = "".join(f"### `{name}`\n{text}\n" for name, text in agents if text)
    return f"## Variants\n\n{listed}\n\n{shown}"


def looks(family: Family) -> str:
    """The looks of the first environment, if there is a picture of them."""
    name = family.ids[0]
    if not (LOOKS / f"{name}.png").is_file():
        return ""
    return f"""## Looks

`{name}` with `look="plain"`, `"patterned"` and, twice, `"random"`
([concepts](../concepts.md#looks)):

```{{image}} ../images/looks/{name}.png
:alt: A view of {name} in plain colours, with patterns, and with random colours and patterns
:class: recorded
```

"""


def section(name: str) -> str:
    """The section of one environment."""
    picture = f"../images/environments/{name}"
    summary = ENTRIES[name].summary
    return f"""## `{name}`

{summary[:1].upper()}{summary[1:]}.

{moving(name)}

{table(("", ""), facts(name))}

Six views beside the map, and the map at the start of an episode:

```{{image}} {picture}.png
:alt: The map of {name} and six views of it
:class: recorded
```

```{{image}} {picture}-map.png
:alt: The map of {name} from above at the start of an episode
:class: recorded
```

{returns(name)}
{agent(name)}{agent_in_vizdoom(name)}"""


def agent(name: str) -> str:
    """The pretrained agent with this name; "" if there is none."""
    if name not in pretrained():
        return ""
    plain = read_config(pretrained()[name])
    score, settings = plain["agent"]["score"]["sampled"], plain["environment"]["settings"]
    decisions = plain["agent"]["update"] * plain["config"]["num_envs"] * plain["config"]["rollout"]
    sees = f"{settings['width']}x{settings['height']} {settings.get('observation', 'rgb')}"
    return f"""
A trained agent and its view: {plain["config"]["algo"].upper()} on {sees} with frame skip
{settings.get("frame_skip", 1)}, {decisions:,} decisions, success in
{score["success"]["mean"]:.0%} of {score["episodes"]} episodes.
`jaxenstein play --policy pretrained/{name}` plays it. The [scoreboard](scoreboard.md) lists all
agents of its training.

{moving(f"{name}-agent")}
"""


def agent_in_vizdoom(name: str) -> str:
    """The pretrained agent of this scenario that sees pixels, in both; "" if there is none."""
    if name + PIXELS not in pretrained():
        return ""
    shown = moving(f"{name}-both", f"The same agent in {name} and in ViZDoom, side by side", 2)
    return f"""
An agent that sees pixels, here on the left and in ViZDoom on the right
([how it was trained](../doom-pixels.md)). `jaxenstein play --policy pretrained/{name}{PIXELS}`
plays it.

{shown}
"""


def facts(name: str) -> list[tuple[str, str]]:
    """The facts about an environment, as pairs."""
    env, params = built(name)
    seen = env.observation_space(params)
    aliases = [f"`{alias}`" for alias, target in ALIASES.items() if target == name]
    return [
        ("map", extent(env).replace(GENERATED, ", generated at every reset")),
        *([("levels", level_counts()[name].words)] if name in level_counts() else []),
        ("observation", f"{seen.dtype}[{', '.join(map(str, seen.shape))}] by default"),
        ("actions", str(env.num_actions)),
        ("reward", rewards(name)),
        ("ends", ending(name)),
        ("horizon", f"{int(params.max_steps_in_episode)} steps"),
        ("discount", f"{float(params.discount):g}"),
        ("version", str(ENTRIES[name].version)),
        *([("other name", ", ".join(aliases))] if aliases else []),
    ]


def rewards(name: str) -> str:
    """The rewards of an environment."""
    env, params = built(name)
    words = env.about().rewards
    paid = {field: float(getattr(params, field)) for field in words}
    return ", ".join(words[field].format(value) for field, value in paid.items() if value)


def ending(name: str) -> str:
    """When an episode terminates and when it is truncated."""
    ends = built(name)[0].about().ends
    return f"terminated {ends}, truncated at the time limit" if ends else "only at the time limit"


def params_table(family: Family) -> str:
    """A table of the params of a family."""
    values = [built(name)[1] for name in family.ids]
    # Environments of a family may have different params.
    options: dict[str, Option] = {}
    for params in values:
        options = {option.name: option for option in options_of(type(params), "")} | options
    rows = []
    for name, option in options.items():
        numbers = [getattr(params, name) for params in values if hasattr(params, name)]
        shown = {f"{np.asarray(value).item():.6g}": None for value in numbers}
        rows.append((f"`{name}`", ", ".join(shown), option.domain.words, option.help))
    return table(("param", "default", "values", "meaning"), rows)


def own_settings(name: str) -> str:
    """The settings that only these environments have."""
    own = [setting for setting in ENTRIES[name].settings if setting not in SETTINGS]
    if not own:
        return ""
    env, _ = built(name)
    rows = [
        (f"`{option.name}`", f"`{getattr(env, option.name)!r}`", option.domain.words, option.help)
        for option in options_of(type(env), "", own)
    ]
    listed = table(("setting", "default", "values", "meaning"), rows)
    common = "[common settings](../concepts.md#settings-and-params)"
    return f"## Settings\n\nBesides the {common}:\n\n{listed}\n"


def moving(name: str, told: str = "", scale: int = 1) -> str:
    """An animated episode, or a still for readers who prefer reduced motion.

    Args:
        name: the name of its files.
        told: what it shows; "" for an episode beside the map.
        scale: factor by which it is enlarged.
    """
    told = told or f"An episode of {name}: the agent's view beside the map"
    place = f"../_static/episodes/{name}"
    with Image.open(EPISODES / f"{name}.webp") as picture:
        width, height = (scale * length for length in picture.size)
    return (
        f'<picture><source srcset="{place}-still.webp" media="(prefers-reduced-motion: reduce)">'
        f'<img class="recorded" src="{place}.webp" width="{width}" height="{height}" '
        f'loading="lazy" alt="{told}"></picture>'
    )


def _card(name: str) -> str:
    return (
        f'<a class="card" href="{ENTRIES[name].family}.html#{name}">{moving(name)}'
        f'<span class="name">{name}</span><span>{ENTRIES[name].summary}</span></a>'
    )


def _overview_row(name: str) -> tuple[str, ...]:
    env, params = built(name)
    horizon, discount = int(params.max_steps_in_episode), float(params.discount)
    return link_to(name), extent(env), rewards(name), str(horizon), f"{discount:g}"


@functools.cache
def built(name: str) -> tuple[Any, Any]:
    """The environment and its default params."""
    return jaxenstein.make(name)


if __name__ == "__main__":
    for written in write_pages():
        print(written)
