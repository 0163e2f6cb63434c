"""Depth images and joint states in, occupied cells out. Never reads the scene's ground truth."""
