"""Marks of a text that was read: where each lies, which strokes were felt, how deep they are, how good they are."""
