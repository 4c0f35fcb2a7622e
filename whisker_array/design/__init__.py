"""Design of whiskers and arrays: limits, search, and the accuracy of plans."""
