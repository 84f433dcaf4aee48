"""Oracle values in nodes/src/modal/bank. Needs numpy and scipy.

    python3 tests/oracles/modal.py nodes/src/modal/bank
"""
import sys

import numpy as np
import scipy.signal

FS = 44100.0
MODES = [(220.0, 3.0, 1.0), (1500.0, 12.0, 0.5), (9000.0, 40.0, 0.25)]

# A force that is no pulse: whole numbers over 16, which single precision holds.
n = np.arange(2000)
force = np.where(n < 700, ((37 * n + 11 * n * n) % 33 - 16) / 16, 0.0)
y = np.zeros(len(n))
for f, d, a in MODES:
    r, w = np.exp(-d / FS), 2 * np.pi * f / FS
    y += scipy.signal.lfilter([0, a * r * np.sin(w)], [1, -2 * r * np.cos(w), r * r], force)
text = ", ".join(f"{x:.9e}" for x in y[::40])
open(sys.argv[1] + "/lfilter.in", "w").write(f"[{text}]\n")
