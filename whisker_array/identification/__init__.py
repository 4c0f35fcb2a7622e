"""What a recording over a test piece tells of the whisker that made it, and of its bench."""
