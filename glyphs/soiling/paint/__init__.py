"""Paint, coat over coat."""
