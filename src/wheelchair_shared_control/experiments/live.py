"""An episode live through the ROS graph: demo.launch under a roscore of its own, to the referee's result."""
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from wheelchair_shared_control import blending
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.experiments import episode, options

PACKAGE = "wheelchair_shared_control"
LONGEST = 240.0  # s of wall time: start-up, 60 s of simulated time, the figure
POLITE = 15.0  # s for the nodes to end


class LiveError(Error):
    """The nodes could not be run to the end of the episode."""


def drive(chosen, seed, output, figure_file=None, rviz=False):
    """The episode's result under ROS, as ``Episode.run`` gives it. Raises LiveError.

    ``output``: folder for ``roslaunch.log``; ``figure_file``: where the referee draws the crossing, if anywhere.
    """
    if chosen.sigma_scale is not None:
        raise LiveError("--sigma-scale: the nodes take sigma_scale from config/blender.yaml alone")
    scene = episode.description(chosen, seed)
    log_file = Path(output) / "roslaunch.log"
    make(Path(output))
    with tempfile.TemporaryDirectory() as folder, open(str(log_file), "w", encoding="utf-8") as log:
        answer = Path(folder) / "result.json"
        figure = "" if figure_file is None else Path(figure_file).absolute()
        code = _launch(_arguments(chosen, seed, scene, answer, figure, rviz), log)
        if not answer.exists():
            raise LiveError("the nodes ended without a result (exit code %s): see %s" % (code, log_file))
        return json.loads(answer.read_text(encoding="utf-8"))


def check():
    """Refuse to begin where there is no ROS. Raises LiveError."""
    if shutil.which("roslaunch") is None:
        raise LiveError("roslaunch is not on the path: call '. scripts/env.sh' first")


def make(folder):
    """Make a folder that can be written to. Raises LiveError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LiveError("%s: cannot be made: %s" % (folder, error.strerror))
    if not os.access(str(folder), os.W_OK):
        raise LiveError("%s: cannot be written to" % folder)


def end_politely():
    """Ended from outside (timeout, a closed terminal), the process takes its nodes along."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))


def _arguments(chosen, seed, scene, result_file, figure_file, rviz):
    """The arguments of demo.launch; ``scene`` is the episode's description."""
    values = {
        "policy": chosen.policy, "planner": chosen.planner, "user": chosen.user, "guard": _on_off(chosen.guard),
        "model": chosen.model or "", "detector": "on" if chosen.detector else "truth",
        "camera": "%dx%d" % chosen.camera, "person": chosen.person, "seed": seed, "rviz": rviz,
        "result_file": result_file, "figure_file": figure_file,
    }
    for key, value in scene.items():
        values[key] = "%r:%r" % tuple(value) if isinstance(value, list) else value
    for key in ("dead_time", "lag", "drift"):
        if getattr(chosen, key) is not None:
            values[key] = getattr(chosen, key)
    names = options.SCENES + options.USERS + ("paper", "full") + tuple(blending.POLICIES)
    for key in ("map", "doors", "scene", "user", "model", "policy"):
        # roslaunch runs its nodes elsewhere: paths must be whole (that of a policy ends at its colon)
        value = str(values.get(key) or "")
        if value and value not in names and Path(value.split(":")[0]).exists():
            values[key] = os.path.abspath(value)
    return ["%s:=%s" % (key, str(value).lower() if isinstance(value, bool) else value) for key, value in values.items()]


def _on_off(value):
    return "on" if value else "off"


def _free_port():
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return probe.getsockname()[1]


def _launch(launch_arguments, log):
    """Run demo.launch under a roscore of its own until the referee ends it; returns the exit code."""
    port = _free_port()
    environment = dict(os.environ, ROS_MASTER_URI="http://localhost:%d" % port, ROS_HOSTNAME="localhost")
    command = ["roslaunch", "--port", str(port), PACKAGE, "demo.launch"] + launch_arguments
    process = subprocess.Popen(
        command, env=environment, stdout=log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True
    )
    try:
        return process.wait(LONGEST)
    except subprocess.TimeoutExpired:
        raise LiveError("the crossing did not end within %g s" % LONGEST)
    finally:
        _stop(process)


def _stop(process):
    """End roslaunch and all its nodes: politely, then not."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
        except ProcessLookupError:
            return
        try:
            process.wait(POLITE)
        except subprocess.TimeoutExpired:
            continue
        if process.returncode is not None and number == signal.SIGINT:
            time.sleep(0.2)
