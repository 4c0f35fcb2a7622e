"""The service: intake, composition, and what it speaks."""
