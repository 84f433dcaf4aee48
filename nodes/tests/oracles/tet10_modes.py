"""Modes of a Gmsh 4.1 ASCII mesh in steel, by second-order elements assembled here and scipy's eigsh.

Writes the first frequencies for nodes/src/solid/fem/tests/analytic.rs:
    python3 tet10_modes.py ../../../graphs/assets/meshes/marimba_bar.msh
"""
import itertools
import math
import sys
import time

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

E, NU, RHO = 200e9, 0.3, 7850.0


def read(path):
    lines = iter(open(path).read().split("\n"))
    nodes, tets = {}, []
    for line in lines:
        if line == "$Nodes":
            for _ in range(int(next(lines).split()[0])):
                count = int(next(lines).split()[3])
                tags = [int(next(lines)) for _ in range(count)]
                for tag in tags:
                    nodes[tag] = [float(x) for x in next(lines).split()[:3]]
        if line == "$Elements":
            for _ in range(int(next(lines).split()[0])):
                kind, count = (int(x) for x in next(lines).split()[2:])
                for _ in range(count):
                    words = [int(x) for x in next(lines).split()]
                    if kind == 4:
                        tets.append(words[1:])
    used = sorted({n for t in tets for n in t})
    index = {n: i for i, n in enumerate(used)}
    return np.array([nodes[n] for n in used]), np.array([[index[n] for n in t] for t in tets])


def quadratic(points, tets):
    points, middle, out = list(points), {}, []
    for t in tets:
        row = list(t)
        for a, b in itertools.combinations(range(4), 2):
            key = tuple(sorted((t[a], t[b])))
            if key not in middle:
                middle[key] = len(points)
                points.append(0.5 * (points[t[a]] + points[t[b]]))
            row.append(middle[key])
        out.append(row)
    return np.array(points), np.array(out)


def matrices(points, tets):
    """K and M by the strain matrix B and numerical integration of degree 4 (tensor Gauss rule on the tetrahedron)."""
    pairs = list(itertools.combinations(range(4), 2))
    g, w = np.polynomial.legendre.leggauss(4)
    g, w = 0.5 * (g + 1), 0.5 * w
    lam, mu = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    D = np.diag([2 * mu] * 3 + [mu] * 3)
    D[:3, :3] += lam
    x = points[tets[:, :4]]
    J = np.moveaxis(x[:, 1:] - x[:, :1], 1, 2)  # columns are edges
    det, inv = np.linalg.det(J), np.linalg.inv(J)
    sign = np.abs(det)
    Ke, Me = np.zeros((len(tets), 30, 30)), np.zeros((10, 10))
    for (a, wa), (b, wb), (c, wc) in itertools.product(zip(g, w), repeat=3):
        r, s, t = a, b * (1 - a), c * (1 - a) * (1 - b)
        weight = wa * wb * wc * (1 - a) ** 2 * (1 - b)
        L = np.array([1 - r - s - t, r, s, t])
        dL = np.array([[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
        N = np.array([l * (2 * l - 1) for l in L] + [4 * L[p] * L[q] for p, q in pairs])
        dN = np.array([(4 * L[i] - 1) * dL[i] for i in range(4)] + [4 * (L[p] * dL[q] + L[q] * dL[p]) for p, q in pairs])
        Me += weight * np.outer(N, N)
        G = np.einsum("na,eab->enb", dN, inv)
        B = np.zeros((len(tets), 6, 30))
        B[:, 0, 0::3], B[:, 1, 1::3], B[:, 2, 2::3] = G[:, :, 0], G[:, :, 1], G[:, :, 2]
        B[:, 3, 0::3], B[:, 3, 1::3] = G[:, :, 1], G[:, :, 0]
        B[:, 4, 1::3], B[:, 4, 2::3] = G[:, :, 2], G[:, :, 1]
        B[:, 5, 0::3], B[:, 5, 2::3] = G[:, :, 2], G[:, :, 0]
        Ke += (weight * sign)[:, None, None] * np.einsum("eki,kl,elj->eij", B, D, B)
    dof = (3 * tets[:, :, None] + np.arange(3)).reshape(len(tets), 30)
    rows, cols = np.repeat(dof, 30, axis=1), np.tile(dof, (1, 30))
    M = RHO * sign[:, None, None] * np.kron(Me, np.eye(3))[None]
    n = 3 * len(points)
    make = lambda v: sp.csc_matrix((v.ravel(), (rows.ravel(), cols.ravel())), shape=(n, n))
    return make(Ke), make(M)


points, tets = quadratic(*read(sys.argv[1]))
K, M = matrices(points, tets)
count = int(sys.argv[2]) if len(sys.argv) > 2 else 16
start = time.process_time()
values, shapes = eigsh(K, count + 6, M, sigma=-((2 * math.pi * 100) ** 2), tol=1e-10)
took = time.process_time() - start
order = np.argsort(values)
values, shapes = values[order], shapes[:, order]
inertia = (M @ shapes[:, 6:]) * values[6:]
residual = (np.linalg.norm(K @ shapes[:, 6:] - inertia, axis=0) / np.linalg.norm(inertia, axis=0)).max()
# Linux; the largest resident set of `resource` includes that of the process which started this one.
memory = next((int(line.split()[1]) >> 10 for line in open("/proc/self/status") if line.startswith("VmHWM")), 0)
print(
    f"{K.shape[0]} unknowns, {count} modes in {took:.2f} s of one thread, residual {residual:.1e}, {memory} MiB in all",
    file=sys.stderr,
)
print(", ".join(f"{math.sqrt(v) / (2 * math.pi):.6f}" for v in values[6:]))
