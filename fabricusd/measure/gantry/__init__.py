"""A simulated gantry: photographs of a thread whose scattering is known."""
