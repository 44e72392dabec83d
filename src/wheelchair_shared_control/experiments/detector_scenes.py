"""Random scenes for the detector's error table: doors as a chair meets them, and what is mistaken for a door.

The wall with the door stands along y at x = 0, its middle in that plane; the sensor looks from x < 0.
"""
from typing import NamedTuple, Tuple

import numpy as np

WALL_HEIGHT = 2.5
DOOR_HEIGHT = 2.0
BEYOND = ("open", "left_wall", "right_wall", "hallway", "room")
POSITIVE = ("plain", "plain", "plain", "two_in_wall", "two_walls", "recessed", "leaf_in_room", "leaf_beyond",
            "furniture", "hallway_end")
NEGATIVE = ("closed", "half_closed", "furniture_gap", "wall_end", "window", "blind")


class Opening(NamedTuple):
    """An open doorway: ``pose`` (3,) of the gap's middle in the middle of the wall, yaw the crossing direction,
    clear ``width`` [m]; ``jambs`` (2, 2) front edges on the sensor's side."""

    pose: np.ndarray
    width: float
    jambs: np.ndarray


class DetectorScene(NamedTuple):
    """``boxes`` (n, 7) as in ``World``, ``base`` (3,) pose of base_link, ``openings`` all open doorways; the first
    one is the one that the scene is about. ``distance`` [m] and ``angle`` [rad] are the camera's to it."""

    kind: str
    boxes: np.ndarray
    base: np.ndarray
    openings: Tuple[Opening, ...]
    distance: float
    angle: float


def draw(rng, kind, camera_x, width=None):
    """One scene of ``kind``; ``camera_x`` [m] is the camera's place ahead of ``base_link``. None if the draw does
    not fit the room; ask again."""
    width = float(rng.uniform(0.75, 1.2)) if width is None else float(width)
    thickness = 0.12 if rng.random() < 0.7 else float(rng.uniform(0.08, 0.25))
    distance = float(rng.uniform(1.2, 4.0))
    angle = float(np.radians(rng.uniform(-60.0, 60.0)))
    eye = np.array([-distance * np.cos(angle), -distance * np.sin(angle)])
    # the room before the wall: 5 m deep, 6 m wide, the door anywhere in its wall, the chair inside
    low = rng.uniform(-6.0 + width / 2 + 0.3, -width / 2 - 0.3)
    high = low + 6.0
    if kind == "hallway_end":
        low, high = -rng.uniform(0.8, 1.2), rng.uniform(0.8, 1.2)
    if not low + 0.35 < eye[1] < high - 0.35:
        return None
    look = float(np.arctan2(-eye[1], -eye[0]) + np.radians(rng.uniform(-18.0, 18.0)))
    boxes = []
    room = _Room(boxes, low, high, thickness)
    openings = []
    half = width / 2.0
    gaps = [(-half, half)]
    front = -thickness / 2.0

    def opening(left, right, plane=0.0, face=front):
        return Opening(np.array([plane, (left + right) / 2.0, 0.0]), right - left,
                       np.array([[face, right], [face, left]]))

    if kind in ("plain", "furniture", "leaf_in_room", "leaf_beyond", "hallway_end", "two_walls", "two_in_wall"):
        openings.append(opening(-half, half))
    if kind == "two_in_wall":
        second = float(rng.uniform(0.75, 1.2))
        pier = float(rng.uniform(0.3, 1.5))
        start = half + pier if rng.random() < 0.5 else -half - pier - second
        if not (low + 0.2 < start and start + second < high - 0.2):
            return None
        gaps.append((start, start + second))
        openings.append(opening(start, start + second))
    if kind == "recessed":
        # the frame stands back in a niche, and is narrower than it
        inset, back = float(rng.uniform(0.02, 0.12)), float(rng.uniform(0.05, 0.15))
        gaps = [(-half - inset, half + inset)]
        for side in (-1.0, 1.0):
            boxes.append([back, side * (half + inset / 2.0), DOOR_HEIGHT / 2.0, 0.0, thickness / 2.0, inset / 2.0,
                          DOOR_HEIGHT / 2.0])
        openings.append(opening(-half, half, plane=back, face=back - thickness / 2.0))
    side_door = None
    if kind == "two_walls":
        side_door = float(rng.uniform(-3.5, -1.2))
    if kind == "window":
        sill = float(rng.uniform(0.5, 1.1))
        room.fill(-half, half, 0.0, sill)
    if kind == "wall_end":
        # the room's side wall is farther off than the widest door
        if not (high + half > 1.6 and half - low > 1.6):
            return None
        gaps = [(-half, high + 3.0)] if rng.random() < 0.5 else [(low - 3.0, half)]
    if kind == "blind":
        gaps = []
    if kind == "furniture_gap":
        gaps = []
        depth, top = float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.8, 2.1))
        near = float(rng.uniform(0.0, 1.0)) if rng.random() < 0.3 else 0.0
        for side in (-1.0, 1.0):
            length = float(rng.uniform(0.4, 1.2))
            boxes.append([front - near - depth / 2.0, side * (half + length / 2.0), top / 2.0, 0.0, depth / 2.0,
                          length / 2.0, top / 2.0])
    if kind in ("closed", "half_closed"):
        turn = 0.0 if kind == "closed" else float(np.radians(rng.uniform(15.0, 60.0)))
        recess = float(rng.uniform(-thickness / 2.0 + 0.02, thickness / 2.0 - 0.02))
        leaf = _leaf(rng, half, width, recess, turn, 1.0 if rng.random() < 0.5 else -1.0)
        if is_edge_on(leaf, eye):
            return None
        boxes.append(leaf)
    if kind == "leaf_in_room":
        boxes.append(_leaf(rng, half, width, front, float(np.radians(rng.uniform(95.0, 175.0))), -1.0, beside=True))
    if kind == "leaf_beyond":
        boxes.append(_leaf(rng, half, width, -front, float(np.radians(rng.uniform(92.0, 175.0))), 1.0, beside=True))
    room.wall(gaps)
    room.sides(side_door, openings, eye)
    # a wall along the normal beside the end of a wall would make an opening of it
    room.beyond(str(rng.choice(BEYOND[:1] + BEYOND[-1:] if kind == "wall_end" else BEYOND)), half, rng)
    if kind == "furniture":
        # cupboards and shelves along the wall, clear of the jambs
        for side in (-1.0, 1.0):
            start = half + float(rng.uniform(0.15, 0.5))
            length, depth, top = rng.uniform(0.4, 1.2), rng.uniform(0.25, 0.5), rng.uniform(0.7, 2.0)
            boxes.append([front - depth / 2.0, side * (start + length / 2.0), top / 2.0, 0.0, depth / 2.0,
                          length / 2.0, top / 2.0])
    for _ in range(int(rng.integers(3, 7)) if rng.random() < 0.7 else 0):
        room.clutter(rng, eye, half)
    base = np.array([eye[0] - camera_x * np.cos(look), eye[1] - camera_x * np.sin(look), look])
    if kind not in NEGATIVE and not in_view(openings[0], eye, look):
        return None
    return DetectorScene(kind, np.array(boxes), base, tuple(openings), distance, angle)


def in_view(opening, eye, look, half_view=np.radians(28.0), beside=0.10):
    """Are both jambs, and ``beside`` [m] of wall at each, within the camera's view from ``eye`` (2,)?"""
    left, right = opening.jambs
    along = (left - right) / np.linalg.norm(left - right)
    for point in (left + beside * along, right - beside * along):
        bearing = np.arctan2(point[1] - eye[1], point[0] - eye[0]) - look
        if abs((bearing + np.pi) % (2.0 * np.pi) - np.pi) > half_view:
            return False
    return True


def is_edge_on(leaf, eye, limit=np.radians(12.0)):
    """Is a leaf (row of boxes) seen so flat from ``eye`` (2,) that a depth camera has no reading of its face?

    Beyond 80 degrees of incidence the sensor tells nothing; such a door cannot be told from an open one.
    """
    along = np.array([np.cos(leaf[3]), np.sin(leaf[3])])
    ray = np.asarray(leaf[:2]) - eye
    return bool(abs(along[0] * ray[1] - along[1] * ray[0]) < np.sin(limit) * np.hypot(*ray))


def beside_jambs(opening, beside=0.05):
    """Points (2, 2) on the wall's front ``beside`` [m] beside the left and the right jamb."""
    left, right = opening.jambs
    along = (left - right) / np.linalg.norm(left - right)
    return np.array([left + beside * along, right - beside * along])


def _leaf(rng, half, width, plane, turn, away, beside=False):
    """A door leaf hinged at one jamb, turned by ``turn`` [rad] from shut, ``away`` 1 beyond or -1 towards."""
    hinge_side = 1.0 if rng.random() < 0.5 else -1.0
    thick = 0.04
    hinge = np.array([plane, hinge_side * (half + (0.03 if beside else 0.0))])
    direction = np.array([away * np.sin(turn), -hinge_side * np.cos(turn)])
    centre = hinge + direction * width / 2.0
    return [centre[0], centre[1], DOOR_HEIGHT / 2.0, float(np.arctan2(direction[1], direction[0])), width / 2.0,
            thick / 2.0, DOOR_HEIGHT / 2.0]


class _Room:
    """Adds walls to a list of boxes."""

    def __init__(self, boxes, low, high, thickness):
        self.boxes, self.low, self.high, self.thickness = boxes, low, high, thickness

    def fill(self, left, right, bottom, top, x=0.0):
        self.boxes.append([x, (left + right) / 2.0, (bottom + top) / 2.0, 0.0, self.thickness / 2.0,
                           (right - left) / 2.0, (top - bottom) / 2.0])

    def wall(self, gaps):
        at = self.low - 0.2
        end = self.high + 0.2
        for left, right in sorted(gaps):
            if left > at:
                self.fill(at, left, 0.0, WALL_HEIGHT)
            if left > self.low - 1.0 and right < self.high + 1.0:
                self.fill(left, right, DOOR_HEIGHT, WALL_HEIGHT)
            at = right
        if at < end:
            self.fill(at, end, 0.0, WALL_HEIGHT)

    def sides(self, side_door, openings, eye):
        t = self.thickness / 2.0
        for y, sign in ((self.low, -1.0), (self.high, 1.0)):
            middle = y + sign * t
            if side_door is not None and sign > 0:
                a, b = side_door - 0.45, side_door + 0.45
                self.boxes.append([(b + 0.0) / 2.0, middle, 1.25, 0.0, -b / 2.0, t, 1.25])
                self.boxes.append([(a - 5.0) / 2.0, middle, 1.25, 0.0, (a + 5.0) / 2.0, t, 1.25])
                self.boxes.append([side_door, middle, 2.25, 0.0, 0.45, t, 0.25])
                openings.append(Opening(np.array([side_door, middle, np.pi / 2.0]), 0.9,
                                        np.array([[a, y], [b, y]])))
            else:
                self.boxes.append([-2.5, middle, 1.25, 0.0, 2.5, t, 1.25])

    def beyond(self, kind, half, rng):
        length = 4.0
        start = self.thickness / 2.0
        if kind in ("left_wall", "hallway"):
            self.boxes.append([start + length / 2.0, half + 0.15 + 0.06, 1.25, 0.0, length / 2.0, 0.06, 1.25])
        if kind in ("right_wall", "hallway"):
            self.boxes.append([start + length / 2.0, -half - 0.15 - 0.06, 1.25, 0.0, length / 2.0, 0.06, 1.25])
        if kind == "room":
            self.boxes.append([start + rng.uniform(1.2, 4.0), 0.0, 1.25, 0.0, 0.06, 4.0, 1.25])

    def clutter(self, rng, eye, half):
        size = rng.uniform(0.2, 0.6, 3)
        for _ in range(20):
            x, y = rng.uniform(-4.5, 2.0), rng.uniform(self.low + 0.3, self.high - 0.3)
            # nothing in the door volume, nor half a metre before or behind it
            if abs(x) < 0.9 and abs(y) < half + 0.4:
                continue
            if np.hypot(x - eye[0], y - eye[1]) < 0.85:
                continue
            if abs(x) < 0.4 and not self.low < y < self.high:
                continue
            self.boxes.append([x, y, size[2] / 2.0, rng.uniform(-np.pi, np.pi), size[0] / 2.0, size[1] / 2.0,
                               size[2] / 2.0])
            return
