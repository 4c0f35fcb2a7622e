"""Mud that splashed, ran, dried and cracked."""
