"""A task, a robot and contact dynamics as one thing that simulates, and what its states are
measured by.
"""
