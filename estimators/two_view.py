"""The motion between two stereo views of the same landmarks, by RANSAC and maximum likelihood.

The landmarks' true image coordinates ``x`` in view a are unknowns beside the motion, so both views
are weighted by their own noise:

    min over T_a_b, x of  sum |s_a - x|^2 / sigma_a^2 + |s_b - g(x, T_a_b)|^2 / sigma_b^2

Each x is marginalised in closed form: the innovation ``r = s_b - g(x) - G (s_a - x)`` has the
covariance ``S = sigma_b^2 I + sigma_a^2 G G'``, and a Gauss-Newton step is a 6x6 system.

Reference:
    Matthies, Dynamic Stereo Vision (1989), ch. 4, for weighting both views; the marginalisation is
    the Schur complement of bundle adjustment (Triggs et al. 2000, sec. 6.1).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators.observation import transfer_with_jacobians
from lpet_sim.recording.arrays import Array, Ints

_CONVERGED = 1e-9
_MIN_SAMPLE = 3


@njit(cache=True)
def exp_pose(xi: Array) -> tuple[Array, Array]:
    """Map a twist (translation, rotation) to rotation and translation (`SE3.exp`, compiled)."""
    phi = xi[3:]
    angle = np.sqrt(phi @ phi)
    a, b, c = 1 - angle**2 / 6, 0.5 - angle**2 / 24, 1 / 6 - angle**2 / 120
    if angle > 1e-4:
        a, b = np.sin(angle) / angle, 2 * np.sin(angle / 2) ** 2 / angle**2
        c = (angle - np.sin(angle)) / angle**3
    K = np.array([[0.0, -phi[2], phi[1]], [phi[2], 0.0, -phi[0]], [-phi[1], phi[0], 0.0]])
    KK = K @ K
    eye = np.eye(3)
    return eye + a * K + b * KK, (eye + b * K + c * KK) @ xi[:3]


@njit(cache=True)
def innovations(
    camera: Array, R: Array, t: Array, s_a: Array, s_b: Array, var_a: Array, var_b: Array, x: Array
) -> tuple[Array, Array, Array, Array]:
    """Linearise all landmarks at ``x``.

    Returns:
        Innovations r, Shape (n, 3); the information S^-1, Shape (n, 3, 3); G, Shape (n, 3, 3);
        the derivative J of the prediction by the motion, Shape (n, 3, 6).
    """
    predicted, G, J = transfer_with_jacobians(camera, R, t, x)
    n = len(s_a)
    r, info, S = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((3, 3))
    for i in range(n):
        for a in range(3):
            r[i, a] = s_b[i, a] - predicted[i, a]
            for b in range(3):
                r[i, a] -= G[i, a, b] * (s_a[i, b] - x[i, b])
                S[a, b] = var_b[i] if a == b else 0.0
                for c in range(3):
                    S[a, b] += var_a[i] * G[i, a, c] * G[i, b, c]
        _invert_3x3(S, info[i])
    return r, info, G, J


@njit(cache=True)
def _invert_3x3(S: Array, out: Array) -> None:
    """Invert a symmetric 3x3 matrix; one that has no inverse gives zero: no information."""
    for i in range(3):
        for j in range(3):
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            out[j, i] = S[a, c] * S[b, d] - S[a, d] * S[b, c]
    determinant = S[0, 0] * out[0, 0] + S[0, 1] * out[1, 0] + S[0, 2] * out[2, 0]
    sound = determinant > 0 and np.isfinite(determinant)
    for i in range(3):
        for j in range(3):
            out[i, j] = out[i, j] / determinant if sound else 0.0


@njit(cache=True)
def solve_motion(r: Array, info: Array, J: Array, weight: Array) -> tuple[Array, Array]:
    """Give the weighted least-squares twist and its normal matrix."""
    H, g, JtW = np.zeros((6, 6)), np.zeros(6), np.empty((6, 3))
    for i in range(len(r)):
        if weight[i] <= 0:
            continue
        for a in range(6):
            for b in range(3):
                JtW[a, b] = 0.0
                for c in range(3):
                    JtW[a, b] += weight[i] * J[i, c, a] * info[i, c, b]
                g[a] += JtW[a, b] * r[i, b]
        for a in range(6):
            for b in range(6):
                for c in range(3):
                    H[a, b] += JtW[a, c] * J[i, c, b]
    for k in range(6):
        H[k, k] += 1e-12 * H[k, k] + 1e-12
    return np.asarray(np.linalg.solve(H, g)), H


@njit(cache=True)
def chi_squares(r: Array, info: Array) -> Array:
    """Give ``r' S^-1 r`` of each innovation, Shape (n,); infinite where S has no inverse."""
    out = np.zeros(len(r))
    for i in range(len(r)):
        for a in range(3):
            for b in range(3):
                out[i] += r[i, a] * info[i, a, b] * r[i, b]
        if info[i, 0, 0] <= 0 or not np.isfinite(out[i]):
            out[i] = np.inf
    return out


@njit(cache=True)
def _move_landmarks(
    x: Array, s_a: Array, var_a: Array, r: Array, info: Array, G: Array, J: Array, xi: Array
) -> None:
    """Set ``x = s_a + sigma_a^2 G' S^-1 (r - J xi)``, the landmarks given the motion, in place."""
    for i in range(len(x)):
        for b in range(3):
            x[i, b] = s_a[i, b]
        for a in range(3):
            rest = 0.0
            for c in range(3):
                left = r[i, c]
                for k in range(6):
                    left -= J[i, c, k] * xi[k]
                rest += info[i, a, c] * left
            for b in range(3):
                x[i, b] += var_a[i] * G[i, a, b] * rest


@njit(cache=True)
def refine(
    camera: Array,
    R: Array,
    t: Array,
    s_a: Array,
    s_b: Array,
    var_a: Array,
    var_b: Array,
    use: Array,
    kernel: float,
    iterations: int,
) -> tuple[Array, Array, Array]:
    """Minimise the two-view cost over the motion and the landmarks by Gauss-Newton.

    With ``kernel > 0`` each landmark is weighted as under Student's t with that many degrees of
    freedom, ``(kernel + 3) / (kernel + chi2)``; with 0 all weigh the same.

    Returns:
        Rotation, translation, and the landmarks' coordinates in view a [px], Shape (n, 3).
    """
    x = s_a.copy()
    for _ in range(iterations):
        r, info, G, J = innovations(camera, R, t, s_a, s_b, var_a, var_b, x)
        weight = use * student_weights(chi_squares(r, info), kernel)
        xi, _ = solve_motion(r, info, J, weight)
        _move_landmarks(x, s_a, var_a, r, info, G, J, xi)
        dR, dt = exp_pose(xi)
        t = t + R @ dt
        R = R @ dR
        if xi @ xi < _CONVERGED**2:
            break
    return R, t, x


@njit(cache=True)
def student_weights(chi2: Array, kernel: float) -> Array:
    """Give the weights under Student's t with ``kernel`` degrees of freedom; 0 means all one."""
    return (kernel + 3.0) / (kernel + chi2) if kernel > 0 else np.ones(len(chi2))


@njit(cache=True)
def ransac(
    camera: Array,
    R_start: Array,
    t_start: Array,
    s_a: Array,
    s_b: Array,
    var_a: Array,
    var_b: Array,
    samples: Ints,
    gate: float,
    confidence: float,
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Find the motion most landmarks agree with, from samples of three.

    The consensus of a motion is the truncated chi-square ``sum min(chi2, gate)`` (MSAC). Sampling
    ends early once a better sample is unlikely: ``(1 - share^3)^k < 1 - confidence``.

    Args:
        camera: `camera_vector`.
        R_start: Rotation to start Gauss-Newton from, Shape (3, 3).
        t_start: Translation likewise [m], Shape (3,).
        s_a: Sightings in view a [px], Shape (n, 3).
        s_b: Sightings in view b [px], Shape (n, 3).
        var_a: Their variances [px^2], Shape (n,).
        var_b: Likewise.
        samples: Rows to try, Shape (k, 3).
        gate: Chi-square (3 degrees of freedom) up to which a landmark agrees.
        confidence: Probability asked for that a sample without outliers is among those tried.

    Returns:
        Rotation, translation, and which landmarks agree, Shape (n,).

    Reference:
        Fischler and Bolles (1981); Torr and Zisserman (2000) for the truncated cost.
    """
    n = len(s_a)
    best_cost, best_R, best_t = np.inf, R_start, t_start
    best = np.zeros(n, dtype=np.bool_)
    ones = np.ones(_MIN_SAMPLE)
    for k in range(len(samples)):
        rows = samples[k]
        R, t, _ = refine(
            camera, R_start, t_start, s_a[rows], s_b[rows], var_a[rows], var_b[rows], ones, 0.0, 4
        )
        r, info, _, _ = innovations(camera, R, t, s_a, s_b, var_a, var_b, s_a)
        chi2 = chi_squares(r, info)
        cost = np.minimum(chi2, gate).sum()
        if cost < best_cost:
            best_cost, best_R, best_t, best = cost, R, t, chi2 < gate
        share = best.sum() / n
        if k > 10 and (k + 1) * np.log(1 - min(share, 0.999) ** 3) < np.log(1 - confidence):
            break
    return best_R, best_t, best


@njit(cache=True)
def influence(info: Array, G: Array, J: Array, weight: Array) -> tuple[Array, Array]:
    """Give the derivative of the estimated twist by each sighting, in view a and in view b.

    ``d xi / d s_b = H^-1 w J' S^-1`` and ``d xi / d s_a = -(d xi / d s_b) G``, each Shape
    (n, 6, 3); zero for landmarks that were not used.
    """
    n = len(weight)
    _, H = solve_motion(np.zeros((n, 3)), info, J, weight)
    H_inv = np.linalg.inv(H)
    by_a, by_b = np.zeros((n, 6, 3)), np.zeros((n, 6, 3))
    for i in range(n):
        if weight[i] > 0:
            by_b[i] = weight[i] * (H_inv @ (J[i].T @ info[i]))
            by_a[i] = -by_b[i] @ G[i]
    return by_a, by_b
