#!/usr/bin/env python3
"""Design the arm's controller with scipy.signal, from a measurement at the machine, and let it run there.

    python notch.py [--out FOLDER]

A chirp of the motor's torque shows where arm and motor swing against each other on the belt. A model with that resonance says how
fast the loop may be, with a notch at the resonance and without; the controllers are made discrete and lead the mechanism.
"""
from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from scipy import signal

import linkdyn

EVERY = 1e-3                                    # sampling interval [s]
BELT = 2.0                                      # turns of the pulley for one of the arm
SWING, DURATION = np.pi / 2, 0.45               # of the arm [rad], [s]
LIMIT = 12.0                                    # torque behind the motor's gear [N m]
PART = "0.3 kg"                                 # of which the controller knows nothing
ARM, NEAR = 0.35, 0.2                           # [m], [mm]
CASES = (("3 Hz", 3.0, False), ("6 Hz", 6.0, False), ("6 Hz, notch", 6.0, True))


@dataclass
class Plant:
    """From the torque behind the gear to the angle of the arm: an inertia, and one resonance."""

    inertia: float
    resonance: float
    damping: float

    def system(self) -> signal.TransferFunction:
        swing = [1.0, 2.0 * self.damping * self.resonance, self.resonance**2]
        return signal.TransferFunction(BELT / self.inertia * np.array([2.0 * self.damping * self.resonance, self.resonance**2]), [*swing, 0.0, 0.0])


def measure(simulator: linkdyn.Simulator) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and response of the arm's acceleration to the torque: a chirp of 16 s, too weak to let the belt go slack, and 2 s in which it dies away."""
    t = EVERY * np.arange(18_000)
    torque = np.where(t < 16.0, 0.1 * signal.chirp(t, 4.0, 16.0, 60.0, phi=-90), 0.0)
    simulator.reset()
    run = simulator.run(lambda s: [torque[round(s.t / EVERY)]], t_end=t[-1], every=EVERY)
    acceleration = np.gradient(run.qd.sel(coordinate="arm").values, EVERY)
    whole = {"fs": 1.0 / EVERY, "window": "boxcar", "nperseg": len(t), "detrend": False}
    f, power = signal.welch(torque, **whole)
    _, cross = signal.csd(torque, acceleration, **whole)
    within = (f > 5.0) & (f < 55.0)
    # a torque that is held is late by half an interval
    return f[within], (cross / power)[within] * np.exp(1j * np.pi * f[within] * EVERY)


def identified(f: np.ndarray, response: np.ndarray) -> Plant:
    """The measured peak, as wide as it is at its half power, and the inertia that goes with it below."""
    peaks, _ = signal.find_peaks(np.abs(response), prominence=0.5 * np.abs(response).max())
    (width,), _, (left,), (right,) = signal.peak_widths(np.abs(response) ** 2, peaks)
    resonance = 2.0 * np.pi * f[peaks[0]]
    step = f[1] - f[0]
    low = f < 0.5 * f[peaks[0]]
    inertia = np.mean(BELT / np.abs(response[low] * (1.0 - (2.0 * np.pi * f[low] / resonance) ** 2)))
    return Plant(inertia, resonance, 0.5 * width * step / f[peaks[0]])


class Filter:
    """A transfer function, made discrete by Tustin's rule, fed sample by sample."""

    def __init__(self, continuous: signal.TransferFunction) -> None:
        self.numerator, self.denominator, _ = signal.cont2discrete((continuous.num, continuous.den), EVERY, "bilinear")
        self.numerator = self.numerator.ravel()
        self.memory = np.zeros(len(self.denominator) - 1)

    def __call__(self, value: float) -> float:
        (answer,), self.memory = signal.lfilter(self.numerator, self.denominator, [value], zi=self.memory)
        return float(answer)


def controller(plant: Plant, crossing: float, notch: bool) -> Filter:
    """Lead about a crossing frequency [Hz] and, if it is asked for, a notch at the resonance."""
    at = 2.0 * np.pi * crossing
    numerator, denominator = np.array([4.0 / at, 1.0]), np.array([0.25 / at, 1.0])
    gain = plant.inertia * at**2 / BELT / 4.0
    if notch:
        w = plant.resonance
        numerator = np.polymul(numerator, [1.0, 2.0 * plant.damping * w, w**2])
        denominator = np.polymul(denominator, [1.0, 1.4 * w, w**2])
    return Filter(signal.TransferFunction(gain * numerator, denominator))


def loop(plant: Plant, of: Filter) -> signal.TransferFunction:
    """Controller and sampled plant in series."""
    own = plant.system()
    numerator, denominator, _ = signal.cont2discrete((own.num, own.den), EVERY, "zoh")
    return signal.TransferFunction(np.polymul(of.numerator, numerator.ravel()), np.polymul(of.denominator, denominator), dt=EVERY)


def slowest_decay(opened: signal.TransferFunction) -> float:
    """Decay of the closed loop's least damped pole [1/s]; negative: it grows."""
    poles = np.roots(np.polyadd(opened.num, opened.den))
    return float(-np.log(np.abs(poles)).max() / EVERY)


def margins(opened: signal.TransferFunction) -> tuple[float, float]:
    """Phase margin [deg], the least of all crossings, and gain margin [dB]."""
    w = 2.0 * np.pi * EVERY * np.geomspace(0.3, 450.0, 40_000)
    _, response = signal.dfreqresp(opened, w)
    size, phase = np.abs(response), np.unwrap(np.angle(response))
    crossed = np.nonzero(np.diff(np.sign(size - 1.0)))[0]
    turned = np.nonzero(np.diff(np.sign(response.imag)) * (response.real[1:] < 0.0))[0]
    left = np.degrees(np.angle(-response[crossed]))
    return float(left[np.abs(left).argmin()]), float(-20.0 * np.log10(size[turned].max()))


def path(t: float) -> tuple[float, float]:
    """Angle of the arm that is wanted, and its acceleration."""
    s = min(max(t / DURATION, 0.0), 1.0)
    return SWING * s**3 * (10.0 - 15.0 * s + 6.0 * s**2), SWING * 60.0 * s * (1.0 - 3.0 * s + 2.0 * s**2) / DURATION**2


def swing(scene: linkdyn.Scene, plant: Plant, of: Filter) -> tuple[np.ndarray, np.ndarray, xr.Dataset]:
    """Instants, how far the gripper is ahead of its path [mm], and the run: inertia ahead, the rest by the controller."""

    def lead(simulator: linkdyn.Simulator) -> list[float]:
        wanted, acceleration = path(simulator.t)
        torque = plant.inertia / BELT * acceleration + of(wanted - simulator.q[1])
        return [float(np.clip(torque, -LIMIT, LIMIT))]

    run = scene.simulator().run(lead, t_end=1.5, every=EVERY)
    assert run.attrs["stopped"] == ""
    wanted = np.array([path(t)[0] for t in run.time.values])
    return run.time.values, 1e3 * ARM * (run.q.sel(coordinate="arm").values - wanted), run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/swing_arm"))
    out = parser.parse_args().out
    scene = linkdyn.load(Path(__file__).with_name("scene.toml"))
    f, response = measure(scene.simulator())
    plant = identified(f, response)
    print(f"measured: inertia {plant.inertia:.4f} kg m2, resonance {plant.resonance / (2 * np.pi):.2f} Hz, damping {100 * plant.damping:.2f} %\n")
    print("              margins of   slowest     empty gripper       a part of 300 g")
    print("             phase    gain     decay     off   in 0.2 mm     off   in 0.2 mm")
    runs = {}
    for name, crossing, notch in CASES:
        opened = loop(plant, controller(plant, crossing, notch))
        phase, gain = margins(opened)
        runs[name] = [swing(scene.with_({"variables.part": part}), plant, controller(plant, crossing, notch))[:2] for part in ("0 kg", PART)]
        line = f"{name:11s}{phase:3.0f} deg {gain:4.0f} dB {slowest_decay(opened):6.1f} /s"
        for t, off in runs[name]:
            last = t[np.nonzero(np.abs(off) > NEAR)[0][-1]] - DURATION
            line += f"{np.abs(off).max():6.1f} mm {1e3 * last:5.0f} ms  " if last < 1.0 else "        never     "
        print(line.rstrip())
    draw(f, response, plant, runs, out)


def draw(f: np.ndarray, response: np.ndarray, plant: Plant, runs: dict, out: Path) -> None:
    """What was measured, what the notch does to the loop, and how far the gripper is off."""
    blue, red, grey = "#2166AC", "#B2182B", "0.45"
    figure, axes = plt.subplots(1, 3, figsize=(11.0, 3.4), layout="constrained")
    axes[0].semilogy(f[::8], np.abs(response[::8]), ".", color=grey, markersize=3)
    w = 2.0 * np.pi * np.geomspace(1.0, 100.0, 1000)
    _, model = signal.freqresp(plant.system(), w)
    within = (w > 2 * np.pi * 5) & (w < 2 * np.pi * 55)
    axes[0].semilogy(w[within] / (2 * np.pi), np.abs(model * w**2)[within], color=blue, linewidth=1)
    axes[0].annotate("measured", (30, np.interp(30, f, np.abs(response))), xytext=(8, 10), textcoords="offset points", color=grey)
    axes[0].annotate("model", (20, np.interp(2 * np.pi * 20, w, np.abs(model * w**2))), xytext=(-38, 8), textcoords="offset points", color=blue)
    axes[0].set(xlabel="frequency [Hz]", ylabel="acceleration by torque [1/(kg m$^2$)]")
    for name, crossing, notch, colour in (("6 Hz", 6.0, False, red), ("6 Hz, notch", 6.0, True, blue)):
        _, opened = signal.dfreqresp(loop(plant, controller(plant, crossing, notch)), w * EVERY)
        axes[1].loglog(w / (2 * np.pi), np.abs(opened), color=colour, linewidth=1.2)
        axes[1].annotate(name, (25.7, 3.2) if not notch else (19, 0.09), color=colour, ha="right" if notch else "left", xytext=(9 if not notch else 0, 0), textcoords="offset points")
    axes[1].axhline(1.0, color="0.7", linewidth=0.8, zorder=0)
    axes[1].set(xlabel="frequency [Hz]", ylabel="gain of the open loop", ylim=(3e-3, 60))
    for name, k, colour, at in (("6 Hz", 0, red, (0.87, 50)), ("3 Hz", 1, grey, (0.05, -52)), ("6 Hz, notch", 1, blue, (0.02, 18))):
        t, off = runs[name][k]
        shown = t < (1.5 if k else 0.85)
        axes[2].plot(t[shown], off[shown], color=colour, linewidth=1.4 if k else 0.7)
        axes[2].annotate(name + (",\npart" if k else ""), at, color=colour)
    axes[2].axvline(DURATION, color="0.7", linewidth=0.8, zorder=0)
    axes[2].set(xlabel="time [s]", ylabel="off the path [mm]", xlim=(0, 1.2), ylim=(-65, 65))
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "notch.png", dpi=90)


if __name__ == "__main__":
    main()
