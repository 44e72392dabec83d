"""The rivals: shared control as the systems do it that the paper's sections I and II name, a policy a file."""
