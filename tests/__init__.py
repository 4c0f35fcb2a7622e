"""A package, so that the `tests` that Hershey-Fonts installs beside it does not come first."""
