"""Access, uploads, error answers and the web server itself."""
