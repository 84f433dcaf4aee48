"""Oracle values of nodes/tests/maths/cloth_oracles.rs: curvature, events, energies, the head, high-pass, cepstrum, Gaussian and warp.

Needs numpy, scipy, scikit-image, librosa, libigl, and trimesh with rtree.
"""
import igl
import librosa
import numpy as np
import trimesh
from scipy import fft, ndimage, signal
from scipy.interpolate import RBFInterpolator
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from skimage.exposure import match_histograms
from trimesh.curvature import discrete_mean_curvature_measure


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


def lumpy(n, rows, a, tall):
    """A closed lumpy sphere: rows of n vertices from pole to pole, and the poles."""
    k = np.arange(n * rows)
    lon, lat = 2 * np.pi * (k % n) / n, np.pi * (k // n + 1) / (rows + 1)
    radius = 1 + noise(n * rows, a) / 8
    ring = radius[:, None] * np.stack([np.sin(lat) * np.cos(lon), np.sin(lat) * np.sin(lon), tall * np.cos(lat)], 1)
    vertices = np.concatenate([ring, [[0, 0, tall], [0, 0, -tall]]])
    faces, last = [], n * (rows - 1)
    for c in range(n):
        d = (c + 1) % n
        for r in range(0, last, n):
            faces += [[r + c, r + n + c, r + n + d], [r + c, r + n + d, r + d]]
        faces += [[n * rows, c, d], [n * rows + 1, last + d, last + c]]
    return trimesh.Trimesh(vertices, faces, process=False)


def curvature_measure():
    """Length times angle of all edges in a ball, halved: of whole meshes, and at vertices of one whose edges are all of length 1."""
    for n, rows, a, tall in ((12, 7, 9, 1), (9, 11, 4, 2), (16, 5, 11, 0.5)):
        mesh = lumpy(n, rows, a, tall)
        assert mesh.is_watertight and mesh.volume > 0
        show("measure", discrete_mean_curvature_measure(mesh, [[0, 0, 0]], 9.0))
    # a pentagonal bipyramid
    far = 0.5 / np.sin(np.pi / 5)
    angle = 2 * np.pi * np.arange(5) / 5
    high = np.sqrt(1 - far * far)
    vertices = [[far * np.cos(t), far * np.sin(t), 0] for t in angle] + [[0, 0, high], [0, 0, -high]]
    faces = [f for c in range(5) for f in ([5, c, (c + 1) % 5], [6, (c + 1) % 5, c])]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    show("measure at vertices", discrete_mean_curvature_measure(mesh, [vertices[0], vertices[5]], 0.5))


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
    shape = dict(sr=fs, n_fft=size, n_mels=3, fmin=0, fmax=20000, htk=True, norm=None, dtype=np.float64)
    energy = librosa.filters.mel(**shape) @ (weight * power) / (size * (window**2).sum())
    show("triangles", fft.dct(np.log(energy), type=2, norm="ortho"))


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


def components():
    """Lowest vertex, number of vertices and energy of each component of equal labels on a grid of 12 by 9 with diagonals."""
    n, rows = 12, 9
    delta = noise(n * rows, 13)
    delta[np.abs(delta) < 0.45] = 0
    v = np.arange(n * rows)
    a = v[(v % n < n - 1) & (v < n * (rows - 1))]
    right = v[v % n < n - 1]
    edges = np.concatenate([np.stack(e, 1) for e in ((right, right + 1), (v[:-n], v[n:]), (a, a + n + 1))])
    edges = edges[np.sign(delta[edges[:, 0]]) * np.sign(delta[edges[:, 1]]) > 0]
    _, of = connected_components(coo_matrix((np.ones(len(edges)), edges.T), shape=(len(v),) * 2), directed=False)
    for c in np.unique(of[delta != 0]):
        in_it = v[of == c]
        print("component", (int(in_it[0]), len(in_it), float(delta[in_it].sum())))


def matching():
    """Energies with ties onto energies without, and as many of both, by the upper distribution functions."""
    energies = (np.arange(25) + 1.0) ** 3 / 16
    show("matching", match_histograms(noise(40, 7) + 1, energies)[::3])
    other = np.exp((np.arange(25) * 7 % 25) / 5)
    show("matching as many", match_histograms(other, energies)[::3])


def head():
    """Brown and Duda's shadow."""
    w0 = 343 / 0.0875
    for fs in (44100, 48000, 96000):
        for theta in (0, 60, 90, 150, 180):
            alpha = 1.05 + 0.95 * np.cos(np.radians(180 * theta / 150))
            b, a = signal.bilinear([alpha, 2 * w0], [1, 2 * w0], fs)
            show(f"head {fs} {theta}", [*b, a[1]])


for make in (curvature, curvature_measure, components, matching, head, high_pass, cepstrum, gaussian, warp):
    make()
