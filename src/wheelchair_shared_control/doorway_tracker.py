"""Several frames fused into doorways that stay where they are in odom."""
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.values import Doorway

DOUBT = 0.1  # of a surprising frame's innovation, as deviation squared, by which the doorway becomes less certain


class _Track(NamedTuple):
    pose: np.ndarray
    covariance: np.ndarray
    width: float
    width_variance: float
    confidence: float
    seen: int
    missed: int
    unseen: int
    stamp: float
    latched: bool = False


class DoorwayTracker:
    """Memory of the doorways seen so far, in odom.

    Each doorway is a Kalman filter with a fixed state: what moves is the odometry, whose drift with the way driven
    is the process noise. The covariance never falls below the error that all frames share (the unseen thickness
    of the wall, the mounting of the camera).
    """

    def __init__(self, settings):
        """``settings``: group ``doorway_detector``."""
        self._settings = settings.tracker
        self.reset()

    def reset(self):
        """Forget everything."""
        self._tracks = []
        self._last_pose = None

    def update(self, doorways, odom_pose, stamp):
        """Take one frame's ``doorways`` (odom, covariance included), seen from ``odom_pose`` (3,) at ``stamp`` [s].

        Call it for empty frames too. Returns the tracked doorways (tuple of Doorway, odom), nearest first: those
        seen in at least ``tracker/min_seen`` frames, and in ``tracker/min_share`` of the frames in which they were
        in view; of several at one place that which was seen most often. One that was so in ``tracker/latch`` frames
        is latched: told until it is dropped. Their yaw points away from ``odom_pose``.
        """
        s = self._settings
        odom_pose = np.asarray(odom_pose, dtype=float)
        way = 0.0 if self._last_pose is None else float(np.hypot(*(odom_pose[:2] - self._last_pose[:2])))
        self._last_pose = odom_pose
        drift = np.diag([(s.drift * way) ** 2] * 2 + [(np.radians(s.drift_angle) * way) ** 2])
        tracks = [track._replace(covariance=track.covariance + drift) for track in self._tracks]
        taken = set()
        for doorway in sorted(doorways, key=lambda d: -d.confidence):
            index = self._nearest(tracks, doorway, taken)
            if index is None:
                taken.add(len(tracks))
                tracks.append(_Track(np.array(doorway.pose, dtype=float), self._floored(doorway.covariance),
                                     doorway.width, s.width_sigma ** 2, doorway.confidence, 1, 0, 0, stamp))
            else:
                taken.add(index)
                tracks[index] = self._fused(tracks[index], doorway, stamp)
        self._tracks = []
        for index, track in enumerate(tracks):
            if index not in taken:
                # one that may be half out of view speaks against what is not told yet, but drops nothing
                track = track._replace(missed=track.missed + int(self._is_in_view(track, odom_pose)),
                                       unseen=track.unseen + int(self._ought_to_be_seen(track.pose, odom_pose)))
            if track.unseen <= s.max_unseen and stamp - track.stamp <= s.memory:
                self._tracks.append(track)
        self._tracks = [track._replace(latched=track.latched or track.seen >= s.latch and self._is_frequent(track))
                        for track in self._tracks]
        told = [self._told(track, odom_pose) for track in self._believed()]
        return tuple(sorted(told, key=lambda d: float(np.hypot(*(d.pose[:2] - odom_pose[:2])))))

    def _is_frequent(self, track):
        return track.seen >= self._settings.min_share * (track.seen + track.missed)

    def _believed(self):
        s = self._settings
        kept = []
        often = [track for track in self._tracks
                 if track.latched or track.seen >= s.min_seen and self._is_frequent(track)]
        for track in sorted(often, key=lambda t: (-t.seen, -t.confidence)):
            if all(np.hypot(*(track.pose[:2] - other.pose[:2])) > s.gate for other in kept):
                kept.append(track)
        return kept

    def _nearest(self, tracks, doorway, taken):
        best, best_distance = None, self._settings.gate
        for index, track in enumerate(tracks):
            if index in taken:
                continue
            distance = float(np.hypot(*(track.pose[:2] - doorway.pose[:2])))
            # the same doorway seen from its other side has the opposite normal
            turn = abs(np.sin(track.pose[2] - doorway.pose[2]))
            if distance < best_distance and turn < np.sin(np.radians(self._settings.gate_angle)):
                best, best_distance = index, distance
        return best

    def _fused(self, track, doorway, stamp):
        s = self._settings
        measured = np.array(doorway.pose, dtype=float)
        if np.cos(measured[2] - track.pose[2]) < 0.0:
            measured[2] += np.pi
        innovation = measured - track.pose
        innovation[2] = se2.wrap_angle(innovation[2])
        noise = self._floored(doorway.covariance)
        # squared Mahalanobis distance: a frame in which a jamb was taken for another must not move what the others
        # agree on
        surprise = float(innovation @ np.linalg.solve(track.covariance + noise, innovation))
        surprised = surprise > s.surprise
        if surprised:
            noise = noise * (surprise / s.surprise)
        gain = track.covariance @ np.linalg.inv(track.covariance + noise)
        pose = track.pose + gain @ innovation
        pose[2] = se2.wrap_angle(pose[2])
        covariance = (np.eye(3) - gain) @ track.covariance
        if surprised:
            # but one that goes on contradicting is believed in the end
            covariance = covariance + DOUBT * np.outer(innovation, innovation)
        share = track.width_variance / (track.width_variance + s.width_sigma ** 2)
        width = track.width + share * (doorway.width - track.width)
        n = min(track.seen, 20)
        return _Track(pose, self._floored(0.5 * (covariance + covariance.T)), float(width),
                      max((1.0 - share) * track.width_variance, (0.2 * s.width_sigma) ** 2),
                      (n * track.confidence + doorway.confidence) / (n + 1.0), track.seen + 1, track.missed, 0,
                      stamp, track.latched)

    def _floored(self, covariance):
        s = self._settings
        floor = np.array([s.floor ** 2, s.floor ** 2, np.radians(s.floor_angle) ** 2])
        covariance = np.array(covariance, dtype=float)
        missing = np.maximum(floor - np.diag(covariance), 0.0)
        return covariance + np.diag(missing)

    def _ought_to_be_seen(self, pose, odom_pose):
        s = self._settings
        x, y = se2.compose(se2.inverse(odom_pose), pose)[:2]
        turn = abs(se2.wrap_angle(np.arctan2(pose[1] - odom_pose[1], pose[0] - odom_pose[0]) - pose[2]))
        turn = min(turn, np.pi - turn)
        return (s.view_near < np.hypot(x, y) < s.view_far and abs(np.arctan2(y, x)) < np.radians(s.view_angle)
                and turn < np.radians(45.0))

    def _is_in_view(self, track, odom_pose):
        s = self._settings
        half = 0.5 * track.width
        ends = se2.transform_points(track.pose, np.array([[0.0, half], [0.0, -half]]))
        x, y = se2.transform_points(se2.inverse(odom_pose), ends).T
        return bool((np.hypot(x, y) < s.share_far).all()
                    and (np.abs(np.arctan2(y, x)) < np.radians(s.share_angle)).all())

    def _told(self, track, odom_pose):
        pose = track.pose.copy()
        if (pose[:2] - odom_pose[:2]) @ (np.cos(pose[2]), np.sin(pose[2])) < 0.0:
            pose[2] = se2.wrap_angle(pose[2] + np.pi)
        half = track.width / 2.0
        jambs = se2.transform_points(pose, np.array([[0.0, half], [0.0, -half]]))
        return Doorway(pose, track.width, track.confidence, jambs, track.covariance, track.stamp)


def in_frame(a_from_b, doorway):
    """A ``Doorway`` of frame b in frame a, ``a_from_b`` (3,): pose, jambs and covariance."""
    cos, sin = np.cos(a_from_b[2]), np.sin(a_from_b[2])
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return doorway._replace(
        pose=se2.compose(a_from_b, doorway.pose), jambs=se2.transform_points(a_from_b, doorway.jambs),
        covariance=turn @ doorway.covariance @ turn.T)
