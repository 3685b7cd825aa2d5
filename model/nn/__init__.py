"""Layers and the network (torch), its checkpoint, and its operators outside ONNX's own set."""
