"""What the commands share of the terminal: the parser, completion in shells, standard output."""
