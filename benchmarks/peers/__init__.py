"""Planners of others, put to the same questions as ours: same arm, same cells, same distances kept, same joint step."""
