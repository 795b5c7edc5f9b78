"""Draws losses.png: torque at the camshaft with and without friction, where the cam touches the bucket, and what the friction takes."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import linkdyn

FOLDER = Path(__file__).resolve().parent


def main() -> None:
    scene = linkdyn.load(FOLDER / "scene.toml")
    run = scene.inverse(want="all")
    smooth = scene.with_({"variables.mu_cam": 0.0, "variables.mu_bore": 0.0}).inverse(want="driving_force")
    angle = np.degrees(run.q.values[:, 0])
    touch = run.reaction.sel(joint="lobe")
    place = -1e3 * touch.sel(component="My") / touch.sel(component="Fz")
    figure, axes = plt.subplots(3, 1, figsize=(7.5, 7.0), sharex=True, layout="constrained")
    axes[0].plot(angle, smooth.driving_force[:, 0], color="0.6", label="without friction")
    axes[0].plot(angle, run.driving_force[:, 0], color="C0", label="with friction")
    axes[0].set_ylabel("torque [N m]")
    axes[0].legend(frameon=False)
    axes[1].plot(angle, place, color="C2")
    axes[1].set_ylabel("cam touches\nbeside the middle [mm]")
    axes[2].stackplot(angle, run.friction_power.sel(joint="lobe"), run.friction_power.sel(joint="bore"), labels=["cam on bucket", "bucket in bore"])
    axes[2].set(ylabel="friction takes [W]", xlabel="camshaft [deg]", xlim=(-180, 180), xticks=range(-180, 181, 60))
    axes[2].legend(frameon=False)
    for axis in axes:
        axis.axhline(0, color="0.8", linewidth=0.8, zorder=0)
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(FOLDER / "losses.png", dpi=80)
    turn = run.time.values[-1]
    lost = [float(run.friction_power.sel(joint=name).integrate("time")) for name in ("lobe", "bore")]
    print(f"a turn takes {float(run.driving_power[:, 0].integrate('time')):.3f} J, {lost[0]:.3f} J at the cam and {lost[1]:.3f} J in the bore,")
    print(f"{sum(lost) / turn:.1f} W on average; least contact force {float(run.contact_force.min()):.0f} N, most {float(run.contact_force.max()):.0f} N")


if __name__ == "__main__":
    main()
