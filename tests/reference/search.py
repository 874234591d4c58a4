"""Search settings for comparisons over seeds of whole worlds, which need no shrinking."""

from __future__ import annotations

from hypothesis import Phase, settings
from hypothesis import strategies as st

SEEDS = st.integers(0, 2**32 - 1)


def search_settings(examples: int) -> settings:
    """Settings for a search over `examples` seeds."""
    phases = (Phase.explicit, Phase.reuse, Phase.generate)
    return settings(deadline=None, max_examples=examples, phases=phases)
