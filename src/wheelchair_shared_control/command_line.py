"""What every command line of the package shares: output options, one-line failures, progress bars."""
import argparse
import json
import math
import os
import re
import sys
import tempfile
from pathlib import Path

from tqdm import tqdm

from wheelchair_shared_control.errors import Error


class OutputError(Error):
    """A result cannot be written where it was asked for."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose refusal is one line, exit code 2."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        # argparse takes -30 for a number, but -30:30 for an option
        self._negative_number_matcher = re.compile(r"^-[.\d]")

    def error(self, message):
        self.exit(2, "%s: %s\n" % (self.prog, message))


def add_output_options(parser):
    """Give ``parser`` the options ``--json`` and ``--json-file FILE``."""
    parser.add_argument("--json", action="store_true", help="print one JSON document on stdout and nothing else")
    parser.add_argument("--json-file", metavar="FILE", help="write the JSON document to FILE")


def emit(document, args, text=""):
    """Print ``text`` for people, or ``document`` as JSON, as the options ask."""
    if args.json_file:
        write_atomically(args.json_file, to_json(document) + "\n")
    if args.json:
        print(to_json(document), flush=True)
    elif text:
        print(text, flush=True)


def to_json(document):
    """``document`` as JSON text; NumPy numbers and arrays welcome, non-finite numbers become null."""
    return json.dumps(_plain(document), indent=2, allow_nan=False)


def write_atomically(path, content):
    """Write text or bytes so that ``path`` holds either the old content or all of the new. Raises OutputError."""
    path = Path(path)
    mode = "wb" if isinstance(content, bytes) else "w"
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=str(path.parent), prefix="." + path.name)
        with os.fdopen(handle, mode) as stream:
            stream.write(content)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, str(path))
    except OSError as error:
        if temporary and os.path.exists(temporary):
            os.unlink(temporary)
        raise OutputError("%s: cannot be written: %s" % (path, error.strerror))


def progress(iterable, total=None, label="", done=0):
    """``iterable`` with a progress bar on stderr where that is a terminal; ``done`` of ``total`` were there before."""
    return tqdm(iterable, total=total, desc=label, initial=done, disable=not sys.stderr.isatty(), file=sys.stderr)


def run(main, argv=None):
    """Call ``main(argv)``; a failure that the user can mend is one line on stderr and its exit code."""
    name = Path(sys.argv[0]).name
    try:
        return int(main(sys.argv[1:] if argv is None else argv) or 0)
    except Error as error:
        print("%s: %s" % (name, error), file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        print("%s: interrupted" % name, file=sys.stderr, flush=True)
        return 130
    except BrokenPipeError:
        # the reader (head, less) has gone: nothing is left to say, and the interpreter shall not try
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def _plain(value):
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
