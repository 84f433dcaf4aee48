"""Prints PCHIP values on non-uniform knots, from SciPy, for the tests of contact::sliding::pchip."""
import numpy as np
from scipy.interpolate import PchipInterpolator

cases = [
    ([0.0, 0.4, 0.5, 1.7, 2.0, 3.1], [0.3, 0.9, 0.85, 0.2, 0.0, 1.4]),
    ([0.0, 0.25, 1.5, 1.75], [1.0, 0.9, 2.5, 0.1]),
    ([0.0, 0.1, 0.35], [0.0, 1.0, 0.9]),
]
for t, s in cases:
    f = PchipInterpolator(t, s)
    mid = [(a + b) / 2 * 0.6 + 0.4 * a for a, b in zip(t, t[1:])]
    print("t", t, "s", s)
    print("slopes", [repr(float(x)) for x in f.derivative()(t)])
    print("at", [repr(x) for x in mid])
    print("values", [repr(float(x)) for x in f(mid)])
