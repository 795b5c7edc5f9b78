#!/usr/bin/env python3
"""The same mechanism in the shape that learning programs expect (reset, step), without depending on any of them.

    python environment.py

A policy that pushes towards the side to which the pole falls is compared with one that pushes at random.
"""
from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import linkdyn


class CartPole:
    """Observations are place, angle and their rates; an action is a force of -10 to 10 N, held for 20 ms."""

    dt, largest_force, steps = 0.02, 10.0, 500

    def __init__(self, seed: int = 0) -> None:
        scene = linkdyn.load(Path(__file__).with_name("scene.toml"))
        self.simulator = scene.simulator(method="rk4", step=0.01)
        self.random = np.random.default_rng(seed)

    def reset(self) -> tuple[np.ndarray, dict[str, Any]]:
        start = self.random.uniform(-0.05, 0.05, size=4)
        self.simulator.reset(start[:2], start[2:])
        self.count = 0
        return self._observation(), {}

    def step(self, action: float) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Observation, reward, whether the pole fell or the rail ended, whether the time is up, nothing else."""
        self.simulator.step(self.dt, [float(np.clip(action, -self.largest_force, self.largest_force))])
        self.count += 1
        place, angle = self.simulator.q
        fell = abs(place) > 2.4 or abs(angle) > np.radians(12.0)
        return self._observation(), 0.0 if fell else 1.0, bool(fell), self.count >= self.steps, {}

    def _observation(self) -> np.ndarray:
        return np.concatenate([self.simulator.q, self.simulator.qd])


def reward_of(environment: CartPole, policy, episodes: int = 20) -> float:
    """Mean sum of rewards."""
    total = 0.0
    for _ in range(episodes):
        seen, _ = environment.reset()
        ended = late = False
        while not (ended or late):
            seen, reward, ended, late, _ = environment.step(policy(seen))
            total += reward
    return total / episodes


def main() -> None:
    environment = CartPole()
    random = np.random.default_rng(1)
    print(f"at random              {reward_of(environment, lambda seen: random.uniform(-10.0, 10.0)):6.1f} steps upright")
    print(f"towards where it falls {reward_of(environment, lambda seen: -40.0 * seen[1] - 8.0 * seen[3] + 1.0 * seen[0] + 2.0 * seen[2]):6.1f} steps upright")


if __name__ == "__main__":
    main()
