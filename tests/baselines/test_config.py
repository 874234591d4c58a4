import jax
import jax.numpy as jnp
import pytest

pytest.importorskip("flax")

from jaxenstein.baselines import Config, HParams, ICMSettings, RNDSettings
from jaxenstein.errors import SettingError


def test_defaults_are_the_papers():
    config, numbers = Config(), HParams()
    assert (config.rollout, config.epochs) == (128, 4)
    assert (config.hidden, config.features) == (256, 256)
    rnd, icm = RNDSettings(), ICMSettings()
    assert (rnd.rnd_hidden, rnd.rnd_output, rnd.rnd_layers) == (128, 128, 2)
    assert (icm.icm_latent, icm.icm_hidden, config.bonus_epochs) == (128, 256, 1)
    assert (numbers.learning_rate, numbers.gae_lambda, numbers.entropy) == (2.5e-4, 0.95, 0.01)
    assert (numbers.value, numbers.gradient_norm, numbers.gamma) == (0.5, 0.5, None)


def test_configs_are_hashable_and_count_updates():
    config = Config(num_envs=4, rollout=10, total_steps=99)
    assert config == Config(num_envs=4, rollout=10, total_steps=99)
    assert len({config, config.replace(num_envs=8)}) == 2
    assert config.updates == 2


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"algo": "pppo"},
            "one of 'ppo', 'rnd', 'icm', 'e3b', not 'pppo', did you mean",
        ),
        ({"num_envs": 6}, "num_envs must be a multiple of minibatches = 4"),
        ({"num_envs": 8, "shards": 4}, "times shards = 4"),
        ({"num_envs": 0}, "num_envs must be a whole number from 1, not 0"),
        ({"rollout": 2.0}, "rollout must be a whole number"),
        ({"rollout": True}, "rollout must be a whole number"),
        ({"total_steps": 100}, "at least num_envs \\* rollout = 8192"),
        ({"anneal": 1}, "anneal must be True or False, not 1"),
        ({"dtype": "float16"}, "dtype must be one of 'float32', 'bfloat16'"),
        ({"contrast": float("inf")}, "contrast must be a finite number at least 0, not inf"),
        ({"persistence": -1}, "persistence must be a finite number at least 0, not -1"),
        ({"persistence": "much"}, "persistence must be a finite number at least 0, not 'much'"),
        ({"persistence": float("nan")}, "persistence must be a finite number at least 0, not nan"),
        ({"persistence": True}, "persistence must be a finite number at least 0, not True"),
        ({"stop_success": 1.5}, "stop_success must be a finite number from 0 to 1, not 1.5"),
        ({"convolutions": ((8, 4),)}, "\\(kernel, stride, features\\)"),
    ],
)
def test_a_wrong_setting_is_named(settings, message):
    with pytest.raises(SettingError, match=message):
        Config(**settings)


def test_replace_names_the_nearest_setting():
    with pytest.raises(SettingError, match="unknown setting 'num_env', did you mean 'num_envs'"):
        Config().replace(num_env=3)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"learning_rate": -1}, "learning_rate must be a finite number at least 0, not -1"),
        ({"gamma": 1.5}, "gamma must be a finite number from 0 to 1"),
        ({"clip": 0}, "clip must be a finite number above 0"),
        ({"entropy": float("nan")}, "entropy must be a finite"),
        ({"entropy": None}, "entropy must be a finite number at least 0, not None"),
        ({"gae_lambda": "high"}, "gae_lambda must be a number, not 'high'"),
        ({"gae_lambda": 10**400}, "gae_lambda must be a number, not 1000"),
    ],
)
def test_a_wrong_number_is_named(numbers, message):
    with pytest.raises(SettingError, match=message):
        HParams(**numbers).check()


def test_numbers_are_traced():
    numbers = HParams(learning_rate=jnp.array([1e-3, 1e-4])).check()
    assert numbers.learning_rate.shape == (2,)
    doubled = jax.jit(lambda h: h.check().replace(clip=h.clip * 2))(HParams().check())
    assert float(doubled.clip) == pytest.approx(0.4)
    assert doubled.gamma is None
