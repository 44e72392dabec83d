"""The scripted teachers: competent drivers of different styles who show what a doorway allows.

The paper's teachers drove each of four scenes six times, from several starts to several exits, slowly and at a
moderate pace; slowly they used a broad range of turn rates, fast a narrow one, and beyond the door only
towards where there was room (Goil 2013, IV-C). Set "paper" shows that; its approach is plain, as the paper
says of its own (V-B). Set "full" also shows the limits of the range in the open space before the door
(note 4), and narrow and wide doors, in which teachers weave as much as the room beside the chair allows. All in the
door's frame: x along the crossing, 0 in the plane, y to the left of it.
"""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control.simulation.scenes import EXIT_GAP
from wheelchair_shared_control.values import Twist

SETS = ("paper", "full")
SCENES = ("open", "left_wall", "right_wall", "hallway")
SLOW, MODERATE = "slow", "moderate"
# sides with room beyond the door: +1 left, -1 right
FREE_SIDES = {"open": (1.0, -1.0), "left_wall": (-1.0,), "right_wall": (1.0,), "hallway": ()}


class Style(NamedTuple):
    """One teacher on one way.

    ``pace`` "slow" or "moderate", ``speed`` [m/s]; ``start`` (3,) of base_link in the door's frame; ``ends``:
    headings beyond the door swing between these two [rad]; ``first`` 0 or 1: the end they swing to first;
    ``phase`` [rad] of the weave in the doorway; ``steadiness`` scales weave and hand; ``turn_first``: turns on
    the spot before driving; ``door_width`` [m].
    """

    set_name: str
    scene: str
    pace: str
    speed: float
    start: np.ndarray
    ends: tuple
    first: int
    phase: float
    steadiness: float
    turn_first: bool
    door_width: float


def style(set_name, scene, index, settings, rng):
    """The ``Style`` of teacher ``index`` (from 0) of ``scene``; ``rng`` draws what is not laid down."""
    pace = SLOW if index % 2 == 0 else MODERATE
    own = getattr(settings, pace)
    speed = own.speed * (1.0 + settings.pace_spread * rng.uniform(-1.0, 1.0))
    distance = rng.uniform(own.start_low, own.start_high)
    offset = settings.offset * rng.uniform(-1.0, 1.0)
    # nearly towards the door's axis already: the approach is plain, whatever side it comes from
    heading = np.arctan2(-offset, settings.aim.lookahead) + settings.heading * rng.uniform(-1.0, 1.0)
    # in turn, and crosswise over the scenes: so neither side is preferred
    which = index // 2 % 3
    side = 1.0 if (index // 2 + index + SCENES.index(scene)) % 2 else -1.0
    turn_first = set_name == "full" and which == 2
    if set_name == "full":
        distance = own.range_distance * rng.uniform(0.9, 1.0)
    if turn_first:
        heading = settings.turn_first * side
    start = np.array([-distance, offset, heading])
    free = FREE_SIDES[scene]
    shown = getattr(settings, set_name)
    reach = shown.reach * rng.uniform(0.8, 1.0)
    if not free:
        ends = (0.0, 0.0)
    elif len(free) == 1:
        ends = (0.0, free[0] * reach * (1.0, 0.8, 0.6)[which])
    else:
        ends = (-reach, reach)
    first = 1 if len(free) == 1 or side > 0.0 else 0
    # a third of the teachers at each of narrowest, middle, widest; another in every scene
    wider = (which + SCENES.index(scene)) % 3 / 2.0
    door_width = shown.narrowest + wider * (shown.widest - shown.narrowest)
    return Style(
        set_name, scene, pace, speed, start, ends, first, rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.8, 1.2),
        turn_first, door_width
    )


class Teacher:
    """One teacher on the chair: ``update`` gives the stick, None once the demonstration is over."""

    def __init__(self, style, settings, rng):
        self.style, self.settings = style, settings
        self._own, self._swings = getattr(settings, style.pace), getattr(settings, style.set_name)
        self._turn, self._weave = getattr(self._swings, style.pace).turn, getattr(self._swings, style.pace).weave
        self._rng, self._noise, self._command = rng, 0.0, Twist(0.0, 0.0)
        self._swing_at, self._last, self._turning = None, None, style.turn_first

    def update(self, now, pose):
        """Stick ``Twist`` at ``now`` [s] for the pose (3,) in the door's frame, or None at the end."""
        s, style = self.settings, self.style
        x, y, yaw = pose
        end = getattr(self._swings, style.pace).end if FREE_SIDES[style.scene] else s.hallway_end
        if now > s.longest or (x > 0.0 and np.hypot(x, y) > end):
            return None
        dt = 0.0 if self._last is None else now - self._last
        self._last = now
        v = style.speed
        aim = np.arctan2(-y, s.aim.lookahead)
        if self._turning and abs(aim - yaw) > 0.2:
            v, w = 0.0, float(np.clip(2.0 * (aim - yaw), -self._turn, self._turn))
        elif style.set_name == "full" and x < -self._own.range_end:
            self._turning = False
            far = np.arctan2(-y, 2.0 * s.aim.lookahead)
            w = self._swing(now, yaw, (far - s.range_reach, far + s.range_reach))
        elif x < s.exit_begin or style.ends == (0.0, 0.0):
            self._turning, self._swing_at = False, None
            w = self._cross(now, x, aim - yaw)
        else:
            w = self._swing(now, yaw, style.ends)
        return self._stick(dt, v, w)

    def _cross(self, now, x, off):
        """To the door's axis and along it; a weave of small turns once the front is between the jambs."""
        s, style = self.settings, self.style
        w = s.aim.gain * off * max(1.0, style.speed / 0.25)
        chair = s.wheelchair.footprint
        if x + chair.length - chair.axle_to_rear > -0.3:
            weave = self._weave
            if style.set_name == "full":
                weave *= self._room_beside(x) / s.weave_room
            w += weave * style.steadiness * np.sin(2.0 * np.pi * now / s.weave_period + style.phase)
        return w

    def _room_beside(self, x):
        """Room [m] on each side of a chair on the door's axis at ``x``: between the jambs, then between the walls."""
        between = self.style.door_width
        if self.style.scene == "hallway" and x > self.settings.hallway_begin:
            between += 2.0 * EXIT_GAP
        return 0.5 * (between - self.settings.wheelchair.footprint.width)

    def _swing(self, now, yaw, ends):
        """Turn rate [rad/s] of swings between two headings, each of its own size and haste.

        Where there is room the limits of the range are shown (note 4); between two swings the chair goes straight.
        """
        s = self._swings
        if self._swing_at is None or now - self._swing_at[0] >= s.time:
            end = self.style.first if self._swing_at is None else 1 - self._swing_at[1]
            size, haste = self._rng.uniform(s.least, 1.0), self._rng.uniform(s.slowest, 1.0)
            middle = 0.5 * (ends[0] + ends[1])
            # the end at the wall is kept to: only the open side is drawn
            target = ends[end] if ends[end] == 0.0 else middle + size * (ends[end] - middle)
            self._swing_at = (now, end, target - middle, haste * self._turn)
        _, _, target, turn = self._swing_at
        return float(np.clip(s.gain * (0.5 * (ends[0] + ends[1]) + target - yaw), -turn, turn))

    def _stick(self, dt, v, w):
        """The command (v, w) as a hand gives it: unsteady, and not at once."""
        s, limits = self.settings, self.settings.wheelchair.limits
        keep = np.exp(-dt / s.hand.time)
        spread = s.hand.noise * self.style.steadiness
        self._noise = keep * self._noise + np.sqrt(1.0 - keep * keep) * spread * self._rng.standard_normal()
        wanted = float(np.clip(w + self._noise, -limits.turn_rate, limits.turn_rate))
        before = self._command
        self._command = Twist(
            before.v + float(np.clip(v - before.v, -limits.acceleration * dt, limits.acceleration * dt)),
            before.w + float(np.clip(wanted - before.w, -s.aim.slew * dt, s.aim.slew * dt)),
        )
        return self._command
