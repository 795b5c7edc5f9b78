"""Force of the gas on the piston over one cycle of four strokes, with polytropic compression and expansion."""

from __future__ import annotations

from pathlib import Path

import numpy as np

CRANK, ROD, BORE = 0.043, 0.145, 0.086          # m
COMPRESSION, EXPONENT, RISE = 10.0, 1.32, 3.2    # ratio of volumes, of the polytropes, of pressure in combustion
OUTSIDE = 1.0e5                                  # Pa
BURNING = np.radians(30.0)                       # after the upper dead point

theta = np.radians(np.arange(721))               # 0: upper dead point, the charge is burning
height = CRANK * np.cos(theta) + np.sqrt(ROD**2 - (CRANK * np.sin(theta)) ** 2)
volume = 1.0 / (COMPRESSION - 1.0) + (CRANK + ROD - height) / (2 * CRANK)      # in strokes
squeezed = OUTSIDE * (volume.max() / volume) ** EXPONENT
burnt = 1.0 + (RISE - 1.0) * (1 - np.cos(np.pi * np.clip(theta / BURNING, 0.0, 1.0))) / 2
pressure = np.full(721, OUTSIDE)                 # exhaust and intake
pressure[:181] = (burnt * squeezed)[:181]        # expansion
blow_down = np.arange(181, 221)
pressure[blow_down] = OUTSIDE + (pressure[180] - OUTSIDE) * (1 + np.cos(np.pi * (blow_down - 180) / 40)) / 2
pressure[540:] = squeezed[540:]                  # compression

force = -(pressure - OUTSIDE) * np.pi * BORE**2 / 4
rows = "".join(f"{t:.10g},{f + 0.0:.6f}\n" for t, f in zip(np.linspace(0.0, 0.02, 721), force))
(Path(__file__).parent / "gas.csv").write_text("t,Fx\n" + rows)
