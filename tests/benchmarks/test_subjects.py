"""The subjects: each kind makes the steps that it says."""

import importlib
import re

import jax
import jax.numpy as jnp
import pytest

from benchmarks.subjects import __main__ as serve
from benchmarks.subjects import adapters, own, waits
from benchmarks.subjects.common import frame_skip, image_size, middle, random_actions
from benchmarks.suites.parts import PARTS
from benchmarks.suites.plan import Plan


@pytest.fixture
def short(monkeypatch):
    """Calls of a few steps."""
    for module in (own, adapters):
        monkeypatch.setattr(module, "STEPS_A_CALL", 4)
    monkeypatch.setattr(waits, "STEPS_A_CALL", 32)
    monkeypatch.setattr(own, "FRAMES_KEPT", 4)


@pytest.mark.parametrize("kind", ["scan", "frames", "keep", "rules", "fill", "stage", "reset"])
def test_own_subjects(short, kind):
    chunk, _ = serve.prepare(f"{kind}-2 id=simple size=8x6 stage=rules observation=rgb")
    assert chunk() == 4
    assert chunk() == 4


def test_options_choose_the_environment():
    env, _ = own.own_environment({"id": "key-door", "size": "10x6", "observation": "depth"})
    assert (env.width, env.height, env.observation) == (10, 6, "depth")
    env, params = own.own_environment({"sprites": "3"})
    assert env.map_size == (32, 32)
    assert float(params.goal_radius) < 0


@pytest.mark.slow
def test_training():
    pytest.importorskip("optax")
    chunk, notes = serve.prepare("training-2 rollout=4 size=36")
    assert chunk() == 8
    assert int(notes["parameters"].replace(",", "")) > 1000


def test_operations_of_loops_and_calls():
    def program(a, b):
        def body(carry, _):
            return jax.nn.relu(carry @ b), None

        return jax.lax.scan(body, jax.jit(jnp.matmul)(a, b), length=5)[0]

    shapes = jnp.ones((3, 4), jnp.float32), jnp.ones((4, 4), jnp.float32)
    ((of, times),) = waits._products(jax.make_jaxpr(program)(*shapes).jaxpr).items()
    assert times == 6
    assert waits._size(*of) == 2 * 3 * 4 * 4


def test_a_fresh_interpreter_is_a_step(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(waits.UNTIL, "jax", "open('there', 'a').write('.')")
    chunk, _ = serve.prepare("start until=jax")
    assert chunk() == chunk() == 1
    assert (tmp_path / "there").read_text() == ".."


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["loop", "adapter-loop-2", "adapter-gymnasium-same-step-2",
                                  "adapter-gymnasium-single", "adapter-gymnax-2"])  # fmt: skip
def test_calls_from_python_and_adapters(short, kind):
    partner = re.search("gymnasium|gymnax", kind)
    if partner:
        pytest.importorskip(partner[0])
    chunk, _ = serve.prepare(f"{kind} id=simple")
    assert chunk() > 0


def test_each_subject_of_the_suite_has_a_builder():
    names = {row.name for part in PARTS.values() for group in part(Plan()) for row in group}
    kinds = {re.sub(r"-\d+$", "", name.split()[0]) for name in names}
    assert len(kinds) > 15
    for kind in kinds:
        module = serve.MODULES.get(kind.partition("-")[0], "own")
        assert kind in importlib.import_module(f"benchmarks.subjects.{module}").SUBJECTS


def test_words_of_a_name():
    assert image_size({}) == (64, 64)
    assert image_size({"size": "320x240"}) == (320, 240)
    assert (frame_skip({}), frame_skip({"frame_skip": "4"})) == (1, 4)
    actions = random_actions(3)
    assert {next(actions) for _ in range(100)} == {0, 1, 2}
    assert next(random_actions(3, 5)).shape == (5,)
    frame = next(random_actions(200, 7, 9, 3))
    assert middle(frame) == frame[3, 4, 0]
