"""What one learns of a mechanism before it moves: all its assembly modes, and its singularities."""
