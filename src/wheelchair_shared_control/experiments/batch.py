"""Many episodes, on one process, several, or a Dask cluster."""
import warnings
from concurrent.futures.process import BrokenProcessPool

from joblib import Parallel, delayed, parallel_config

from wheelchair_shared_control import command_line
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.experiments import code_version, episode


class BatchError(Error):
    """A cluster cannot be reached, or a worker died."""


def run(pairs, jobs=1, label="episodes", dask=None):
    """Results of ``pairs`` [(options, seed), ...] in their order. Raises Error."""
    return [result for _, result in as_completed(list(pairs), jobs, label, dask)]


def as_completed(pairs, jobs=1, label="episodes", dask=None, done=0):
    """Yield ((options, seed), result) in the order of ``pairs``, each as soon as it is there.

    ``jobs`` processes on this machine, or the workers of the Dask scheduler at ``dask``; every episode is the same
    bit for bit wherever it runs. ``done``: how many more the progress bar counts as done already. Raises Error.
    """
    if not pairs:
        return
    code = code_version.digest()
    tasks = (delayed(_one)(options, seed, code) for options, seed in pairs)
    backend, lost = _backend(jobs, dask)
    try:
        with backend:
            outcomes = Parallel(n_jobs=-1 if dask else jobs, return_as="generator", batch_size=1)(tasks)
            for pair, outcome in zip(pairs, command_line.progress(outcomes, len(pairs) + done, label, done)):
                if isinstance(outcome, str):
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")  # that what was begun is given up
                        outcomes.close()
                    raise Error(outcome)
                yield pair, outcome
    except lost as error:
        raise BatchError("a worker died: %s" % " ".join(str(error).split())[:200])


def _backend(jobs, dask):
    """The context in which joblib runs, and the error that tells of a worker's death (Dask's own retries failed)."""
    if dask is None:
        return parallel_config(backend="loky", n_jobs=jobs), BrokenProcessPool
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise BatchError("--dask needs the package 'distributed' (pip install distributed)")
    try:
        Client(dask, timeout="20s")
    except (OSError, TimeoutError, ValueError) as error:
        raise BatchError("no Dask scheduler at %s: %s" % (dask, error))
    return parallel_config(backend="dask"), KilledWorker


def _one(options, seed, code):
    """One result, or the message of a failure that the user can mend (an exception would bring a traceback).

    ``code`` is the digest of the caller's code: a Dask worker may have been started before an edit, or elsewhere.
    """
    if code_version.digest() != code:
        return "a worker runs other code or other numbers of config/ than this process: start the workers anew"
    try:
        return episode.run(options, seed)
    except Error as error:
        return str(error)
