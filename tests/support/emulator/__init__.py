"""A bench without iron: controller and converter that answer over pseudo-terminals as their firmware does.

World       one clock, one stage, one plate: where the tips are, and what they feel there
Firmware    a pseudo-terminal, a planner, moves in slices of time      -- EmulatedGrbl, EmulatedMarlin
EmulatedDaq samples the world by the world's clock
"""
