"""Command lines: options, errors and output that all commands share."""
