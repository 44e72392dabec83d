"""How simulated time keeps up with the wall's."""


class Pace:
    """Simulated time follows ``factor`` times wall time; what it cannot catch up it drops.

    ``longest`` [s] of wall time is the most that it ever lags behind before it counts from anew.
    """

    def __init__(self, factor, longest=0.25):
        self._factor, self._longest = factor, longest
        self._wall = self._simulated = None
        self.dropped = 0.0

    def wait(self, wall, simulated):
        """Seconds to sleep before time ``simulated`` [s] is due; 0 when it is late."""
        if self._wall is None:
            self._wall, self._simulated = wall, simulated
        due = self._wall + (simulated - self._simulated) / self._factor
        if wall - due > self._longest:
            self.dropped += wall - due
            self._wall, self._simulated = wall, simulated
            return 0.0
        return max(0.0, due - wall)


class Due:
    """Tells when something that happens at ``rate`` [Hz] is due again; moments stay on a grid."""

    def __init__(self, rate):
        self._period, self._next = 1.0 / rate, 0.0

    def at(self, time):
        """Whether it is due at ``time`` [s]; then the next moment is set."""
        if time < self._next - 1e-6:
            return False
        self._next += self._period
        if self._next <= time:  # after a pause: what was missed stays missed
            self._next = (time // self._period + 1.0) * self._period
        return True
