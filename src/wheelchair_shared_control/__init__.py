"""Shared control that takes a powered wheelchair through doorways (Goil, Derry, Argall, ICORR 2013).

Nothing in this package talks to ROS: values go in, values come out. The programs in ``nodes/`` connect
these functions by topics, ``experiments.episode`` composes the same functions by plain calls.
"""
