"""The expert who knows shapes: templates predicted by the physics of touch."""
