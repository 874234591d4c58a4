"""The agent with a memory finds the right arm, and without one it does not."""

import numpy as np
import pytest

import jaxenstein
from examples import own_policy


def test_agent_always_reaches_the_right_end(capsys: pytest.CaptureFixture[str]) -> None:
    results = own_policy.main(episodes=12)
    # 33 steps, 6 turns, and 4 tiles less the radius of the goal in steps of 0.15.
    np.testing.assert_array_equal(results.lengths, 33 + 6 + 25)
    np.testing.assert_array_equal(results.returns, 1)
    assert results.successes.all()
    assert "own_policy in t-maze: return 1 (1 to 1), success 100.0%" in capsys.readouterr().out
    # Without its memory it always ends in the same arm, which is right only for some cues.
    env, params = jaxenstein.make("t-maze")
    policy, carry = own_policy.agent(env, params)

    def forgetful(carry, obs, key):
        (_, time), action = policy((carry[0] * 0, carry[1]), obs, key)
        return (carry[0] * 0, time), action

    results = jaxenstein.evaluate(env, params, forgetful, carry, episodes=12)
    assert set(results.returns.ravel()) == {-1, 1}
