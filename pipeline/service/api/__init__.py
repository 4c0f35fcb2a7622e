"""The service over HTTP: sending and looking up parts."""
