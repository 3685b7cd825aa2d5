"""Layers and the network (torch), and its checkpoint."""
