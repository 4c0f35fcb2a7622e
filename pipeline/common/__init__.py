"""Settings, records and safe files for all packages."""
