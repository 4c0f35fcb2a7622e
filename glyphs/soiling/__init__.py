"""Dirt and damage: what lies on a part, what yields under the tip, what wore off."""
