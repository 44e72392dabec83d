"""The way that a competent person takes to a door and through it, and the stick that keeps to it.

All in the door's frame: x along the crossing, 0 in the plane; y to the left of it; metres, radians. The last leg
lies on the door's axis and begins at least ``drive/square`` before the plane.
"""
import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.assistance import ASSISTING
from wheelchair_shared_control.ground import from_world, room
from wheelchair_shared_control.person import along_leg, turn_on_the_spot
from wheelchair_shared_control.values import STOP, Twist
from wheelchair_shared_control.way_plan import MARGIN, Leg, plan, settles


class Way:
    """Path and progress of ``goal_directed``; ``steer`` plans when first asked, and anew where it has been led off."""

    def __init__(self, settings, chair, door_pose_world, world=None):
        self.settings, self.chair = settings, chair
        self._ground = None if world is None else from_world(world, door_pose_world)
        self.half_gap = None if world is None else self._ground.half_gap
        self._legs, self._turning, self._planned = [], False, False
        self._moved, self._moved_at = None, None
        self._backing = False

    @property
    def legs(self):
        """Legs still ahead, for figures."""
        return tuple(self._legs)

    def turn_to(self, now, pose, twist, error):
        """Stick that turns the chair by ``error`` [rad] on the spot; along the way first where walls forbid that."""
        if self._ground is not None and abs(error) > 0.1:
            yaws = pose[2] + np.linspace(0.0, error, 2 + int(abs(error) / 0.1))
            poses = np.column_stack((np.full_like(yaws, pose[0]), np.full_like(yaws, pose[1]), yaws))
            if room(self._ground, self.chair, poses[1:]).min() < 0.5 * self.settings.plan.minimum:
                return self.steer(now, pose, twist)
        return Twist(0.0, turn_on_the_spot(error, self.settings))

    def steer(self, now, pose, twist, assistance_state=0):
        """Stick ``Twist`` at a believed pose (3,) and velocity."""
        if not self._planned or self._led_off(pose):
            self._legs, self._planned = self._plan(pose), True
            self._begin_leg(pose)
        self._advance(pose)
        if not self._legs:
            return STOP
        if assistance_state != ASSISTING and self._stuck(now, pose):
            self._back_off(pose)
        elif not self._backing and self._misses_gap(pose):
            self._back_off(pose)
        leg = self._legs[0]
        command, self._turning = along_leg(pose, leg, self._speed(pose, leg), self._turning, self.settings)
        if self._turning and not self._may_turn(pose):
            # In the gap there is no room to turn on the spot: creep on and let the path's pull do it.
            command = Twist(0.4 * self.settings.drive.careful, command.w)
        self._note_motion(now, pose, command)
        return command

    # ---- plan --------------------------------------------------------------------------------------

    def _plan(self, pose):
        legs = plan(pose, self.settings, self.chair, self._ground)
        self.end = legs[-1].end
        return legs

    def _led_off(self, pose):
        """Whether the chair is no longer near the leg ahead (another hand has steered it)."""
        if not self._legs or pose[0] > -self.settings.drive.square:
            return False
        leg = self._legs[0]
        direction = leg.direction
        offset = pose[:2] - leg.start
        return abs(direction[0] * offset[1] - direction[1] * offset[0]) > 0.3

    def _advance(self, pose):
        """Drop the leg ahead once its end is reached, or passed, or near enough to round a slight corner."""
        while self._legs:
            leg = self._legs[0]
            direction = leg.direction
            left = float(direction @ (leg.end - pose[:2]))
            if left > self._rounding():
                return
            self._legs = self._legs[1:]
            if not self._legs and leg.reverse:  # backed off: look again
                self._legs = self._plan(pose)
                self._begin_leg(pose)
                return
            self._begin_leg(pose)

    def _begin_leg(self, pose):
        """A leg that must be met square, with no way left to become so, begins with a turn on the spot."""
        self._backing = False
        self._turning = bool(self._legs) and self._stops_before(self._legs[0], pose[0], pose[2])

    def _stops_before(self, leg, x, yaw):
        turn = float(se2.wrap_angle(leg.heading - yaw))
        square = self.settings.drive.square
        through_gap = x < -square + 0.1 and leg.end[0] > 0.0
        return abs(turn) > self.settings.drive.turn_start or (through_gap and not settles(-square - x, turn))

    def _rounding(self):
        if len(self._legs) < 2 or self._legs[0].reverse or self._legs[1].reverse:
            return 0.02
        heading = self._legs[0].heading
        if self._stops_before(self._legs[1], self._legs[0].end[0], heading):
            return 0.02
        corner = abs(float(se2.wrap_angle(self._legs[1].heading - heading)))
        return 0.02 + self.settings.drive.cruise / self.settings.drive.turn * np.tan(corner / 2.0)

    # ---- speed -------------------------------------------------------------------------------------

    def _speed(self, pose, leg):
        drive = self.settings.drive
        direction = leg.direction
        left = float(direction @ (leg.end - pose[:2]))
        speed = drive.cruise
        if leg.reverse:
            speed = drive.careful
        elif self._in_gap(pose, 0.5):
            room = 0.2 if self.half_gap is None else self.half_gap - self.chair.half_width
            share = np.clip((room - 0.04) / 0.1, 0.0, 1.0)
            speed = drive.careful + share * (drive.door - drive.careful)
        if len(self._legs) == 1 or self._rounding() <= 0.02:
            speed = min(speed, max(0.08, np.sqrt(2.0 * drive.braking * max(0.0, left))))
        return float(speed)

    def _in_gap(self, pose, before):
        """Whether any part of the chair is between ``before`` metres before the plane and the plane's far side."""
        return -before < pose[0] + self.chair.front and pose[0] + self.chair.rear < 0.1

    def _may_turn(self, pose):
        return not (pose[0] > -self.chair.circumscribed_radius - 0.1 and pose[0] + self.chair.rear < 0.1)

    # ---- what a person does when it goes wrong ------------------------------------------------------

    def _misses_gap(self, pose):
        """Whether a front corner would meet a jamb, seen just before it does."""
        if self.half_gap is None or not -0.25 < pose[0] + self.chair.front < -0.08:
            return False
        front = se2.transform_points(pose, [[self.chair.front, s * self.chair.half_width] for s in (1, -1)])
        return bool(np.abs(front[:, 1]).max() > self.half_gap - 0.01)

    def _back_off(self, pose):
        """One leg straight back, far enough to meet the axis anew, then a new plan."""
        again = pose[0] + self.settings.drive.square + MARGIN
        length = max(self.settings.drive.back_off, again if pose[0] < 0.0 else 0.0)
        back = pose[:2] - length * np.array([np.cos(pose[2]), np.sin(pose[2])])
        self._legs, self._turning, self._backing = [Leg(pose[:2].copy(), back, reverse=True)], False, True
        self._moved = None

    def _note_motion(self, now, pose, command):
        pushed = abs(command.v) > 0.05 or abs(command.w) > 0.1
        if (
            self._moved is None
            or not pushed
            or np.hypot(*(pose[:2] - self._moved[:2])) > 0.03
            or abs(float(se2.wrap_angle(pose[2] - self._moved[2]))) > 0.05
        ):
            self._moved, self._moved_at = pose.copy(), now

    def _stuck(self, now, pose):
        return self._moved is not None and now - self._moved_at > self.settings.drive.stuck_time
