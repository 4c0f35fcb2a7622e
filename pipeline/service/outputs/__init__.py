"""Outputs: the dispatcher of the outbox and its senders."""
