"""Shared control that takes a powered wheelchair through doorways (Goil, Derry, Argall, ICORR 2013).

Nothing in this package talks to ROS: values go in, values come out. The programs in ``nodes/`` connect
these functions by topics, ``experiments.episode`` composes the same functions by plain calls.
"""

# The generated messages (.msg, .srv) live in the devel or install space, under the same package name.
__path__ = __import__("pkgutil").extend_path(__path__, __name__)
