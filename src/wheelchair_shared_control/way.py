"""The way that a competent person takes to a door and through it, and the stick that keeps to it.

Outside, poses are in the door's frame (x along the crossing, 0 in the plane, y to the left of it); inside, in that
of the line through the gap with most room. The leg through the gap begins at least ``drive/square`` before the plane.
"""
import numpy as np

from wheelchair_shared_control import se2, way_search
from wheelchair_shared_control.assistance import ASSISTING
from wheelchair_shared_control.ground import from_world, room
from wheelchair_shared_control.person import along_leg, turn_on_the_spot
from wheelchair_shared_control.values import STOP, Twist
from wheelchair_shared_control.way_plan import MARGIN, Leg, crossing_line, plan, settles

TRIES = 4  # to meet the axis anew; then the chair goes as it stands
PAUSE = 0.5  # s: who has not pushed for so long begins anew
PULL_ROOM = 0.15  # m: behind the chair, for as long as the stick is pulled back
TOUCH = 0.012  # m: half a cell of the ground's grid; less room counts as a touch


class Way:
    """Path and progress of ``goal_directed``; ``steer`` plans when first asked, and anew where it has been led off."""

    def __init__(self, settings, chair, door_pose_world, world=None):
        self.settings, self.chair = settings, chair
        self._ground, self._line = None, np.zeros(3)
        if world is not None:
            ground = from_world(world, door_pose_world)
            self._line = crossing_line(settings, chair, ground)
            moved = bool(np.any(self._line))
            self._ground = from_world(world, se2.compose(door_pose_world, self._line)) if moved else ground
            way_search.warm_up(self._ground, chair)
        self._late = settings.anticipation * settings.wheelchair.actuation.dead_time
        self._legs, self._turning, self._planned = [], False, False
        self._moved, self._moved_at, self._noted_at, self._turned_at = None, None, -np.inf, None
        self._pulls_until = None
        self._backing, self._tries = False, 0

    def turn_to(self, now, pose, twist, error):
        """Stick that turns the chair by ``error`` [rad] on the spot; along the way first where walls forbid that.

        A chair that is held there is first driven back a little.
        """
        here = self._on_line(pose)
        if self._stuck(now):
            self._back_off(here)
        if self._backing and self._legs:
            command = self.steer(now, pose, twist)
            if command != STOP:
                return command
            self._legs, self._planned, self._backing = [], False, False  # no room for that either
        self._note_motion(now, here, True)
        if self._ground is not None and abs(error) > 0.1:
            yaws = here[2] + np.linspace(0.0, error, 2 + int(abs(error) / 0.1))
            poses = np.column_stack((np.full_like(yaws, here[0]), np.full_like(yaws, here[1]), yaws))
            if room(self._ground, self.chair, poses[1:]).min() < 0.5 * self.settings.plan.minimum:
                return self.steer(now, pose, twist)
        return Twist(0.0, turn_on_the_spot(error, self.settings))

    def steer(self, now, pose, twist, assistance_state=0):
        """Stick ``Twist`` at a believed pose (3,) and velocity.

        Who is assisted leaves walls and stops to the planner: the stick is slowed near walls, but never long at rest
        (that would hold the chair), and pulled back only where the chair is held, shorter than ends the assistance.
        """
        pose = self._on_line(pose)
        assisted = assistance_state == ASSISTING
        if assisted and self._pulls_back(now, pose):
            return Twist(-self.settings.drive.back, 0.0)
        if not self._planned or self._led_off(pose) or (assisted and self._legs and self._legs[0].reverse):
            self._legs, self._planned = self._plan(pose, not assisted), True
            self._begin_leg(pose)
        self._advance(pose, not assisted)
        if assisted:
            return self._assisted(now, pose, twist)
        if not self._legs:
            return STOP
        if self._stuck(now):
            self._back_off(pose)
        command = self._with_care(pose, twist, self._follow(pose, twist))
        self._note_motion(now, pose, asks_for_motion(command))
        return command

    def _assisted(self, now, pose, twist):
        command = self._with_the_planner(now, pose, twist)
        self._note_motion(now, pose, asks_for_motion(command))
        return command

    def _with_the_planner(self, now, pose, twist):
        push = Twist(0.5 * self.settings.drive.back, 0.0)
        if not self._legs:
            return push
        command, _ = self._slowed(pose, self._follow(pose, twist))
        self._turned_at = now if self._turned_at is None or not self._turning else self._turned_at
        if now - self._turned_at > self.settings.drive.stuck_time:
            return Twist(push.v, command.w)
        return command

    def _on_line(self, pose):
        return se2.compose(se2.inverse(self._line), pose)

    def _follow(self, pose, twist):
        leg = self._legs[0]
        command, self._turning = along_leg(pose, leg, self._speed(pose, twist, leg), self._turning, self.settings)
        if self._turning and not self._may_turn(pose):
            # In the gap there is no room to turn on the spot: creep on and let the path's pull do it.
            command = Twist(0.4 * self.settings.drive.back, command.w)
        return command

    # ---- plan --------------------------------------------------------------------------------------

    def _plan(self, pose, may_reverse=True):
        return plan(pose, self.settings, self.chair, self._ground, may_reverse)

    def _led_off(self, pose):
        """Whether the chair is no longer near the leg ahead (another hand has steered it)."""
        if not self._legs or pose[0] > -self.settings.drive.square:
            return False
        leg = self._legs[0]
        direction = leg.direction
        offset = pose[:2] - leg.start
        return abs(direction[0] * offset[1] - direction[1] * offset[0]) > 0.3

    def _advance(self, pose, may_reverse):
        """Drop the leg ahead once its end is reached, or passed, or near enough to round a slight corner."""
        while self._legs:
            leg = self._legs[0]
            direction = leg.direction
            left = float(direction @ (leg.end - pose[:2]))
            if left > self._rounding():
                return
            self._legs = self._legs[1:]
            if not self._legs and self._backing:  # backed off: look again
                self._legs = self._plan(pose, may_reverse)
                self._begin_leg(pose)
                return
            if may_reverse and self._misses_axis(pose):
                self._tries += 1
                self._legs = self._plan(pose)
            self._begin_leg(pose)

    def _misses_axis(self, pose):
        """Whether the leg through the gap begins so far off its line that it is better met again."""
        before = -self.settings.drive.square - pose[0]
        through_gap = self._legs and before > -0.1 and self._legs[0].end[0] > 0.0
        off = abs(float(se2.wrap_angle(self._legs[0].heading - pose[2]))) if self._legs else 0.0
        return bool(
            through_gap and self._tries < TRIES and abs(pose[1]) > 0.03 and not settles(before, off, pose[1])
        )

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

    def _speed(self, pose, twist, leg):
        drive = self.settings.drive
        direction = leg.direction
        left = float(direction @ (leg.end - pose[:2]))
        speed = drive.cruise
        if leg.reverse:
            speed = drive.back
        elif self._in_gap(pose, 0.5):
            speed = drive.door
        if len(self._legs) == 1 or self._rounding() <= 0.02:
            # the chair rolls on while hand, limiter and motors follow
            left -= (drive.reaction + self._late) * abs(twist.v)
            speed = min(speed, max(0.08, np.sqrt(2.0 * drive.braking * max(0.0, left))))
        return float(speed)

    def _in_gap(self, pose, before):
        """Whether any part of the chair is between ``before`` metres before the plane and the plane's far side."""
        return -before < pose[0] + self.chair.front and pose[0] + self.chair.rear < 0.1

    def _may_turn(self, pose):
        return not (pose[0] > -self.chair.circumscribed_radius - 0.1 and pose[0] + self.chair.rear < 0.1)

    # ---- what a person does when it goes wrong ------------------------------------------------------

    def _with_care(self, pose, twist, command):
        """The stick slowed where there is little room; backing off, or standing, where the chair would touch."""
        command, touches = self._slowed(pose, command)
        if touches and not self._backing:
            self._back_off(pose)
            command, touches = self._slowed(pose, self._follow(pose, twist))
        return STOP if touches else command

    def _slowed(self, pose, command):
        """The stick for the room ahead, and whether the chair would touch before the person can stop it."""
        if self._ground is None or (command.v == 0.0 and command.w == 0.0):
            return command, False
        ahead = se2.integrate(pose, command.v, command.w, np.array([0.3, 0.6, 0.9]) + self._late)
        rooms = room(self._ground, self.chair, np.vstack((pose, ahead)))
        share = float(np.clip(rooms.min() / self.settings.drive.room, 0.4, 1.0))
        slowed = Twist(share * command.v, share * command.w)
        then = float(room(self._ground, self.chair, se2.integrate(pose, slowed.v, slowed.w, 0.4 + self._late))[0])
        return slowed, then < TOUCH and then < rooms[0] - 0.002

    def _back_off(self, pose):
        """One leg straight back, far enough to meet the axis anew, or as far as there is room; then a new plan.

        Where there is none behind, a little ahead.
        """
        again = pose[0] + self.settings.drive.square + MARGIN
        length = max(self.settings.drive.back_off, again if pose[0] < 0.0 else 0.0)
        forward = np.array([np.cos(pose[2]), np.sin(pose[2])])
        behind, ahead = self._free_run(pose, -forward, length), self._free_run(pose, forward, 0.2)
        if behind >= 0.1 or behind >= ahead:
            leg = Leg(pose[:2].copy(), pose[:2] - max(behind, 0.05) * forward, reverse=True)
        else:
            leg = Leg(pose[:2].copy(), pose[:2] + ahead * forward)
        self._legs, self._planned, self._turning, self._backing = [leg], True, False, True
        self._moved = None

    def _pulls_back(self, now, pose):
        """Whether the stick is pulled back now: the chair is held although it is assisted, and has room behind."""
        if self._pulls_until is None and self._stuck(now):
            self._pulls_until = now + self.settings.drive.pull_time
        if self._pulls_until is None:
            return False
        backward = -np.array([np.cos(pose[2]), np.sin(pose[2])])
        if now < self._pulls_until and self._free_run(pose, backward, PULL_ROOM + 0.05) >= PULL_ROOM:
            return True
        # On along the same way: a new one might begin behind the chair, which may not go back while it is assisted.
        self._pulls_until = self._moved = self._turned_at = None
        return False

    def _free_run(self, pose, direction, length):
        """How far [m] the chair can be pushed along ``direction`` (2,), at most ``length``."""
        if self._ground is None:
            return length
        steps = np.arange(0.0, length + 0.05, 0.05)
        poses = np.column_stack((pose[:2] + steps[:, None] * direction, np.full(len(steps), pose[2])))
        free = room(self._ground, self.chair, poses)
        blocked = (free < TOUCH) & (free < free[0])
        return float(steps[max(0, int(np.argmax(blocked)) - 1)]) if blocked.any() else length

    def _note_motion(self, now, pose, asked):
        if (
            self._moved is None
            or not asked
            or now - self._noted_at > PAUSE
            or np.hypot(*(pose[:2] - self._moved[:2])) > 0.03
            or abs(float(se2.wrap_angle(pose[2] - self._moved[2]))) > 0.05
        ):
            self._moved, self._moved_at = pose.copy(), now
        self._noted_at = now

    def _stuck(self, now):
        """Whether the chair has not moved although the stick has long been pushed, up to the last moment."""
        return (
            self._moved is not None and now - self._noted_at <= PAUSE
            and now - self._moved_at > self.settings.drive.stuck_time
        )


def asks_for_motion(command):
    """Whether the stick asks for a motion that must show within ``stuck_time``."""
    return abs(command.v) > 0.05 or abs(command.w) > 0.1
