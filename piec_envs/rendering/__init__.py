"""Drawing in software: matplotlib's Agg canvas, never pyplot, no GL."""
