"""An actor-critic in PyTorch, which shares memory with the environments.

    python examples/torch_loop.py [--updates N]        needs pip install 'jaxenstein[torch]'

JAX passes frames to torch with DLPack, without a copy; on a GPU they never leave the device.
"""

from __future__ import annotations

import argparse
import collections
import math
from collections.abc import Sequence

import jax
import torch  # pyright: ignore[reportMissingImports]
from torch import nn  # pyright: ignore[reportMissingImports]

import jaxenstein
from jaxenstein.adapters.torch import TorchBatch

ROOM = """
#####
#S..#
#..G#
#####
"""


class Policy(nn.Module):
    """Maps images uint8[N, H, W, 3] to logits and values."""

    def __init__(self, height: int, width: int, num_actions: int) -> None:
        """Create the layers."""
        super().__init__()
        self.body = nn.Sequential(
            nn.Flatten(),
            nn.Linear(height * width * 3, 128),
            nn.ReLU(),
            nn.Linear(128, 64),
            nn.ReLU(),
        )
        self.logits = nn.Linear(64, num_actions)
        self.value = nn.Linear(64, 1)

    def forward(self, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """float32[N, actions] and float32[N]."""
        x = self.body(images.float() / 255)
        return self.logits(x), self.value(x)[:, 0]


def roll_out(
    envs: TorchBatch, policy: Policy, observation: torch.Tensor, steps: int, discount: float
) -> tuple[torch.Tensor, torch.Tensor, list[float]]:
    """Act for some steps; return the next observations, the loss, and returns of ended episodes."""
    choices, rewards, keeps, returns = [], [], [], []
    for _ in range(steps):
        logits, value = policy(observation)
        chance = torch.distributions.Categorical(logits=logits)
        action = chance.sample()
        out = envs.step(action)
        reward = out.reward.clone()
        if out.ended is not None:
            returns += out.ended.info["episode_return"].tolist()
            # After a truncation, bootstrap from the value of the last observation.
            with torch.no_grad():
                beyond = discount * policy(out.ended.observation)[1]
            i = out.ended.indices
            reward[i] += beyond * ~out.terminated[i]
        choices.append((chance.log_prob(action), value, chance.entropy()))
        rewards.append(reward)
        keeps.append(discount * ~(out.terminated | out.truncated))
        observation = out.observation
    with torch.no_grad():
        target = policy(observation)[1]
    targets = []
    for reward, keep in zip(rewards[::-1], keeps[::-1], strict=True):
        target = reward + keep * target
        targets.insert(0, target)
    log_prob, value, entropy = (torch.stack(part) for part in zip(*choices, strict=True))
    advantage = torch.stack(targets) - value
    loss = (advantage**2 / 2 - advantage.detach() * log_prob - 0.01 * entropy).mean()
    return observation, loss, returns


def main(argv: Sequence[str] | None = None) -> list[float]:
    """Train; return the mean return of the last 200 episodes after each update."""
    parser = argparse.ArgumentParser(description="An actor-critic in PyTorch.")
    parser.add_argument("--updates", type=int, default=250)
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--steps", type=int, default=8, help="steps per update")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(argv)
    # Dispatch to another thread only costs time, since the loop waits for every frame.
    jax.config.update("jax_cpu_enable_async_dispatch", False)
    torch.manual_seed(options.seed)
    env, params = jaxenstein.from_ascii(ROOM, heading=0.0, height=16, width=16)
    params = params.replace(max_steps_in_episode=50, move_distance=0.5, turn_angle=math.pi / 4)
    envs = TorchBatch(env, params, options.envs)
    policy = Policy(16, 16, envs.num_actions).to(envs.device)
    optimiser = torch.optim.Adam(policy.parameters(), 1e-3)

    curve = []
    recent = collections.deque(maxlen=200)
    observation, _ = envs.reset(options.seed)
    for update in range(1, options.updates + 1):
        observation, loss, returns = roll_out(
            envs, policy, observation, options.steps, float(params.discount)
        )
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(policy.parameters(), 0.5)
        optimiser.step()
        recent.extend(returns)
        curve.append(sum(recent) / len(recent) if recent else math.nan)
        if update % 10 == 0:
            print(f"update {update}: mean return {curve[-1]:.2f}")
    return curve


if __name__ == "__main__":
    main()
