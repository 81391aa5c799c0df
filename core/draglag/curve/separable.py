"""Separable least squares for L(v): a grid over shapes, as a single start can fail."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np

from draglag.curve.forms import Form
from draglag.curve.points import CurvePoints
from draglag.recording import FloatArray

DAMPING = np.array([1e-9, 1e-2, 0.1, 1.0, 10.0])
NEAR = 5e-4  # a step this small of a logarithm leaves an error of its square


def _columns(form: Form, theta: FloatArray, points: CurvePoints) -> FloatArray:
    parts = [form.columns(theta, speed) for speed in points.speeds_mm_s]
    return np.asarray(parts[0] if len(parts) == 1 else 0.5 * (parts[0] + parts[1]))


def _weighted(weight: FloatArray, values: FloatArray) -> FloatArray:
    """Values (…, n, p) times weights (n,), or times a matrix (k, n)."""
    return np.asarray(weight @ values if weight.ndim == 2 else weight[:, None] * values)


def evaluated_ms(form: Form, values: FloatArray, speed: FloatArray) -> FloatArray:
    k = len(form.shape_names)
    return np.asarray(form.columns(values[None, :k], speed)[0] @ values[k:])


def shown_s(form: Form, values: FloatArray, points: CurvePoints) -> FloatArray:
    """Latency the curve gives each run."""
    return np.asarray(1e-3 * np.mean([evaluated_ms(form, values, speed) for speed in points.speeds_mm_s], axis=0))


def slope_s_per_mm_s(form: Form, values: FloatArray, speed: FloatArray) -> FloatArray:
    """dL/dv at each speed."""
    step = np.maximum(0.01 * speed, 0.1)
    return np.asarray(
        1e-3 * (evaluated_ms(form, values, speed + step) - evaluated_ms(form, values, speed - step)) / (2 * step)
    )


def jacobian_ms(form: Form, values: FloatArray, speed: FloatArray) -> FloatArray:
    k = len(form.shape_names)
    out = np.empty((speed.size, values.size))
    out[:, k:] = form.columns(values[None, :k], speed)[0]
    for j in range(k):
        step = 1e-4 * max(abs(values[j]), 1e-6)
        up, down = values.copy(), values.copy()
        up[j] += step
        down[j] -= step
        out[:, j] = (evaluated_ms(form, up, speed) - evaluated_ms(form, down, speed)) / (2 * step)
    return out


def solved(
    form: Form, points: CurvePoints, weight: FloatArray, tied_s: float | None, start: FloatArray | None
) -> FloatArray:
    """Best values over the grid (or from a start), polished.

    weight: of each point (n,), 1/s; or (k, n) of what whitens correlated points.
    """
    weight = 1e-3 * weight
    target = _weighted(weight, 1e3 * points.latency_s[:, None])[:, 0]
    k = len(form.shape_names)

    def at(theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        columns = _weighted(weight, _columns(form, theta, points))
        cost, amplitude = _non_negative(columns, target, tied_s)
        return cost, amplitude, (columns @ amplitude[:, :, None])[:, :, 0] - target

    if start is None:
        cost, amplitude, _ = at(form.grid)
        best = int(np.argmin(cost))
        start = np.concatenate([form.grid[best], amplitude[best]])
    # Amplitudes are eliminated (variable projection): the polish moves the shapes only.
    theta = start[:k]
    if k:
        theta = _polished(np.log(np.clip(theta, form.lower, form.upper)), form, lambda log_theta: at(np.exp(log_theta)))
    if k >= 2 and theta[0] > theta[1]:
        theta[:2] = theta[1::-1]
    return np.concatenate([theta, at(theta[None])[1][0]])


Tried = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]


def _polished(log_theta: FloatArray, form: Form, at: Tried) -> FloatArray:
    k = log_theta.size
    low, high = np.log(form.lower), np.log(form.upper)
    h = 1e-4
    around = h * np.concatenate([np.zeros((1, k)), np.eye(k), -np.eye(k)])
    for _ in range(12):
        cost, _, residual = at(log_theta + around)
        jacobian = (residual[1 : k + 1] - residual[k + 1 :]).T / (2 * h)
        normal, moment = jacobian.T @ jacobian, jacobian.T @ residual[0]
        damped = normal + DAMPING[:, None, None] * (np.diag(normal) + 1e-12)[:, None] * np.eye(k)
        step = -np.linalg.solve(damped, np.broadcast_to(moment[:, None], (DAMPING.size, k, 1)))[:, :, 0]
        tried = np.clip(log_theta + np.clip(step, -0.7, 0.7), low, high)
        costs = at(tried)[0]
        best = int(np.argmin(costs))
        if not costs[best] < cost[0]:
            break
        moved = float(np.abs(tried[best] - log_theta).max())
        log_theta = tried[best]
        if cost[0] - costs[best] < 1e-7 * cost[0] or moved < NEAR:
            break
    return np.asarray(np.exp(log_theta))


def _non_negative(columns: FloatArray, target: FloatArray, tied_s: float | None) -> tuple[FloatArray, FloatArray]:
    """Non-negative least squares by every active set, exact for at most three columns."""
    g, _, p = columns.shape
    fixed = 0.0
    free = p
    if tied_s is not None:
        fixed = 1e3 * tied_s
        free = p - 1
        target = target[None, :] - fixed * columns[:, :, -1]
    else:
        target = np.broadcast_to(target, (g, target.size))
    gram = np.swapaxes(columns[:, :, :free], 1, 2) @ columns[:, :, :free]
    moment = np.einsum("gnp,gn->gp", columns[:, :, :free], target)
    total = np.einsum("gn,gn->g", target, target)
    ridge = 1e-12 * np.einsum("gpp->g", gram)[:, None, None]
    best = np.linalg.solve(gram + ridge * np.eye(free), moment[:, :, None])[:, :, 0]
    best_cost = total - (best * moment).sum(1)
    # Where nothing is negative with all columns, that is the best there is.
    todo = np.flatnonzero((best < 0).any(1))
    best_cost[todo] = total[todo]
    best[todo] = 0.0
    for size in range(free - 1, 0, -1) if todo.size else ():
        for active in combinations(range(free), size):
            pick = np.array(active)
            sub = gram[todo[:, None, None], pick[:, None], pick]
            sub = sub + 1e-12 * np.trace(sub, axis1=1, axis2=2)[:, None, None] * np.eye(size)
            wanted = moment[todo[:, None], pick]
            amplitude = np.linalg.solve(sub, wanted[:, :, None])[:, :, 0]
            cost = total[todo] - (amplitude * wanted).sum(1)
            allowed = (amplitude >= 0).all(1)
            better = allowed & (cost < best_cost[todo])
            rows = todo[better]
            best_cost[rows] = cost[better]
            best[rows] = 0.0
            best[rows[:, None], pick] = amplitude[better]
    if tied_s is not None:
        best = np.column_stack([best, np.full(g, fixed)])
    return best_cost, best
