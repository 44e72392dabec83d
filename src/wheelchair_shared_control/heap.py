"""A binary heap in two arrays, for compiled searches: ``keys`` with the lowest first, and what belongs to each.

The arrays are the caller's, long enough for all that is pushed; ``size`` says how much of them is the heap.
"""
from numba import njit


@njit(cache=True)
def push(keys, items, size, key, item):
    """Put ``item`` under ``key`` on the heap; returns its new size."""
    i = size
    while i > 0:
        p = (i - 1) >> 1
        if keys[p] <= key:
            break
        keys[i], items[i] = keys[p], items[p]
        i = p
    keys[i], items[i] = key, item
    return size + 1


@njit(cache=True)
def pop(keys, items, size):
    """Take the item with the lowest key, which is ``keys[0]`` before, off the heap: (item, new size)."""
    item = items[0]
    size -= 1
    key, last = keys[size], items[size]
    i = 0
    while True:
        c = 2 * i + 1
        if c >= size:
            break
        if c + 1 < size and keys[c + 1] < keys[c]:
            c += 1
        if keys[c] >= key:
            break
        keys[i], items[i] = keys[c], items[c]
        i = c
    keys[i], items[i] = key, last
    return item, size
