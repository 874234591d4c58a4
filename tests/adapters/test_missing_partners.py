"""The errors for missing packages."""

from __future__ import annotations

import importlib
import sys

import pytest


@pytest.mark.parametrize(
    ("name", "partner", "needed"),
    [
        ("gymnasium", "gymnasium", "Gymnasium is not installed"),
        ("gymnax", "gymnax.environments", "needs gymnax"),
        ("stoa", "stoa", "needs stoa-env"),
        ("sb3", "stable_baselines3.common.vec_env", "Stable-Baselines3 is not installed"),
        ("torch", "torch", "PyTorch is not installed"),
    ],
)
def test_error_names_missing_package_and_extra(
    monkeypatch: pytest.MonkeyPatch, name: str, partner: str, needed: str
) -> None:
    monkeypatch.setitem(sys.modules, partner, None)
    monkeypatch.setitem(sys.modules, partner.split(".")[0], None)
    monkeypatch.delitem(sys.modules, f"jaxenstein.adapters.{name}", raising=False)
    with pytest.raises(ImportError, match=rf"{needed} .*pip install 'jaxenstein\[{name}\]'"):
        importlib.import_module(f"jaxenstein.adapters.{name}")
