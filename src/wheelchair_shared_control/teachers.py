"""The scripted teachers: competent drivers of different styles who show what a doorway allows.

The paper's teachers drove each of four scenes six times, from several starts to several exits, slowly and at a
moderate pace; slowly they used a broad range of turn rates, fast a narrow one, and beyond the door only
towards where there was room (Goil 2013, IV-C). Set "paper" shows that; its approach is plain, as the paper
says of its own (V-B). Set "full" also shows the limits of the range in the open space before the door
(note 4). All in the door's frame: x along the crossing, 0 in the plane, y to the left of it.
"""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control.values import Twist

SETS = ("paper", "full")
SLOW, MODERATE = "slow", "moderate"
# sides with room beyond the door: +1 left, -1 right
FREE_SIDES = {"open": (1.0, -1.0), "left_wall": (-1.0,), "right_wall": (1.0,), "hallway": ()}


class Style(NamedTuple):
    """One teacher on one way.

    ``pace`` "slow" or "moderate", ``speed`` [m/s]; ``start`` (3,) of base_link in the door's frame; ``swing``:
    headings beyond the door swing between ``swing[0]`` and ``swing[1]`` [rad]; ``period`` [s]; ``phases`` (3,)
    of the swings before the door, in it and beyond [rad]; ``steadiness`` scales weave and hand.
    """

    set_name: str
    scene: str
    pace: str
    speed: float
    start: np.ndarray
    swing: tuple
    period: float
    phases: np.ndarray
    steadiness: float


def style(set_name, scene, index, settings, rng):
    """The ``Style`` of teacher ``index`` (from 0) of ``scene``; ``rng`` draws what is not laid down."""
    pace = SLOW if index % 2 == 0 else MODERATE
    speed = getattr(settings, pace) * (1.0 + settings.pace_spread * rng.uniform(-1.0, 1.0))
    way = settings.start
    distance = rng.uniform(way.distance_low, way.distance_high)
    if set_name == "full":
        distance = settings.range.distance * rng.uniform(0.9, 1.0)
    start = np.array([-distance, way.offset * rng.uniform(-1.0, 1.0), way.heading * rng.uniform(-1.0, 1.0)])
    free = FREE_SIDES[scene]
    reach = settings.exit.swing * rng.uniform(0.8, 1.0)
    # in turn: to one side and back, to the other, a little of both
    which = index // 2 % 3
    if not free:
        swing = (0.0, 0.0)
    elif len(free) == 1:
        swing = (0.0, free[0] * reach * (1.0, 0.7, 0.4)[which])
    else:
        swing = ((0.0, reach), (0.0, -reach), (-0.6 * reach, 0.6 * reach))[which]
    if set_name == "full" and index % 2:
        swing = tuple(-angle for angle in swing) if len(free) == 2 else swing
    return Style(
        set_name, scene, pace, speed, start, swing, settings.exit.period * rng.uniform(0.8, 1.2),
        rng.uniform(0.0, 2.0 * np.pi, 3), rng.uniform(0.8, 1.2),
    )


class Teacher:
    """One teacher on the chair: ``update`` gives the stick, None once the demonstration is over."""

    def __init__(self, style, settings, rng):
        self.style, self.settings = style, settings
        self._rng, self._noise, self._w, self._v = rng, 0.0, 0.0, 0.0
        self._since, self._last = {}, None

    def update(self, now, pose):
        """Stick ``Twist`` at ``now`` [s] for the pose (3,) in the door's frame, or None at the end."""
        s, style = self.settings, self.style
        x, y, yaw = pose
        if now > s.longest or (x > 0.0 and np.hypot(x, y) > s.exit.end):
            return None
        dt = 0.0 if self._last is None else now - self._last
        self._last = now
        if style.set_name == "full" and x < -s.range.nearest:
            w = self._show_range(now, pose)
        elif x < s.exit.begin:
            w = self._cross(now, pose)
        else:
            w = self._leave(now, pose)
        keep = np.exp(-dt / s.hand.time)
        spread = s.hand.noise * style.steadiness
        self._noise = keep * self._noise + np.sqrt(1.0 - keep * keep) * spread * self._rng.standard_normal()
        limits = s.wheelchair.limits
        wanted = float(np.clip(w + self._noise, -limits.turn_rate, limits.turn_rate))
        self._w += float(np.clip(wanted - self._w, -s.aim.slew * dt, s.aim.slew * dt))
        self._v += float(np.clip(style.speed - self._v, -limits.acceleration * dt, limits.acceleration * dt))
        return Twist(self._v, self._w)

    def _cross(self, now, pose):
        """To the door's axis and along it; a weave of small turns once the front is between the jambs."""
        x, y, yaw = pose
        s, style = self.settings, self.style
        aim = np.arctan2(-y, s.aim.lookahead)
        w = s.aim.gain * (aim - yaw) * max(1.0, style.speed / 0.25)
        chair = s.wheelchair.footprint
        if x + chair.length - chair.axle_to_rear > -0.3:
            weave = s.doorway.weave_slow if style.pace == SLOW else s.doorway.weave_moderate
            w += weave * style.steadiness * np.sin(2.0 * np.pi * now / s.doorway.period + style.phases[1])
        return w

    def _leave(self, now, pose):
        """Swing between the style's headings, where there is room; weave along a hallway."""
        s, style = self.settings, self.style
        if style.swing == (0.0, 0.0):
            return self._cross(now, pose)
        return self._swing("exit", now, pose[2], style.swing, style.period, style.phases[2], self._turn(s.exit))

    def _show_range(self, now, pose):
        """The limits of the range in the open: swings about the way to the door."""
        s, style = self.settings, self.style
        aim = np.arctan2(-pose[1], 2.0 * s.aim.lookahead)
        swing = (aim - s.range.swing, aim + s.range.swing)
        return self._swing("range", now, pose[2], swing, s.range.period, style.phases[0], self._turn(s.range))

    def _turn(self, group):
        return group.turn_slow if self.style.pace == SLOW else group.turn_moderate

    def _swing(self, name, now, yaw, ends, period, phase, turn):
        """Turn rate [rad/s] towards a heading that swings between ``ends``, at most ``turn``."""
        began = self._since.setdefault(name, (now, yaw))[0]
        share = 0.5 - 0.5 * np.cos(2.0 * np.pi * (now - began) / period)
        if name == "range" and phase > np.pi:
            share = 1.0 - share
        heading = ends[0] + share * (ends[1] - ends[0])
        return float(np.clip(2.0 * (heading - yaw), -turn, turn))
