"""Convert robots of other formats to RAFF."""
