"""Training of the recogniser and the line finder; learning the shapes of a die."""
