"""What a Kinect makes of true depth: Gaussian noise, quantised disparity, nothing at edges and grazing faces.

``sigma_z = sigma_base + sigma_square (z - sigma_from)^2`` (Nguyen, Izadi, Lovell, 3DIMPVT 2012). No depth is
told as in REP 117 and 118: NaN invalid, +Inf nothing within range, -Inf closer than the minimum.
"""
import math

import numpy as np
from numba import njit

TABLE_SIZE = 1 << 18


class DepthNoise:
    """The noise of one sensor: its Gaussian numbers are drawn once, their order anew for every frame."""

    def __init__(self, settings, wheelchair, rng):
        """``settings``: the group ``depth_noise``; ``wheelchair``: the camera's full-size lens and range."""
        self._rng = rng
        self._table = rng.standard_normal(TABLE_SIZE, dtype=np.float32)
        camera, s = wheelchair.camera, settings
        # depth = counts / n for whole numbers n of the disparity's quantum
        counts = camera.fx * s.baseline / s.disparity_step if s.disparity_step > 0.0 else 0.0
        self._numbers = np.array([camera.min_range, camera.max_range, s.sigma_base, s.sigma_square, s.sigma_from,
                                  counts, math.cos(s.grazing), s.edge_step], dtype=np.float32)
        self._edge_pixels, self._full_width = s.edge_pixels, camera.width

    def apply(self, inverse, plane, camera):
        """Noisy depth (height, width) float32 [m] of what ``zbuffer.render`` returned for ``camera``."""
        height, width = inverse.shape
        image = np.empty((height, width), np.float32)
        offsets = self._rng.integers(0, TABLE_SIZE - width, size=height) if width < TABLE_SIZE else np.zeros(height)
        lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], dtype=np.float32)
        _measure(inverse, plane, lens, self._numbers, self._table, offsets.astype(np.int64), image)
        # a band of pixels of the full-size image; at least one in a smaller one
        band = math.ceil(self._edge_pixels * width / self._full_width) if self._edge_pixels else 0
        if band:
            _blank_edges(inverse, plane, self._numbers[7], np.float32(1.0) / self._numbers[1], band, image)
        return image


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "arcp", "nsz"})
def _measure(inverse, plane, lens, numbers, table, offsets, image):
    height, width = inverse.shape
    near, far, base, square, start = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    counts, cosine = numbers[5], numbers[6]
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    one = np.float32(1.0)
    nothing, close, invalid = np.float32(np.inf), np.float32(-np.inf), np.float32(np.nan)
    across = np.empty(width, np.float32)
    for u in range(width):
        x = (np.float32(u) - cx) / fx
        across[u] = x * x
    limit = cosine * cosine
    for v in range(height):
        y = (np.float32(v) - cy) / fy
        along = one + y * y
        row, row_plane, target = inverse[v], plane[v], image[v]
        gauss = table[offsets[v]: offsets[v] + width]
        for u in range(width):
            true = one / row[u]
            away = true - start
            z = true + (base + square * away * away) * gauss[u]
            if counts > np.float32(0.0):
                z = counts / np.rint(counts / z)
            facing = row[u] * row_plane[u]
            z = invalid if facing * facing < limit * (along + across[u]) else z
            z = close if true < near else z
            target[u] = z if true <= far else nothing


@njit(cache=True, nogil=True, error_model="numpy")
def _blank_edges(inverse, plane, step, farthest, band, image):
    """NaN within ``band`` pixels on either side of a jump in depth between two different planes.

    Planes change at few pixels: these are found eight at a time, and only there is the depth looked at.
    """
    height, width = inverse.shape
    invalid = np.float32(np.nan)
    words = (width + 7) // 8
    across, down = np.zeros(8 * words, np.uint8), np.zeros(8 * words, np.uint8)
    across_words, down_words = across.view(np.uint64), down.view(np.uint64)
    for v in range(height):
        row, row_plane = inverse[v], plane[v]
        below, below_plane = (inverse[v + 1], plane[v + 1]) if v + 1 < height else (row, row_plane)
        for u in range(width - 1):
            across[u] = row_plane[u] != row_plane[u + 1]
        for u in range(width):
            down[u] = row_plane[u] != below_plane[u]
        for word in range(words):
            if across_words[word]:
                for u in range(8 * word, 8 * word + 8):
                    if across[u] and _is_edge(row[u], row[u + 1], row_plane[u], row_plane[u + 1], step, farthest):
                        for k in range(max(0, u - band + 1), min(width, u + band + 1)):
                            image[v, k] = invalid
            if down_words[word]:
                for u in range(8 * word, 8 * word + 8):
                    if down[u] and _is_edge(row[u], below[u], row_plane[u], below_plane[u], step, farthest):
                        for k in range(max(0, v - band + 1), min(height, v + band + 1)):
                            image[k, u] = invalid


@njit(cache=True, nogil=True)
def _is_edge(a, b, plane_a, plane_b, step, farthest):
    # abs(1/a - 1/b) > step, without dividing; two that are both out of range make no edge
    return abs(a - b) > step * a * b and abs(plane_a - plane_b) > np.float32(1e-4) and max(a, b) > farthest
