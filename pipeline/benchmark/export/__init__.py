"""Export of the exam as files, for use with other programs."""
