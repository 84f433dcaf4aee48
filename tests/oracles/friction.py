"""Oracle values inlined in the tests of nodes/src/friction. Needs numpy and scipy."""
import numpy as np
from scipy import signal


def welch():
    i = np.arange(64)
    x = (((i * i * 7 + 3 * i) % 31).astype(np.float32) / np.float32(31) - np.float32(0.5)).astype(np.float64)
    _, s = signal.welch(x, 1000, window=signal.windows.triang(16), nperseg=16, noverlap=8,
                        detrend=False, scaling="density")
    return s


def displaced():
    """Quantile interpolation with numpy.interp on the CDF knots, no epsilon."""
    n = 12
    k = np.arange(n)
    a = 1.0 + (k * 5 % 7)
    b = 0.5 + (k * k % 11)
    alpha = 0.3
    ca, cb = (np.concatenate([[0], np.cumsum(v) / v.sum()]) for v in (a, b))
    p = np.union1d(ca, cb)
    edges = np.arange(n + 1.0)
    q = (1 - alpha) * np.interp(p, ca, edges) + alpha * np.interp(p, cb, edges)
    d = np.diff(np.interp(edges, q, p))
    mass = d * ((1 - alpha) * a.sum() + alpha * b.sum())
    rms = d * np.sqrt(((1 - alpha) * (a**2).sum() + alpha * (b**2).sum()) / (d**2).sum())
    return mass, rms


def half_turn():
    """sin(pi u) and cos(pi u) on [-1/2, 1/2], least squares on Chebyshev nodes: polynomials in u^2."""
    t = np.cos(np.pi * (np.arange(2000) + 0.5) / 2000) * 0.5
    s = np.linalg.lstsq(np.stack([t ** (2 * j + 1) for j in range(5)], 1), np.sin(np.pi * t), rcond=None)[0]
    c = np.linalg.lstsq(np.stack([t ** (2 * j) for j in range(6)], 1), np.cos(np.pi * t), rcond=None)[0]
    return s, c


if __name__ == "__main__":
    np.set_printoptions(precision=17)
    for f in (welch, displaced, half_turn):
        print(f.__name__, f())
