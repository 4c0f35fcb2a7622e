"""Views of a part on one grid."""
