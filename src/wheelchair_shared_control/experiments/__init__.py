"""The closed loop by plain calls, its measures, and the comparison of policies."""
