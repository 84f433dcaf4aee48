"""Oracle values of nodes/tests/cloth_oracles.rs: curvature, components, matching, high-pass, cepstrum, Gaussian and warp.

Needs numpy, scipy, scikit-image and libigl.
"""
import igl
import numpy as np
import skimage.exposure
from scipy import fft, ndimage, signal, sparse
from scipy.interpolate import RBFInterpolator


def show(name, values):
    print(name, [float(f"{x:.12g}") for x in np.ravel(values)])


def noise(n, a):
    """Whole numbers that are the same everywhere, about zero."""
    i = np.arange(n)
    return ((i * i * a + 3 * i) % 31 - 15.0) / 16.0


def curvature():
    """-M^-1 L V is twice the curvature vector; mixed (Voronoi) areas; normals weighted by angle."""
    n = 5
    y, x = np.divmod(np.arange(n * n), n)
    z = ((x * x * 7 + 3 * y * y + x * y) % 11) / 16.0
    vertices = np.stack([x, y, z], axis=1).astype(float)
    a = np.array([r * n + c for r in range(n - 1) for c in range(n - 1)])
    faces = np.concatenate([np.stack([a, a + 1, a + n + 1], 1), np.stack([a, a + n + 1, a + n], 1)]).astype(np.int64)
    mass = igl.massmatrix(vertices, faces, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    k = -(igl.cotmatrix(vertices, faces) @ vertices) / mass[:, None]
    normals = igl.per_vertex_normals(vertices, faces, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE)
    inner = (x > 0) & (x < n - 1) & (y > 0) & (y < n - 1)
    show("curvature", (0.5 * (k * normals).sum(1))[inner])
    show("areas", mass[inner])


def components():
    """Connected parts of equal label on a grid of 20 by 15: lowest vertex, vertices, squared sum of changes."""
    n, rows = 20, 15
    delta = noise(n * rows, 23)
    label = np.where(np.abs(delta) > 0.2, np.sign(delta), 0).astype(int)
    at = np.arange(n * rows).reshape(rows, n)
    edges = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in (
        (at[:, :-1], at[:, 1:]), (at[:-1], at[1:]), (at[:-1, :-1], at[1:, 1:]))])
    a, b = edges[(label[edges[:, 0]] == label[edges[:, 1]]) & (label[edges[:, 0]] != 0)].T
    graph = sparse.coo_matrix((np.ones(len(a)), (a, b)), shape=(n * rows, n * rows))
    _, part = sparse.csgraph.connected_components(graph, directed=False)
    of = [np.flatnonzero(part == k) for k in range(part.max() + 1)]
    of = sorted((vertices for vertices in of if label[vertices[0]]), key=lambda vertices: vertices[0])
    show("components", [[v[0], len(v), delta[v].sum() ** 2] for v in of])


def matching():
    """As many energies as samples, none twice: then the upper share of skimage and the middle rank are the same."""
    k = np.arange(60)
    events, bank = np.exp(4 * (k * 37 % 61) / 61 - 2), (1 + (k * 23 % 67)) ** 1.5
    show("matching", skimage.exposure.match_histograms(events, bank))


def high_pass():
    for fs in (44100, 48000, 96000):
        sos = signal.butter(5, 100, "hp", fs=fs, output="sos")
        show(f"high_pass {fs}", signal.sosfilt(sos, noise(400, 7))[::57])


def cepstrum():
    """One unit of 200 samples in a sine window of 400, three rectangular bands of equal mel width from 0 to 20 kHz."""
    x, fs, frame, size = noise(400, 5).astype(np.float32).astype(float), 48000, 400, 512
    window = np.sin(np.pi * (np.arange(frame) + 0.5) / frame)
    power = np.abs(np.fft.rfft(x * window, size)) ** 2
    weight = np.full(len(power), 2.0)
    weight[[0, -1]] = 1.0
    mel = np.linspace(0, 2595 * np.log10(1 + 20000 / 700), 4)
    edges = 700 * (10 ** (mel / 2595) - 1) * size / fs
    bins = np.arange(len(power))
    low, high = np.maximum(bins - 0.5, 0), np.minimum(bins + 0.5, size / 2)
    share = [np.maximum(np.minimum(high, b) - np.maximum(low, a), 0) / (high - low) for a, b in zip(edges, edges[1:])]
    energy = [(weight * power * s).sum() / (size * (window**2).sum()) for s in share]
    show("cepstrum", fft.dct(np.log(energy), type=2, norm="ortho"))


def gaussian():
    for width in (10, 20, 30, 50):
        x = noise(40, 11).astype(np.float32).astype(float)
        show(f"gaussian {width}", ndimage.gaussian_filter1d(x, width / 4, truncate=2.0, mode="nearest")[::9])


def warp():
    """SciPy's kernel is r^2 ln r, half of ours."""
    for d, n in ((3, 9), (6, 14)):
        nodes = noise(n * d, 13).reshape(n, d) * 3
        to = nodes + noise(n * d, 17).reshape(n, d)
        ask = noise(2 * d, 19).reshape(2, d) * 2
        for stiff in (0.0, 1.0, 1e3):
            f = RBFInterpolator(nodes, to, kernel="thin_plate_spline", smoothing=stiff / 2, degree=1)
            show(f"warp {d} {stiff}", f(ask))


for make in (curvature, components, matching, high_pass, cepstrum, gaussian, warp):
    make()
