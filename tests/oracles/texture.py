"""Oracle values in nodes/src/texture/testdata. Needs numpy, scipy, scikit-image, OpenCV and Pillow.

    python3 tests/oracles/texture.py nodes/src/texture/testdata
"""
import sys

import cv2
import numpy as np
import scipy.ndimage
import skimage.filters
from PIL import Image

OUT = sys.argv[1] + "/"


def number(x):
    text = f"{float(x):.7g}"
    return text if "." in text or "e" in text else text + ".0"


def listed(values):
    return "[" + ", ".join(number(x) for x in values.ravel()) + "]"


def write(name, text):
    open(OUT + name, "w").write(text + "\n")


x, y = np.meshgrid(np.arange(5), np.arange(4))
image = ((7 * x * x + 3 * x * y + 5 * y) % 11).astype(float)
rows = []
for wrap, mode in (("Repeat", "wrap"), ("Mirror", "reflect"), ("Clamp", "nearest")):
    gx, gy = (scipy.ndimage.sobel(image, axis, mode=mode) / 8 for axis in (1, 0))
    rows.append(f"(Wrap::{wrap}, [{listed(gx)}, {listed(gy)}])")
write("sobel.in", "[\n" + ",\n".join(rows) + ",\n]")
g = skimage.filters.sobel(image)
write("sobel_skimage.in", "[" + ", ".join(listed(row) for row in g) + "]")

x, y = np.meshgrid(np.arange(9), np.arange(7))
image = ((37 * x + 11 * x * y + 5 * y * y) % 29 / 32).astype(np.float32)
smooth = cv2.bilateralFilter(image, 13, 0.15, 3, borderType=cv2.BORDER_REPLICATE)
write("bilateral.in", "[" + ", ".join(f"{x:.9f}" for x in smooth.ravel()) + "]")

g = (np.arange(1000) % 10) ** 2 / 9
write("otsu.in", f"{skimage.filters.threshold_otsu(np.log1p(g)):.9f}")

Image.fromarray(np.full((8, 8), 129, np.uint8)).save(OUT + "grey.jpg", quality=90, optimize=True)
colour = np.zeros((9, 16, 3), np.uint8)
colour[:] = (230, 140, 20)
colour[:4, :4] = (20, 40, 200)
Image.fromarray(colour).save(OUT + "colour.jpg", quality=85, optimize=True, subsampling=2)

rng = np.random.default_rng(3)
grain = scipy.ndimage.gaussian_filter(rng.normal(size=(96, 96)), 1.5, mode="wrap")
grain = np.clip(128 + 40 * grain / grain.std(), 0, 255).astype(np.uint8)
for name, quality in (("blocks.jpg", 4), ("fine.jpg", 92)):
    Image.fromarray(grain).save(OUT + name, quality=quality, optimize=True)

x, y = np.meshgrid(np.arange(11), np.arange(9))
image = ((7 * x * x + 3 * x * y + 5 * y) % 11).astype(float)
rows = []
for wrap, mode in (("Repeat", "wrap"), ("Mirror", "reflect"), ("Clamp", "nearest")):
    for sigma in (1.0, 1.26491):
        blurred = scipy.ndimage.gaussian_filter(image, sigma, mode=mode, truncate=4)
        rows.append(f"(Wrap::{wrap}, {sigma}, {listed(blurred)})")
write("gaussian.in", "[\n" + ",\n".join(rows) + ",\n]")
