"""The environments: the keyword arguments, the episodes, and Gymnasium's two classes around
them.
"""
