"""Around every request: who may come in, what is sent, what goes wrong, and the web server itself."""
