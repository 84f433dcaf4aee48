"""Filters of textures by OpenCV and scikit-image, on the images of `nodes/benches/image.rs` and `nodes/benches/isophotes.rs`.

    FOLEY_BENCH_IMAGES=/tmp cargo bench -p foley-nodes -- isophotes
    python3 benches/peers/textures.py /tmp

Needs NumPy, OpenCV and scikit-image; without a folder the isophotes are left out. Prints the best of some runs in ms.
"""
import sys
import time

import cv2
import numpy as np
import skimage
from skimage import filters, measure, restoration


def best(work, runs):
    work()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def line(what, size, ms):
    print(f"{what:<44} {size:4} x {size:<4} {ms:10.2f} ms", flush=True)


print(f"OpenCV {cv2.__version__} on {cv2.getNumThreads()} threads, scikit-image {skimage.__version__}, NumPy {np.__version__}")
for size, runs in ((512, 21), (4096, 3)):
    y, x = np.mgrid[0:size, 0:size].astype(np.float32)
    image = (50 + 50 * np.sin(0.05 * x) * np.cos(0.031 * y + 0.01 * x)).astype(np.float32)
    edge = cv2.BORDER_REPLICATE

    def gradient():
        return [cv2.Sobel(image, cv2.CV_32F, dx, 1 - dx, ksize=3, scale=1 / 8, borderType=edge) for dx in (1, 0)]

    def difference():
        narrow, wide = (cv2.GaussianBlur(image, (0, 0), s, borderType=edge) for s in (1.0, 1.6))
        return narrow - wide

    line("OpenCV Sobel, both directions", size, best(gradient, runs))
    line("OpenCV Sobel and magnitude", size, best(lambda: cv2.magnitude(*gradient()), runs))
    line("scikit-image sobel", size, best(lambda: filters.sobel(image), runs))
    line("OpenCV difference of Gaussians 1.0, 1.6", size, best(difference, runs))
    line("scikit-image difference_of_gaussians", size, best(lambda: filters.difference_of_gaussians(image, 1.0, 1.6), runs))
    for sigma_d, sigma_r in ((2.0, 10.0), (3.0, 4.25)):
        d = 4 * round(sigma_d) + 1
        few = 1 if size > 1000 else runs
        line(f"OpenCV bilateralFilter, radius {d // 2}", size,
             best(lambda: cv2.bilateralFilter(image, d, sigma_r, sigma_d, borderType=edge), few))
    if size < 1000:
        small = image / 100
        line("scikit-image denoise_bilateral, radius 6", size,
             best(lambda: restoration.denoise_bilateral(small, 13, 0.0425, 3.0), 1))
    if len(sys.argv) > 1:
        noise = np.fromfile(f"{sys.argv[1]}/isophotes_{size}.f32", np.float32).reshape(size, size)
        levels = np.quantile(noise, (np.arange(8) + 0.5) / 8)
        few = 1 if size > 1000 else 5
        line("scikit-image find_contours, one level", size, best(lambda: measure.find_contours(noise, 0.5), few))
        line("scikit-image find_contours, eight levels", size,
             best(lambda: [measure.find_contours(noise, level) for level in levels], few))
