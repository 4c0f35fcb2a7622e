"""Dies and what they cut: faces, plates, blows and whole serials."""
