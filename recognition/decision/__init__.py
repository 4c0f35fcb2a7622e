"""From beliefs to a reading: accepted, sent to review or rejected, and why."""
