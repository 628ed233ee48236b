"""Colours of pictures, and how faint the parts are that touch nothing."""

INK = "#1d2230"  # outlines and text
LINK = "#e9ebef"
TOUCHED = "#e8849a"  # links in contact
OBJECT = "#f6c445"
LOOSE = "#b07a4f"  # bodies that come with an object
GOAL = "#1fa774"
KEY_POINT = "#d6252f"
PATH = "#4be3f2"  # fastest escape
EDGE_OF_WORKSPACE = "#d6453d"
PALE = 0.45  # opacity of parts that touch nothing
