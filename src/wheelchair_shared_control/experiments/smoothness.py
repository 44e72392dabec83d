"""How smooth a motion and how busy a hand was: SPARC, LDLJ, effort and reversals of the stick."""
import numpy as np

CUTOFF = 10.0  # Hz: SPARC's spectrum is looked at up to here
THRESHOLD = 0.05  # of the peak amplitude
PADDING = 4  # powers of two of zero padding


def sparc(speed, dt):
    """Spectral arc length of a speed profile (n,) sampled every ``dt`` [s]; 0 is perfectly smooth, less is worse.

    Balasubramanian, Melendez-Calderon, Roby-Brami, Burdet, *On the analysis of movement smoothness*, 2015, with its
    constants. NaN for a chair that stood.
    """
    speed = np.asarray(speed, float)
    if len(speed) < 4 or not np.abs(speed).max(initial=0.0) > 0.0:
        return np.nan
    n = int(2 ** (np.ceil(np.log2(len(speed))) + PADDING))
    amplitude = np.abs(np.fft.rfft(speed, n))
    frequency = np.fft.rfftfreq(n, dt)
    amplitude = amplitude / amplitude.max()
    kept = frequency <= CUTOFF
    frequency, amplitude = frequency[kept], amplitude[kept]
    loud = np.nonzero(amplitude >= THRESHOLD)[0]
    frequency, amplitude = frequency[: loud[-1] + 1], amplitude[: loud[-1] + 1]
    if len(frequency) < 2:
        return np.nan
    steps = np.diff(frequency) / (frequency[-1] - frequency[0])
    return float(-np.hypot(steps, np.diff(amplitude)).sum())


def ldlj(speed, dt):
    """Log dimensionless jerk of a speed profile (n,) sampled every ``dt`` [s]; greater is smoother.

    ``-ln(T^3 / v_peak^2 * integral of (d2v / dt2)^2)``, the same paper. NaN for a chair that stood.
    """
    speed = np.asarray(speed, float)
    peak = np.abs(speed).max(initial=0.0)
    if len(speed) < 4 or not peak > 0.0:
        return np.nan
    jerk = np.diff(speed, 2) / dt**2
    duration = (len(speed) - 1) * dt
    total = duration**3 / peak**2 * (jerk**2).sum() * dt
    return float(-np.log(total)) if total > 0.0 else np.nan


def resampled(time, values, dt):
    """``values`` (n,) at ``time`` (n,) [s], linearly between, every ``dt`` [s]."""
    grid = np.arange(time[0], time[-1] + 1e-9, dt)
    return np.interp(grid, time, values)


def effort(time, stick, limits):
    """Mean way [1/s] of the stick, each axis (n, 2) as a share of its full deflection ``limits`` (2,)."""
    stick = np.asarray(stick, float) / np.asarray(limits, float)
    kept = np.isfinite(stick).all(axis=1)
    if kept.sum() < 2:
        return np.nan
    duration = time[kept][-1] - time[kept][0]
    return float(np.hypot(*np.diff(stick[kept], axis=0).T).sum() / duration) if duration > 0.0 else np.nan


def reversals(turn, least=0.2):
    """How often a turn command (n,) [rad/s] swings by ``least`` or more to the other side of where it came from."""
    turn = np.asarray(turn, float)
    turn = turn[np.isfinite(turn)]
    if not len(turn):
        return 0
    count, direction, extreme = 0, 0, turn[0]
    for value in turn:
        if direction >= 0 and value > extreme or direction <= 0 and value < extreme:
            if direction == 0 and abs(value - turn[0]) >= least:
                direction = 1 if value > turn[0] else -1
            if direction != 0:
                extreme = value
        elif direction != 0 and abs(value - extreme) >= least:
            count, direction, extreme = count + 1, -direction, value
    return count
