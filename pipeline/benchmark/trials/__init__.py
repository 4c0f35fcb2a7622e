"""The run, what it keeps, and the gate."""
