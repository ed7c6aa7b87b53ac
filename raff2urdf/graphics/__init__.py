"""Graphics of robots: graphic files, and a drawing for nodes without any."""
