"""Whatever can be looked at, on one grid."""
