"""Ways around obstacles: scenes, and vortex fields for any robot (De Medio and Oriolo, 1991)."""
