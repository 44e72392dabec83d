"""Runs the package's checks, tests and rostests, and counts their cases.

Every check leaves a result: one that ends without its result file counts as a failure, a case that was
skipped is listed with its reason. The last line is ``N passed, N failed[, N skipped]``.
"""
import argparse
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
import uuid
import xml.etree.ElementTree as ElementTree

PACKAGE = "wheelchair_shared_control"
ROOT = pathlib.Path(__file__).resolve().parent.parent
MARK = "WSC_TEST_RUN"
# rostest starts a master and nodes around the programs, whose own deadlines it keeps.
ROSTEST_OVERHEAD = 60.0
DEFAULT_TIME_LIMIT = 60.0
UNIT_DEADLINE = 600.0


class Tally:
    """Cases passed, failed and skipped, with what to say about the last two."""

    def __init__(self):
        self.passed = 0
        self.failed = []
        self.skipped = []

    def add(self, name, failure=None):
        if failure is None:
            self.passed += 1
        else:
            self.failed.append((name, failure))
        print("%-7s %s" % ("failed" if failure is not None else "passed", name))
        if failure:
            print("        " + failure.strip().replace("\n", "\n        "))
        sys.stdout.flush()

    def add_junit(self, name, path):
        """Count the cases of a JUnit file; a missing, broken or empty one is a failure."""
        try:
            suites = list(ElementTree.parse(str(path)).getroot().iter("testsuite"))
        except (OSError, ElementTree.ParseError) as error:
            return self.add(name, "no result: %s" % error)
        cases = unmatched = 0
        for suite in suites:
            bad = 0
            for case in suite.iter("testcase"):
                cases += 1
                label = "%s: %s.%s" % (name, case.get("classname", "").split(".")[-1], case.get("name"))
                failure = next((child for child in case if child.tag in ("failure", "error")), None)
                skipped = case.find("skipped")
                if failure is not None:
                    bad += 1
                    self.add(label, (failure.get("message") or failure.text or "failed")[-3000:])
                elif skipped is not None:
                    self.skipped.append((label, skipped.get("message") or ""))
                else:
                    self.passed += 1
            # A fixture that fails has no case of its own in rosunit's files.
            unmatched += max(0, int(suite.get("errors", 0)) + int(suite.get("failures", 0)) - bad)
        if unmatched:
            self.add(name, "%d errors outside the cases: %s" % (unmatched, path))
        elif not cases:
            self.add(name, "no case in %s" % path)
        return None

    def summary(self):
        for title, rows in (("skipped", self.skipped), ("failed", self.failed)):
            for name, reason in rows:
                print("%s: %s: %s" % (title, name, reason.strip().split("\n")[0]))
        line = "%d passed, %d failed" % (self.passed, len(self.failed))
        return line + (", %d skipped" % len(self.skipped) if self.skipped else "")


def run(command, deadline, log=None, **options):
    """(exit code or None when the deadline passed, output) of a program, whose children end with it."""
    mark = uuid.uuid4().hex
    process = subprocess.Popen(
        [str(word) for word in command], cwd=str(ROOT), env=dict(os.environ, **{MARK: mark}), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True, **options)
    try:
        output, code = process.communicate(timeout=deadline)[0], process.returncode
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
        try:
            output = process.communicate(timeout=20)[0]
        except subprocess.TimeoutExpired:
            output = ""
        code = None
    finally:
        end_marked(mark)
    if log is not None:
        log.write_text(output)
    return code, output


def end_marked(mark):
    """End what a run left behind: the processes that carry its mark in their environment."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        alive = []
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                if ("%s=%s" % (MARK, mark)).encode() in (entry / "environ").read_bytes().split(b"\0"):
                    os.kill(int(entry.name), number)
                    alive.append(entry)
            except OSError:
                continue
        if not alive:
            return
        time.sleep(1.0)


def forget(path):
    """Remove a result of an earlier run: it must never pass for one of this run."""
    if path.is_dir():
        shutil.rmtree(str(path))
    elif path.exists():
        path.unlink()


def lint(tally, only=None):
    """Style, the catkin package, and the promise that the core never talks to ROS."""
    workspace_copy = ROOT / "build" / "catkin_ws" / "src" / PACKAGE
    checks = {
        "ruff": ["ruff", "check", "--output-format=concise", "."],
        # rosdep's database needs the network and says nothing about Debian's packages.
        "catkin_lint": ["catkin_lint", "--offline", "-W1", "--strict", workspace_copy],
        "shell": ["bash", "-n", *sorted((ROOT / "scripts").glob("*.sh"))],
    }
    for name, command in checks.items():
        if only in (None, name):
            code, output = run(command, 120)
            tally.add("lint: " + name, None if code == 0 else output)
    if only in (None, "core"):
        found = [
            "%s:%d: %s" % (path.relative_to(ROOT), number, line.strip())
            for path in sorted((ROOT / "src").rglob("*.py"))
            for number, line in enumerate(path.read_text().splitlines(), 1)
            if re.search(r"rospy|^\s*(import|from)\s+(actionlib|tf2?_ros|tf|roslib)\b", line)
        ]
        tally.add("lint: core", "\n".join(["ROS inside src/:", *found]) if found else None)


def unit(tally, results, only=None):
    """pytest of test/unit; NAME is a module (``guard``) or an expression of pytest's -k."""
    path = results / "unit.xml"
    forget(path)
    module = ROOT / "test" / "unit" / ("test_%s.py" % (only or "").replace("test_", ""))
    selection = [] if only is None else [module] if module.exists() else ["-k", only]
    # Not captured: the progress is worth seeing.
    command = [sys.executable, "-m", "pytest", "-q", "--junitxml=%s" % path, *map(str, selection)]
    try:
        code = subprocess.call(command, cwd=str(ROOT), timeout=UNIT_DEADLINE)
    except subprocess.TimeoutExpired:
        return tally.add("unit", "deadline of %.0f s passed" % UNIT_DEADLINE)
    tally.add_junit("unit", path)
    if code not in (0, 1):
        tally.add("unit", "pytest ended with code %d" % code)
    return None


def deadline_of(test_file):
    """Seconds for a whole .test file: its programs' time limits, and the overhead."""
    limits = [
        float(test.get("time-limit", DEFAULT_TIME_LIMIT))
        for test in ElementTree.parse(str(test_file)).getroot().iter("test")
    ]
    return sum(limits) + ROSTEST_OVERHEAD + 10.0 * len(limits)


def rostests(tally, results, only=None):
    """Every test/rostest/*.test, one after another."""
    files = sorted((ROOT / "test" / "rostest").glob("*.test"))
    if only is not None:
        files = [path for path in files if path.stem == only.replace(".test", "")]
        if not files:
            return tally.add("rostest: " + only, "no file test/rostest/%s.test" % only)
    if not files:
        return tally.add("rostest", "no file in test/rostest")
    for path in files:
        name = "rostest: " + path.stem
        base = results / "rostest" / path.stem
        forget(base)
        started = time.monotonic()
        code, output = run(
            ["rostest", "--pkgdir=%s" % ROOT, "--package=%s" % PACKAGE, "--results-base-dir=%s" % base,
             "--results-filename=%s.xml" % path.stem, path],
            deadline_of(path), log=results / ("rostest_%s.log" % path.stem))
        print("        %s took %.0f s" % (path.stem, time.monotonic() - started))
        own = base / PACKAGE
        if code is None:
            tally.add(name, "deadline of %.0f s passed\n%s" % (deadline_of(path), output[-1500:]))
            continue
        before = len(tally.failed)
        # rostest's own file tells which programs ran at all, each program's file which cases.
        overall = own / ("rostest-%s.xml" % path.stem)
        try:
            ran = list(ElementTree.parse(str(overall)).getroot().iter("testcase"))
        except (OSError, ElementTree.ParseError) as error:
            tally.add(name, "no result: %s\n%s" % (error, output[-1500:]))
            continue
        if not ran:
            tally.add(name, "no <test> in the file")
        for case in ran:
            program = case.get("name")[len("test"):]
            failure = next((child for child in case if child.tag in ("failure", "error")), None)
            if failure is not None:
                tally.add("%s: %s" % (name, program), (failure.text or "failed")[-1500:])
            else:
                tally.add_junit("%s: %s" % (name, program), own / ("rosunit-%s.xml" % program))
        if code != 0 and len(tally.failed) == before:
            tally.add(name, "rostest ended with code %d\n%s" % (code, output[-1500:]))
        if len(tally.failed) == before:
            print("passed  " + name)
    return None


def main():
    parser = argparse.ArgumentParser(prog="scripts/test.sh", description=__doc__.split("\n")[0])
    parser.add_argument("part", nargs="?", choices=["all", "lint", "unit", "rostest"], default="all")
    parser.add_argument("name", nargs="?", help="one check, one test module or -k expression, one .test file")
    args = parser.parse_args()
    results = ROOT / "output" / "test"
    results.mkdir(parents=True, exist_ok=True)
    os.environ["ROS_HOME"] = str(results / "ros")
    tally = Tally()
    started = time.monotonic()
    if args.part in ("all", "lint"):
        lint(tally, args.name)
    if args.part in ("all", "unit"):
        unit(tally, results, args.name)
    if args.part in ("all", "rostest"):
        rostests(tally, results, args.name)
    print("\nin %.0f s; results in %s" % (time.monotonic() - started, results))
    if not tally.passed and not tally.failed:
        tally.add(" ".join(filter(None, [args.part, args.name])), "nothing was run")
    print(tally.summary())
    return 1 if tally.failed else 0


if __name__ == "__main__":
    sys.exit(main())
