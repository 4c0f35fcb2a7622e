"""Simulation of tips on surfaces: traces by either fidelity, pointwise or contact."""
