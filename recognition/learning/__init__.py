"""What is learned: the recogniser, the finder of lines, and the shapes of a die."""
