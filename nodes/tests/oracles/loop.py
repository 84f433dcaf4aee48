"""Prints Loop's subdivision of a small open mesh, from trimesh, for the test of mesh::subdivide."""
import numpy as np
import trimesh

# A hood whose top has four neighbours, two of them with five. No inner edge joins two vertices of the border: trimesh would
# count those as neighbours along the border, with weights that add up to more than 1.
vertices = np.array([
    [0.0, 0.0, 1.0], [1.0, 0.0, 0.5], [0.0, 1.0, 0.4], [-1.0, 0.0, 0.6], [0.0, -1.0, 0.3],
    [2.0, 1.0, 0.0], [2.0, -1.0, 0.1], [-1.0, 2.0, 0.0],
])
faces = np.array([
    [0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 5, 2], [1, 6, 5], [4, 6, 1], [2, 5, 7], [2, 7, 3],
])
fine, _ = trimesh.remesh.subdivide_loop(vertices, faces, iterations=1)
# The order of the node: old vertices, then edges by their lower and then their higher vertex.
edges = sorted({(min(a, b), max(a, b)) for f in faces for a, b in zip(f, np.roll(f, -1))})
wanted = list(fine[: len(vertices)])
for a, b in edges:
    # trimesh puts edges in an order of its own: the nearest to the middle of the edge is meant.
    rest = fine[len(vertices):]
    wanted.append(rest[np.argmin(np.linalg.norm(rest - (vertices[a] + vertices[b]) / 2, axis=1))])
assert len({tuple(p) for p in wanted}) == len(fine)
for p in wanted:
    print("[{}],".format(", ".join(repr(round(float(x), 9)) for x in p)))
