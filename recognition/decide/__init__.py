"""From posteriors to a reading: accepted, sent to review or rejected, with reasons."""
