"""Many episodes, on one process or several; the results come in the order of the asking."""
from joblib import Parallel, delayed

from wheelchair_shared_control import command_line
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.experiments import episode


def run(pairs, jobs=1, label="episodes"):
    """Results of ``pairs`` [(options, seed), ...]; ``jobs`` processes. Raises Error."""
    pairs = list(pairs)
    tasks = (delayed(_one)(options, seed) for options, seed in pairs)
    # the processes keep their own compiled kernels and open no pool of threads each
    parallel = Parallel(n_jobs=jobs, return_as="generator", batch_size=1, inner_max_num_threads=None)
    outcomes = list(command_line.progress(parallel(tasks), len(pairs), label))
    for outcome in outcomes:
        if isinstance(outcome, str):
            raise Error(outcome)
    return outcomes


def _one(options, seed):
    """One result, or the message of a failure that the user can mend (an exception would bring a traceback)."""
    try:
        return episode.run(options, seed)
    except Error as error:
        return str(error)
