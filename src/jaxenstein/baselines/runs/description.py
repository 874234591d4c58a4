"""Describes the computation of a trained network, for programs without this package."""

from __future__ import annotations

from typing import Any

import jax

from ...convolution import output_size
from ...params import split_ranges
from ..learner import Learner
from ..networks import MEAN, layers_for
from ..observations import Part

KINDS = {
    "convolution": (
        "relu(sum(kernel * window) + bias); windows of the image [height, width, channels] every "
        "`stride` pixels, without padding; kernel [rows, columns, channels, features]"
    ),
    "dense": "activation(x @ kernel + bias); x: the layers in `of`, flattened (last axis fastest) "
    "and concatenated in order",
    "gru": (
        "xr, xz, xn = three equal parts of x @ input_kernel + input_bias; "
        "hr, hz, hn = three equal parts of h @ recurrent_kernel; "
        "r = sigmoid(xr + hr); z = sigmoid(xz + hz); n = tanh(xn + r * (hn + candidate_bias)); "
        "the result is the next h = (1 - z) * n + z * h; h is zero at the start of an episode; "
        "x: the layers in `of`, concatenated in order"
    ),
    "persistence": "the first layer in `of`, plus weights * the second",
}
"""The kinds of layers, as formulas."""

_FORMULAS = {
    "bounds": "(x - {low:g}) / {size:g}",
    "log": "sign(x) * log(1 + abs(x))",
    "distance": "1 / (1 + max(x, 0))",
    "bits": "the eight bits of x as channels, lowest bit first",
}


def described(learner: Learner) -> dict[str, Any]:
    """The network of a learner as plain JSON values, layer by layer.

    Returns:
        A dictionary with

        - `actions`: the names of the actions, in the order of the logits;
        - `dtype`: dtype of the computation; the arrays in the file have the dtype `weights`;
        - `recurrent`: whether h is kept between the steps of an episode; if not, every step is
          computed like the first step of an episode;
        - `inputs`: a dictionary for each input with its `name`, its path in the `observation` (""
          for the whole observation), its `formula`, and its shape (`gives`);
        - `layers`: a dictionary for each layer, in the order of computation, with its `name`,
          `kind`, inputs (`of`: names of inputs and layers), output shape (`gives`), sizes, and
          `arrays`: the name of each array in the .npz file;
        - `kinds`: a formula for each kind of layer;
        - `policy` and `value`: the layers whose outputs are the logits and the values.
    """
    config = learner.config
    convolutions, images = _convolutions(learner)
    inputs = _inputs(learner)
    vectors = [one["name"] for one in inputs if one["name"].startswith("vector")]
    actions = learner.simulator.num_actions
    core = "['core']['params']"
    gru = {
        "input_kernel": f"{core}['Dense_0']['kernel']",
        "input_bias": f"{core}['Dense_0']['bias']",
        "recurrent_kernel": f"{core}['recurrent']",
        "candidate_bias": f"{core}['candidate_bias']",
    }
    layers = [
        *convolutions,
        _dense("features", [*images, *vectors], config.features, "encoder", 0, "relu"),
        _layer("memory", "gru", ["features", "previous_action"], [config.hidden], gru),
        _dense("actor", ["memory"], config.head, "heads", 0, "relu"),
        _dense("logits", ["actor"], actions, "heads", 1),
        _dense("critic", ["memory"], config.head, "heads", 2, "relu"),
        _dense("values", ["critic"], learner.network.values, "heads", 3),
    ]
    policy = "logits"
    if config.persistence:
        policy = "persistent_logits"
        weights = {"weights": "['persistence']"}
        layers.append(
            _layer(policy, "persistence", ["logits", "previous_action"], [actions], weights)
        )
    names = getattr(learner.env, "action_names", range(actions))
    return {
        "actions": [str(name) for name in names],
        "dtype": str(config.dtype),
        "recurrent": bool(config.recurrent),
        "inputs": inputs,
        "layers": layers,
        "kinds": {
            kind: KINDS[kind] for kind in KINDS if any(kind == one["kind"] for one in layers)
        },
        "policy": policy,
        "value": "values",
    }


def _inputs(learner: Learner) -> list[dict[str, Any]]:
    """The parts of an observation as network inputs, and the previous action."""
    params = split_ranges(learner.env_params)[0]
    shapes = jax.eval_shape(learner.env.reset, jax.random.key(0), params)[0]
    paths = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(shapes)]
    found, images, vectors = [], iter(range(len(paths))), iter(range(len(paths)))
    shapes = iter(learner.spec.images)
    for path, part in zip(paths, learner.spec.parts, strict=True):
        name = f"image{next(images)}" if part.image else f"vector{next(vectors)}"
        gives = next(shapes) if part.image else part.shape
        found.append(
            {
                "name": name,
                "observation": path,
                "shape": list(part.shape),
                "formula": _formula(part, learner.config.contrast),
                "gives": list(gives),
            }
        )
    actions = learner.simulator.num_actions
    formula = "one-hot vector of the last action; zeros at the start of an episode"
    return [*found, {"name": "previous_action", "formula": formula, "gives": [actions]}]


def _formula(part: Part, contrast: float) -> str:
    formula = _FORMULAS[part.scaling].format(low=part.low, size=part.high - part.low)
    if part.image and contrast and part.scaling != "bits":
        return f"{contrast:g} * ({formula} - {MEAN:g})"
    return formula


def _convolutions(learner: Learner) -> tuple[list[dict[str, Any]], list[str]]:
    """The convolutions of all images, and the name of the last one of each."""
    layers, last = [], []
    for index, shape in enumerate(learner.spec.images):
        name, (height, width, _) = f"image{index}", shape
        for number, (kernel, stride, features) in enumerate(
            layers_for(shape, learner.config.convolutions)
        ):
            height, width = (output_size(side, kernel, stride) for side in (height, width))
            before, name = name, f"image{index}_convolution{number}"
            arrays = {
                part: f"['encoder']['params']['{name}_{part}']" for part in ("kernel", "bias")
            }
            layer = _layer(name, "convolution", [before], [height, width, features], arrays)
            layers.append(layer | {"window": [kernel, kernel], "stride": stride})
        last.append(name)
    return layers, last


def _dense(
    name: str, of: list[str], size: int, module: str, number: int, activation: str = "none"
) -> dict[str, Any]:
    where = f"['{module}']['params']['Dense_{number}']"
    arrays = {part: f"{where}['{part}']" for part in ("kernel", "bias")}
    return _layer(name, "dense", of, [size], arrays) | {"activation": activation}


def _layer(
    name: str, kind: str, of: list[str], gives: list[int], arrays: dict[str, str]
) -> dict[str, Any]:
    return {"name": name, "kind": kind, "of": of, "gives": gives, "arrays": arrays}
