"""Who executes: worker processes of this machine, and of a cluster."""
