"""Prints Loop's subdivision of a small open mesh, from trimesh, for the test of mesh::subdivide."""
import numpy as np
import trimesh

# A hood over a hexagon whose top has four neighbours, one of them with five, and a flap with two corners of its own.
vertices = np.array([
    [0.0, 0.0, 1.0], [1.0, 0.0, 0.5], [0.0, 1.0, 0.4], [-1.0, 0.0, 0.6], [0.0, -1.0, 0.3],
    [2.0, 1.0, 0.0], [2.0, -1.0, 0.1], [-1.0, 2.0, 0.0], [-2.0, -1.0, 0.2],
])
faces = np.array([
    [0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 5, 2], [1, 6, 5], [4, 6, 1], [2, 5, 7], [2, 7, 3], [3, 8, 4],
])
fine, _ = trimesh.remesh.subdivide_loop(vertices, faces, iterations=1)
# The order of the node: old vertices, then edges by their lower and then their higher vertex.
edges = sorted({(min(a, b), max(a, b)) for f in faces for a, b in zip(f, np.roll(f, -1))})
mesh = trimesh.Trimesh(vertices, faces, process=False)
wanted = list(fine[: len(vertices)])
for a, b in edges:
    # trimesh puts edges in an order of its own: the nearest to the middle of the edge is meant.
    rest = fine[len(vertices):]
    wanted.append(rest[np.argmin(np.linalg.norm(rest - (vertices[a] + vertices[b]) / 2, axis=1))])
assert len({tuple(p) for p in wanted}) == len(fine)
for p in wanted:
    print("[{}],".format(", ".join(repr(round(float(x), 9)) for x in p)))
