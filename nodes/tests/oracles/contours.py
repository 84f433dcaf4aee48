"""Contours of twenty images by scikit-image's find_contours, for `nodes/src/texture/isophote/contour/tests.rs`.

    python3 nodes/tests/oracles/contours.py nodes/tests/data/contours.bin > nodes/tests/data/contours.csv

The second file holds all vertices: for each image and rule the number of lines, and of each line the number of its points and then
x and y of each in 1024ths of a pixel, in 16 bits, the lower byte first.

scikit-image 0.26, NumPy 2.4. The images are made of whole numbers, so that both sides have the same ones.
"""
import sys

import numpy as np
from skimage.measure import find_contours


def image(seed, w=37, h=29):
    """Random numbers on every fourth sample (every second of even seeds), in straight lines between, smoothed by [1 2 1]."""
    state = seed

    def draw():
        nonlocal state
        state = (state * 1103515245 + 12345) % 2**31
        return state >> 21

    n = 4 if seed % 2 else 2
    cw, ch = w // n + 2, h // n + 2
    coarse = [[draw() for _ in range(cw)] for _ in range(ch)]
    a = np.zeros((h, w), dtype=np.int64)
    for y in range(h):
        for x in range(w):
            i, j, u, v = x // n, y // n, x % n, y % n
            c = coarse
            a[y, x] = ((c[j][i] * (n - u) + c[j][i + 1] * u) * (n - v)
                       + (c[j + 1][i] * (n - u) + c[j + 1][i + 1] * u) * v)
    for axis in (0, 1):
        p = np.concatenate([a.take([0], axis), a, a.take([-1], axis)], axis)
        k = a.shape[axis]
        a = p.take(range(k), axis) + 2 * p.take(range(1, k + 1), axis) + p.take(range(2, k + 2), axis)
    # At most 1023 n^2 16 < 2^18.
    return a / (1024 * 16 * n * n)


print("seed,rule,lines,closed,points,length,sum_xy,area")
vertices = []
for seed in range(1, 21):
    for rule in ("low", "high"):
        lines = find_contours(image(seed), 0.5 + 2.0**-19, fully_connected=rule)
        vertices.append(np.array([len(lines)]))
        for line in lines:
            vertices += [np.array([len(line)]), np.rint(1024 * line[:, ::-1]).ravel()]
        closed = [np.array_equal(c[0], c[-1]) for c in lines]
        length = sum(np.hypot(*np.diff(c, axis=0).T).sum() for c in lines)
        # The point that a loop begins and ends at counts once.
        moment = sum((c[k:, 0] * c[k:, 1]).sum() for c, k in zip(lines, closed))
        area = sum(abs((c[:-1, 0] * c[1:, 1] - c[1:, 0] * c[:-1, 1]).sum()) / 2
                   for c, k in zip(lines, closed) if k)
        print(f"{seed},{rule},{len(lines)},{sum(closed)},{sum(map(len, lines))},{length:.9f},{moment:.6f},{area:.9f}")
with open(sys.argv[1], "wb") as out:
    out.write(np.concatenate(vertices).astype("<u2").tobytes())
