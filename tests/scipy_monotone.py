"""Solves the problem of monotone functions (Jacobson, Weinkauf & Sorkine 2012) with SciPy, from nothing but the mesh and
what is prescribed, and compares with our solution.

    pip install scipy
    python tests/scipy_monotone.py PROBLEM.json

PROBLEM.json: {"vertices": [[x, y, z], ...], "triangles": [[a, b, c], ...], "order": 2 to 4, "fixed": [v, ...],
"values": [g, ...], "margin": m, "rising": [[low, high], ...], "solution": [f, ...]}. Of the fixed vertices, the lowest are
minima and the highest maxima. Cotangent Laplacian, barycentric masses, harmonic representative function and edge set are
computed here again; the quadratic program is solved as a least distance problem by non-negative least squares (Lawson &
Hanson 1974, chapter 23), which has no tolerance to set.

Exits with 0 if edges are the same and values agree to 1e-6, 1 if not, 2 if it could not be run.
"""

import json
import sys

TOLERANCE = 1e-6


def operators(np, vertices, triangles):
    """Dense positive cotangent Laplacian, and barycentric masses."""
    n = len(vertices)
    laplacian, mass = np.zeros((n, n)), np.zeros(n)
    for corners in triangles:
        for k in range(3):
            i, j, opposite = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]
            a, b = vertices[i] - vertices[opposite], vertices[j] - vertices[opposite]
            twice_area = np.linalg.norm(np.cross(a, b))
            weight = 0.5 * np.dot(a, b) / twice_area
            laplacian[i, i] += weight
            laplacian[j, j] += weight
            laplacian[i, j] -= weight
            laplacian[j, i] -= weight
            mass[opposite] += twice_area / 6
    return laplacian, mass


def harmonic(np, laplacian, fixed, heights):
    """The harmonic function with these heights at the fixed vertices."""
    n = len(laplacian)
    free = np.setdiff1d(np.arange(n), fixed)
    u = np.zeros(n)
    u[fixed] = heights
    u[free] = np.linalg.solve(laplacian[np.ix_(free, free)], -laplacian[np.ix_(free, fixed)] @ heights)
    return u


def edges(np, triangles, u, extreme):
    """From each vertex's smallest neighbour to it and from it to its greatest; all edges at extrema."""
    around = [set() for _ in u]
    for a, b, c in triangles:
        around[a] |= {b, c}
        around[b] |= {a, c}
        around[c] |= {a, b}
    found = set()
    for v, others in enumerate(around):
        chosen = others if v in extreme else {min(others, key=lambda o: u[o]), max(others, key=lambda o: u[o])}
        found |= {(v, o) if u[v] < u[o] else (o, v) for o in chosen}
    return found


def solve(np, nnls, energy, fixed, values, rising, margin):
    """The least of ½ fᵀ E f with f given at the fixed vertices and rising by the margin along each edge."""
    n = len(energy)
    free = np.setdiff1d(np.arange(n), fixed)
    known = np.zeros(n)
    known[fixed] = values
    root = np.linalg.cholesky(energy[np.ix_(free, free)]).T
    best = np.linalg.solve(energy[np.ix_(free, free)], -energy[np.ix_(free, fixed)] @ values)
    rise = np.zeros((len(rising), n))
    for row, (low, high) in enumerate(rising):
        rise[row, low], rise[row, high] = -1, 1
    # y = root (x - best): least ‖y‖ with (rise root⁻¹) y ≥ margin - rise (best and known).
    at_best = known.copy()
    at_best[free] = best
    decided = [row for row, (low, high) in enumerate(rising) if low not in set(fixed) or high not in set(fixed)]
    bounds = margin - rise[decided] @ at_best
    matrix = np.linalg.solve(root.T, rise[decided][:, free].T)
    # Rows of one length, and bounds of about one: only rounding depends on them.
    lengths = np.linalg.norm(matrix, axis=0)
    matrix, bounds = matrix / lengths, bounds / lengths
    scale = np.abs(bounds).max()
    stacked = np.vstack([matrix, bounds / scale])
    target = np.zeros(len(stacked))
    target[-1] = 1
    multipliers, _ = nnls(stacked, target, maxiter=100 * len(decided))
    residual = stacked @ multipliers - target
    distance = -residual[:-1] / residual[-1] * scale
    f = known.copy()
    f[free] = best + np.linalg.solve(root, distance)
    return f


def main():
    try:
        import numpy as np
        from scipy.optimize import nnls
    except ImportError as error:
        print(f"{error}; pip install scipy")
        return 2
    with open(sys.argv[1], encoding="utf-8") as file:
        problem = json.load(file)
    vertices = np.array(problem["vertices"])
    fixed, values = np.array(problem["fixed"]), np.array(problem["values"])
    laplacian, mass = operators(np, vertices, problem["triangles"])
    energy = laplacian
    for _ in range(problem["order"] - 1):
        energy = energy @ np.diag(1 / mass) @ laplacian
    energy = 0.5 * (energy + energy.T)
    extreme = set(fixed[(values == values.min()) | (values == values.max())].tolist())
    heights = (values - values.min()) / (values.max() - values.min())
    theirs = edges(np, problem["triangles"], harmonic(np, laplacian, fixed, heights), extreme)
    ours = {tuple(edge) for edge in problem["rising"]}
    if theirs != ours:
        print(f"edges differ: {sorted(theirs ^ ours)}")
        return 1
    f = solve(np, nnls, energy, fixed, values, sorted(ours), problem["margin"])
    solution = np.array(problem["solution"])
    apart = np.abs(f - solution).max()
    # As the sums round, so that nothing is lost in a difference.
    rises = all(solution[high] >= solution[low] + problem["margin"] for low, high in ours)
    print(
        f"order {problem['order']}: {apart:.1e} apart; energies {0.5 * f @ energy @ f:.10e} and"
        f" {0.5 * solution @ energy @ solution:.10e}; ours {'rises' if rises else 'does not rise'} by {problem['margin']:.2e}"
    )
    return 0 if apart < TOLERANCE and rises else 1


if __name__ == "__main__":
    sys.exit(main())
