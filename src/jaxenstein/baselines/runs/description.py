"""What a trained network computes, in words and numbers that do without this package."""

from __future__ import annotations

from typing import Any

import jax

from ...convolution import output_size
from ..learner import Learner
from ..networks import MEAN, layers_for
from ..observations import Part

KINDS = {
    "convolution": (
        "relu of the sum of kernel * window, plus bias; windows of the image [height, width, "
        "channels] every `stride` pixels, none beyond the rim; kernel [rows, columns, channels, "
        "features]"
    ),
    "dense": "activation(x @ kernel + bias); x: what it is of, flattened (the last axis runs "
    "fastest) and joined in order",
    "gru": (
        "xr, xz, xn = three equal parts of x @ input_kernel + input_bias; "
        "hr, hz, hn = three equal parts of h @ recurrent_kernel; "
        "r = sigmoid(xr + hr); z = sigmoid(xz + hz); n = tanh(xn + r * (hn + candidate_bias)); "
        "the result and the next h = (1 - z) * n + z * h; h is zeros at the start of an episode"
    ),
    "persistence": "what it is of first, plus weights * what it is of second",
}
"""The kinds of layers, as formulas."""

_FORMULAS = {
    "bounds": "(x - {low:g}) / {size:g}",
    "log": "sign(x) * log(1 + abs(x))",
    "distance": "1 / (1 + max(x, 0))",
    "bits": "the eight bits of x as channels, the lowest first",
}


def described(learner: Learner) -> dict[str, Any]:
    """The network of a learner as plain JSON values, layer by layer.

    Returns:
        A dictionary of

        - `actions`: the names of the actions, in the order of the logits;
        - `dtype`: of the computation; arrays are of the file's `weights`;
        - `recurrent`: whether h is kept between the steps of an episode; if not, every step is
          computed as the first one of an episode;
        - `inputs`: dictionaries with `name`, the `observation` that it is made of (its place in
          a tree, "" for the whole observation), the `formula` and the shape that it `gives`;
        - `layers`, in the order of the computation: dictionaries with `name`, `kind`, `of` (names
          of inputs and layers), the shape that it `gives`, its numbers, and `arrays`: what each
          array is, and its name in the .npz file;
        - `kinds`: a formula for each kind of layer;
        - `policy` and `value`: the layers whose results are the logits and the values.
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
    """The parts of an observation as the network takes them, and the action before."""
    shapes = jax.eval_shape(learner.env.reset, jax.random.key(0), learner.env_params)[0]
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
    formula = "1 at the number of the last action, else 0; zeros at the start of an episode"
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
