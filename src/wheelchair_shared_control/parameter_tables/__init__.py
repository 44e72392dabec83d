"""What each parameter means and what it may be: one table a group, the numbers stand in ``config/``."""
