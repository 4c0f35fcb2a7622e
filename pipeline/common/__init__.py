"""What every room needs: errors, settings, records, and safe files."""
