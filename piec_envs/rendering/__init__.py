"""Frames: drawn in software on matplotlib's Agg canvas, never pyplot, or in space through MuJoCo and OpenGL."""
