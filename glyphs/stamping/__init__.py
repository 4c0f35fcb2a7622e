"""Dies and their marks: faces, plates, blows and whole serials."""
