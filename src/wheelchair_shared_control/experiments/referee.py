"""When an episode is over, and how it ended."""
from typing import NamedTuple, Optional

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.assistance import ARRIVED, FAULT
from wheelchair_shared_control.experiments import metrics

OUTCOMES = ("crossed", "contact", "refused", "standstill", "timeout", "no_start")
# A chair that moves less than this is standing: castor jitter and a twitch of the stick are no motion.
STANDING_DISTANCE = 0.03  # m
STANDING_TURN = 0.05  # rad


class Verdict(NamedTuple):
    """``outcome`` is one of OUTCOMES, ``reason`` says it in words."""

    outcome: str
    reason: str


class Referee:
    """Watches the truth of one episode.

    ``door_pose`` (3,) in world, yaw in the direction of the crossing. ``needs_planner`` says whether the policy
    stops being itself without assistance: then a refused assistance is the end.
    """

    def __init__(self, door_pose, footprint, needs_planner):
        self._door_from_world = se2.inverse(door_pose)
        self._footprint = footprint
        self._needs_planner = needs_planner
        self._start = None
        self._anchor, self._anchor_time = None, 0.0

    def update(self, now, pose, touched, assistance_state, refusal) -> Optional[Verdict]:
        """Verdict, or None while the episode goes on.

        ``pose`` (3,) of ``base_link`` in world; ``touched`` names the bodies that the chair touches now;
        ``refusal`` is why the assistance was refused or failed, empty while it was not.
        """
        pose = np.asarray(pose, float)
        if self._start is None:
            self._start, self._anchor, self._anchor_time = now, pose, now
        if touched:
            return Verdict("contact", "touched " + ", ".join(sorted(set(touched))))
        if assistance_state == ARRIVED:
            return Verdict("crossed", "goal reached")
        rearmost, _ = metrics.along_door(None, self._footprint, se2.compose(self._door_from_world, pose))
        if rearmost >= metrics.PAST_THE_DOOR:
            return Verdict("crossed", "rear %.2f m past the door" % rearmost)
        if self._needs_planner and (refusal or assistance_state == FAULT):
            return Verdict("refused", refusal or "fault")
        return self._out_of_time(now, pose)

    def _out_of_time(self, now, pose):
        moved = np.hypot(*(pose[:2] - self._anchor[:2]))
        turned = abs(se2.wrap_angle(pose[2] - self._anchor[2]))
        if moved > STANDING_DISTANCE or turned > STANDING_TURN:
            self._anchor, self._anchor_time = pose, now
        # the clock of a simulation is a sum of steps: without slack, 8 s may come one tick late
        if now - self._anchor_time >= metrics.STANDSTILL - 1e-6:
            return Verdict("standstill", "stood for %g s" % metrics.STANDSTILL)
        if now - self._start >= metrics.TIME_LIMIT - 1e-6:
            return Verdict("timeout", "not across after %g s" % metrics.TIME_LIMIT)
        return None
