"""Recurrent PPO: environments, networks, rollouts, advantages, losses, and the loop over them."""
