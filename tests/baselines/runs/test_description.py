"""The network of an exported file, computed with NumPy from its description."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines.runs.trained import Trained, write_trained
from tests.baselines.tiny import tiny

KEY = jax.random.key(0)


def relu(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0)


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x))


def convolution(layer: Any, arrays: Any, image: np.ndarray) -> np.ndarray:
    """The formula of `kinds`, a window at a time."""
    rows, columns, features = layer["gives"]
    (height, width), stride = layer["window"], layer["stride"]
    out = np.zeros((rows, columns, features))
    for row, column in np.ndindex(rows, columns):
        top, left = row * stride, column * stride
        window = image[top : top + height, left : left + width]
        out[row, column] = np.einsum("ijc,ijcf->f", window, arrays["kernel"])
    return relu(out + arrays["bias"])


def gru(arrays: Any, x: np.ndarray, h: np.ndarray) -> np.ndarray:
    xr, xz, xn = np.split(x @ arrays["input_kernel"] + arrays["input_bias"], 3)
    hr, hz, hn = np.split(h @ arrays["recurrent_kernel"], 3)
    z = sigmoid(xz + hz)
    n = np.tanh(xn + sigmoid(xr + hr) * (hn + arrays["candidate_bias"]))
    return (1 - z) * n + z * h


def step(told: Any, file: Any, given: dict[str, np.ndarray], h: np.ndarray) -> dict[str, Any]:
    """The results of all layers by name."""
    found = dict(given)
    for layer in told["layers"]:
        arrays = {part: file[name].astype(np.float64) for part, name in layer["arrays"].items()}
        parts = [found[name] for name in layer["of"]]
        joined = np.concatenate([part.ravel() for part in parts])
        if layer["kind"] == "convolution":
            result = convolution(layer, arrays, parts[0])
        elif layer["kind"] == "gru":
            result = gru(arrays, joined, h)
        elif layer["kind"] == "persistence":
            result = parts[0] + arrays["weights"] * parts[1]
        else:
            result = joined @ arrays["kernel"] + arrays["bias"]
            result = relu(result) if layer["activation"] == "relu" else result
        assert list(result.shape) == layer["gives"]
        found[layer["name"]] = result
    return found


def scaled(told: Any, leaves: list[np.ndarray]) -> dict[str, np.ndarray]:
    """Inputs of observations, by their formulas."""
    functions = {"sign": np.sign, "log": np.log, "abs": np.abs, "max": np.maximum}
    inputs = {}
    for one, leaf in zip(told["inputs"][:-1], leaves, strict=True):
        assert list(leaf.shape) == one["shape"]
        if one["formula"].startswith("the eight bits"):
            value = leaf[..., None] >> np.arange(8) & 1
        else:
            value = np.asarray(eval(one["formula"], functions, {"x": leaf.astype(np.float64)}))
        inputs[one["name"]] = value.reshape(one["gives"])
    return inputs


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"observation": "dict", "contrast": 3.0, "persistence": 1.5},
        pytest.param(
            {"observation": "labels", "recurrent": False, "convolutions": [[4, 2, 3], [3, 1, 2]]},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["rgb", "dict", "labels"],
)
def test_file_alone_describes_the_network(tmp_path: Path, options: Any) -> None:
    experiment = tiny(seeds=1, **options)
    learner, path = experiment.learner, tmp_path / "agent.npz"
    params, compute = learner.network.init(KEY), jax.jit(learner.network.step)
    noise = np.random.default_rng(0)
    params = jax.tree.map(
        lambda leaf: np.float32(leaf + 0.1 * noise.normal(size=leaf.shape)), params
    )
    one = jax.tree.map(lambda leaf: leaf[None], params)
    write_trained(path, Trained("x", experiment, one, 0), "float32", {})
    with np.load(path) as file:
        told = json.loads(file["config.json"])["agent"]["network"]
        named = [name for layer in told["layers"] for name in layer["arrays"].values()]
        assert sorted([*named, "config.json"]) == sorted(file.files)
        assert told["actions"][:2] == ["turn left", "turn right"]
        assert {layer["kind"] for layer in told["layers"]} == set(told["kinds"])
        shapes, _ = jax.eval_shape(learner.env.reset, KEY, learner.env_params)
        h, previous = np.zeros(8), None
        carry = learner.initial_carry()
        memory, last, first = (leaf[None] for leaf in (carry.memory, carry.previous, carry.first))
        for _ in range(3):
            obs = jax.tree.map(
                lambda leaf: noise.integers(0, 2 + 200 * (len(leaf.shape) > 1), leaf.shape).astype(
                    leaf.dtype
                ),
                shapes,
            )
            inputs = scaled(told, jax.tree.leaves(obs))
            if not told["recurrent"]:
                h, previous = np.zeros(8), None
            inputs["previous_action"] = np.arange(len(told["actions"])) == previous
            found = step(told, file, inputs, h)
            batch = jax.tree.map(lambda leaf: leaf[None], obs)
            logits, values, memory = compute(params, batch, last, first, memory)
            np.testing.assert_allclose(found[told["policy"]], logits[0], rtol=1e-3, atol=1e-4)
            np.testing.assert_allclose(found[told["value"]], values[0], rtol=1e-3, atol=1e-4)
            np.testing.assert_allclose(found["memory"], memory[0], rtol=1e-3, atol=1e-4)
            h, previous = found["memory"], int(np.argmax(found[told["policy"]]))
            last, first = jnp.full(1, previous, jnp.int32), jnp.zeros(1, bool)
