"""Where links are and how they move: what pictures and results over a cycle stand on."""
