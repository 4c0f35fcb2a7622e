"""The service over HTTP: parts sent in and looked up."""
