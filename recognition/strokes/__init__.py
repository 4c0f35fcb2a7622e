"""Strokes of characters on a relief: where they lie, how deep they are, and which of them were felt."""
