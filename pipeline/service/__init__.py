"""The service: intake, composition and protocols."""
