"""Planners for whole-arm manipulation: via-point trajectories, objectives and optimisers."""
