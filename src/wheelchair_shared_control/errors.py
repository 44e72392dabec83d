"""The base of every failure that is told to a person in one line."""


class Error(Exception):
    """Something a user can mend: the message names the culprit (file, key, topic) and the limit."""

    exit_code = 1  # of a command line that ends by it
