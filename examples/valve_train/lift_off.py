#!/usr/bin/env python3
"""The force between cam and roller over a turn, at several speeds, and the speed above which the spring is too weak: lift_off.png."""
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import linkdyn

FOLDER = Path(__file__).resolve().parent
scene = linkdyn.load(FOLDER / "scene.toml")
angle = np.radians(np.linspace(-90, 90, 721))


def press(rpm: float) -> np.ndarray:
    """Normal force [N] at the angles, the nose being under the roller at 0."""
    q = angle[:, np.newaxis]
    return scene.inverse(q=q, qd=np.full_like(q, rpm * np.pi / 30), qdd=0 * q, want="reaction").contact_force.values[:, 0]


# Forces are a + b speed**2: two runs tell all speeds.
still, fast = press(0.0), press(1000.0)
growth = (fast - still) / 1000.0**2
falls = growth < 0
limit = float(np.sqrt((still[falls] / -growth[falls]).min()))
print(f"the roller leaves the cam above {limit:.0f} rpm")

figure, axis = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
for rpm, colour in zip((0, 1200, 2000, limit, 3200), plt.get_cmap("viridis")(np.linspace(0.0, 0.85, 5))):
    axis.plot(np.degrees(angle), press(rpm), color=colour, label=f"{rpm:.0f} rpm")
axis.axhline(0, color="0.3", linewidth=0.8)
axis.set(xlabel="cam angle from the nose [deg]", ylabel="force between cam and roller [N]", xlim=(-90, 90))
axis.legend(frameon=False)
axis.spines[["top", "right"]].set_visible(False)
figure.savefig(FOLDER / "lift_off.png", dpi=80)
