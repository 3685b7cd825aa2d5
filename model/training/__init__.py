"""Training (torch): data sets, variation, the trainer, evaluation, the command line."""
