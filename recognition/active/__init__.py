"""Active touch: choose one pass after the other, until the serial is sure or more touch would not help."""
