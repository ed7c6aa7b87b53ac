"""What is compiled: from leg lengths to platform placements."""
