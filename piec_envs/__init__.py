"""Whole-arm manipulation environments with an escape-time (caging) field."""
