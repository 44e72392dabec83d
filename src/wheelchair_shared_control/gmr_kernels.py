"""Gaussian mixture regression for one input or many, compiled: the only hot loops of the task model.

A model is packed into one row of numbers per component, so that a call from Python hands over one array.
Inputs have 4 numbers, outputs 2. With S the covariance of a component, S_xx = L L', B = inv(L) S_xy and
z = inv(L) (x - mu_x), a component's conditional mean is mu_y + B' z, its conditional variance the diagonal
of S_yy - B' B (the Schur complement: the plus in the paper's Eq. 5 is a misprint), and its weight
log pi_k - z'z / 2 - log det L - 2 log(2 pi).
"""
import numba
import numpy as np

INPUTS, OUTPUTS = 4, 2
BLOCK = 128  # inputs at a time
# log weight, mu_x, 1 / diag(L), strictly lower L row by row, mu_y, B by output, conditional variances
WIDTH = 1 + INPUTS + INPUTS + 6 + OUTPUTS + INPUTS * OUTPUTS + OUTPUTS


def pack(weights, means, covariances):
    """The kernels' table (K, WIDTH) of a mixture: weights (K,), means (K, 6), covariances (K, 6, 6)."""
    table = np.empty((len(weights), WIDTH))
    with np.errstate(divide="ignore"):
        log_weights = np.log(weights)
    for row, log_weight, mean, covariance in zip(table, log_weights, means, covariances):
        lower = np.linalg.cholesky(covariance[:INPUTS, :INPUTS])
        cross = np.linalg.solve(lower, covariance[:INPUTS, INPUTS:])
        variances = np.diag(covariance)[INPUTS:] - (cross**2).sum(axis=0)
        constant = log_weight - np.log(np.diag(lower)).sum() - 0.5 * INPUTS * np.log(2.0 * np.pi)
        row[:] = np.concatenate(
            (
                [constant], mean[:INPUTS], 1.0 / np.diag(lower), lower[np.tril_indices(INPUTS, -1)],
                mean[INPUTS:], cross.T.reshape(-1), variances,
            )
        )
    return table


@numba.njit(cache=True, inline="always")
def _whiten(row, x0, x1, x2, x3):
    z0 = (x0 - row[1]) * row[5]
    z1 = (x1 - row[2] - row[9] * z0) * row[6]
    z2 = (x2 - row[3] - row[10] * z0 - row[11] * z1) * row[7]
    z3 = (x3 - row[4] - row[12] * z0 - row[13] * z1 - row[14] * z2) * row[8]
    return z0, z1, z2, z3


@numba.njit(cache=True)
def query(table, total, x0, x1, x2, x3):
    """Means, variances of both outputs and the input's log density: (mean_l, mean_r, var_l, var_r, log_density).

    ``total`` adds the spread of the component means to the paper's Eq. 7. One pass over the components: the
    largest log weight so far scales the sums, so that nothing under- or overflows however far x lies.
    """
    top = -np.inf
    weight_sum = 0.0
    mean_l = mean_r = within_l = within_r = between_l = between_r = 0.0
    for k in range(table.shape[0]):
        row = table[k]
        z0, z1, z2, z3 = _whiten(row, x0, x1, x2, x3)
        log_weight = row[0] - 0.5 * (z0 * z0 + z1 * z1 + z2 * z2 + z3 * z3)
        if log_weight == -np.inf:  # a component of weight 0
            continue
        if log_weight > top:
            shrink = np.exp(top - log_weight)
            weight_sum *= shrink
            within_l *= shrink
            within_r *= shrink
            between_l *= shrink
            between_r *= shrink
            top = log_weight
            weight = 1.0
        else:
            weight = np.exp(log_weight - top)
        weight_sum += weight
        within_l += weight * row[25]
        within_r += weight * row[26]
        # running mean and spread (West 1979): no difference of large squares
        share = weight / weight_sum
        step_l = row[15] + row[17] * z0 + row[18] * z1 + row[19] * z2 + row[20] * z3 - mean_l
        step_r = row[16] + row[21] * z0 + row[22] * z1 + row[23] * z2 + row[24] * z3 - mean_r
        mean_l += share * step_l
        mean_r += share * step_r
        between_l += weight * step_l * step_l * (1.0 - share)
        between_r += weight * step_r * step_r * (1.0 - share)
    if total:
        within_l += between_l
        within_r += between_r
    return mean_l, mean_r, within_l / weight_sum, within_r / weight_sum, top + np.log(weight_sum)


@numba.njit(cache=True, error_model="numpy")
def query_many(table, total, inputs, out):
    """Fill ``out`` (5, n) with mean_l, mean_r, sigma_l, sigma_r, log_density of ``inputs`` (n, 4).

    In blocks that stay in the cache, component by component, so that the arithmetic runs on vectors; the
    largest log weight of each input is known before the sums begin, and costs no exponential.
    """
    count, size = inputs.shape[0], table.shape[0]
    weights, left, right = np.empty((size, BLOCK)), np.empty((size, BLOCK)), np.empty((size, BLOCK))
    top, weight_sum = np.empty(BLOCK), np.empty(BLOCK)
    x0, x1, x2, x3 = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    for begin in range(0, count, BLOCK):
        n = min(BLOCK, count - begin)
        for i in range(n):
            x0[i], x1[i] = inputs[begin + i, 0], inputs[begin + i, 1]
            x2[i], x3[i] = inputs[begin + i, 2], inputs[begin + i, 3]
            top[i] = -np.inf
        for k in range(size):
            row = table[k]
            for i in range(n):
                z0, z1, z2, z3 = _whiten(row, x0[i], x1[i], x2[i], x3[i])
                log_weight = row[0] - 0.5 * (z0 * z0 + z1 * z1 + z2 * z2 + z3 * z3)
                weights[k, i] = log_weight
                top[i] = max(top[i], log_weight)
                left[k, i] = row[15] + row[17] * z0 + row[18] * z1 + row[19] * z2 + row[20] * z3
                right[k, i] = row[16] + row[21] * z0 + row[22] * z1 + row[23] * z2 + row[24] * z3
        weight_sum[:n] = 0.0
        for k in range(size):
            for i in range(n):
                below = weights[k, i] - top[i]
                # below -745 an exponential is 0
                weight = 1.0 if below == 0.0 else (np.exp(below) if below > -745.0 else 0.0)
                weights[k, i] = weight
                weight_sum[i] += weight
        for i in range(n):
            share = 1.0 / weight_sum[i]
            mean_l = mean_r = var_l = var_r = 0.0
            for k in range(size):
                h = weights[k, i] * share
                mean_l += h * left[k, i]
                mean_r += h * right[k, i]
                var_l += h * table[k, 25]
                var_r += h * table[k, 26]
            if total:
                for k in range(size):
                    h = weights[k, i] * share
                    var_l += h * (left[k, i] - mean_l) ** 2
                    var_r += h * (right[k, i] - mean_r) ** 2
            out[0, begin + i] = mean_l
            out[1, begin + i] = mean_r
            out[2, begin + i] = np.sqrt(var_l)
            out[3, begin + i] = np.sqrt(var_r)
            out[4, begin + i] = top[i] + np.log(weight_sum[i])


@numba.njit(cache=True)
def components(table, inputs, log_weights, means):
    """Fill ``log_weights`` (n, K), not normalised, and conditional ``means`` (n, K, 2) of ``inputs`` (n, 4)."""
    for i in range(inputs.shape[0]):
        for k in range(table.shape[0]):
            row = table[k]
            z0, z1, z2, z3 = _whiten(row, inputs[i, 0], inputs[i, 1], inputs[i, 2], inputs[i, 3])
            log_weights[i, k] = row[0] - 0.5 * (z0 * z0 + z1 * z1 + z2 * z2 + z3 * z3)
            means[i, k, 0] = row[15] + row[17] * z0 + row[18] * z1 + row[19] * z2 + row[20] * z3
            means[i, k, 1] = row[16] + row[21] * z0 + row[22] * z1 + row[23] * z2 + row[24] * z3
